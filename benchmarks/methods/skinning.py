"""The garment follows the body's joints and nothing else: the free baseline that belongs in every table.

Weights are smoothed as much as those of the networks' default recipe, so that what a network adds to
skinning is all that tells them apart.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from reference_sim import Trajectory

from ..method import Method
from ..scene import BuiltScene

WARM_UP = 10


class Skinning(Method):
    """One linear blend a frame; joint transforms are ready before, as for the networks."""

    def prepare(self, scene: BuiltScene) -> None:
        from snug.dressed_body import DressedBody
        from snug.recipe import DEFAULT
        from snug.skinning import skin

        assert scene.dressed is not None
        self.motion, betas = scene.dressed.motion, scene.dressed.betas
        dressed = DressedBody(scene.dressed.body, scene.dressed.garment)
        self.rest, self.weights = dressed.rest(betas), dressed.weights(DEFAULT.smoothing)
        self.transforms = dressed.transforms(self.motion.poses, betas)
        self.pelvis = dressed.pelvis(self.motion, betas)
        self.faces = np.asarray(scene.cloth.faces)
        for frame in range(min(WARM_UP, self.motion.frames)):
            skin(self.rest, self.weights, self.transforms[frame])

    def run(self) -> Trajectory:
        import torch

        from snug.skinning import skin

        frames = self.motion.frames
        posed = np.empty((frames, *self.rest.shape))
        with torch.inference_mode():
            for frame in range(frames):
                posed[frame] = skin(self.rest, self.weights, self.transforms[frame]).numpy()
        return Trajectory(
            positions=posed + self.pelvis[:, None],
            faces=self.faces,
            times=np.arange(frames) / self.motion.fps,
            status="ok",
            reason="",
            provenance={"method": "skinning"},
            frame_fields={},
        )

    def quasi_static(self) -> Trajectory:
        """Its answer to poses held still: the same."""
        return self.run()


def make(*, models: Path, seed: int) -> Skinning:
    """Skinning alone; it has no seed and no model."""
    return Skinning()
