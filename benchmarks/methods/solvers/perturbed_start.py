"""Perturbed reference: the reference from a start moved a little, which shows the spread of valid answers.

Wrinkling cloth has several minima, and which one is reached hangs on the last digits. What these runs differ
by is the uncertainty of whatever is compared with the reference.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.methods.solvers.simulation import Simulation
from benchmarks.scene import BuiltScene


@dataclass
class PerturbedStart(Simulation):
    """Simulation from a start whose free vertices are each moved by `shift` [m] in a random direction.

    The directions are seeded by the shift, so that every run is perturbed differently.
    """

    shift: float = 0.0

    def prepare(self, scene: BuiltScene) -> None:
        """Move the start and prepare the simulation."""
        seed = np.float64(self.shift).view(np.uint64)
        direction = np.random.default_rng(int(seed)).standard_normal(scene.start.shape)
        direction *= self.shift / np.linalg.norm(direction, axis=1, keepdims=True)
        direction[scene.cloth.pins] = 0.0
        start = scene.start_state + np.stack([direction, np.zeros_like(direction)])
        super().prepare(dataclasses.replace(scene, settle=lambda: start))


def make(*, models: Path, seed: int, shift: float) -> PerturbedStart:
    """Make the reference from a start perturbed by `shift` [m]."""
    return PerturbedStart(options={}, shift=shift)
