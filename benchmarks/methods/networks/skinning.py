"""Skinning alone: the garment follows the body's joints. The free baseline of every table.

Weights are smoothed as much as those of the networks' default recipe, so that what a network adds to
skinning is all that tells them apart.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from benchmarks.method import Method
from benchmarks.scene import BuiltScene
from reference_sim.trajectory import Trajectory
from snug.networks.dressed_body import DressedBody
from snug.networks.roll_out import collect_frames, prepare_frame_inputs, prepare_skinned_frames
from snug.recipe import DEFAULT


class Skinning(Method):
    """One linear blend a frame; joint transforms are ready before, as for the networks."""

    def prepare(self, scene: BuiltScene) -> None:
        """Smooth the weights and make the joint transforms. Not timed."""
        assert scene.dressed is not None
        self.motion, self.betas = scene.dressed.motion, scene.dressed.betas
        self.dressed = DressedBody(scene.dressed.body, scene.dressed.garment)
        self.frames = prepare_skinned_frames(self.dressed, self.motion, DEFAULT.smoothing, self.betas)
        self.faces = np.asarray(scene.cloth.faces)

    def run(self) -> Trajectory:
        """Skin all frames."""
        positions, seconds = collect_frames(self.frames(), np.arange(self.motion.frames))
        return Trajectory(
            positions=positions,
            faces=self.faces,
            times=np.arange(len(positions)) / self.motion.fps,
            frame_seconds=seconds,
            provenance={"method": "skinning"},
        )

    def inputs(self, scene: BuiltScene) -> Callable[[int], object]:
        """Return a function of the frame that makes joint transforms."""
        return prepare_frame_inputs(None, self.dressed, self.motion, self.betas)

    def quasi_static(self) -> Trajectory:
        """Return the roll-out itself: skinning has no dynamics."""
        return self.run()


def make(*, models: Path, seed: int) -> Skinning:
    """Make skinning alone; it has no seed and no model."""
    return Skinning()
