"""Trained networks, rolled out one frame at a time as an application would run them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from benchmarks.method import Method
from benchmarks.results.run_folder import model_path
from benchmarks.scene import BuiltScene
from reference_sim.trajectory import Trajectory
from snug.networks.dressed_body import DressedBody
from snug.networks.roll_out import prepare_batch, prepare_frame_inputs, prepare_roll_out, roll_out
from snug.networks.trained_model import TrainedModel


@dataclass
class Network(Method):
    """Network read from its file. Features are made and the network is warmed up before run().

    then: applied to each frame, as post-processing.
    """

    path: Path
    then: Callable[[np.ndarray, int], np.ndarray] | None = field(default=None, init=False)

    def prepare(self, scene: BuiltScene) -> None:
        """Read the model, make the features and warm up. Not timed."""
        assert scene.dressed is not None
        self.model = TrainedModel.load(self.path)
        self.motion, self.betas = scene.dressed.motion, scene.dressed.betas
        self.dressed = DressedBody(scene.dressed.body, scene.dressed.garment)
        self.frames = prepare_roll_out(
            self.model, self.dressed, self.motion, self.betas, kept=scene.kept,
            earlier=scene.dressed.before, postprocess=self.then,
        )  # fmt: skip

    def run(self) -> Trajectory:
        """Roll out all frames."""
        return self.frames()

    def inputs(self, scene: BuiltScene) -> Callable[[int], object]:
        """Return a function of the frame that makes features and joint transforms."""
        assert scene.dressed is not None
        return prepare_frame_inputs(
            self.model, self.dressed, self.motion, self.betas, earlier=scene.dressed.before
        )

    def batch(self, copies: int) -> Callable[[], np.ndarray]:
        """Return a function that computes `copies` bodies in this motion at once, (T, copies, V, 3) [m]."""
        return prepare_batch(self.model, self.dressed, self.motion, copies=copies)

    def quasi_static(self) -> Trajectory:
        """Return the quasi-static solutions: each pose kept until nothing moves. Never on the clock."""
        return roll_out(self.model, self.dressed, self.motion, self.betas, quasi_static=True)


def make(*, models: Path, seed: int, kind: str) -> Network:
    """Make the network of that name and seed: "untrained" or a key of TRAININGS in catalogue/trainings.py."""
    return Network(model_path(models, kind, seed))
