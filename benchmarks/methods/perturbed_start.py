"""The reference once more, its start moved by a billionth of a metre: how far apart two right answers are.

Wrinkling cloth has several minima, and which one is reached hangs on the last digits. The distance between
this run and the reference is the sensitivity: no vertex distance of the scene below it means anything.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np

from ..scene import BuiltScene
from .simulation import Simulation

SHIFT = 1e-9  # [m]


class PerturbedStart(Simulation):
    """A simulation from a start whose free vertices are each moved by SHIFT in a direction of their own."""

    def prepare(self, scene: BuiltScene) -> None:
        direction = np.random.default_rng(0).standard_normal(scene.start.shape)
        direction *= SHIFT / np.linalg.norm(direction, axis=1, keepdims=True)
        direction[scene.cloth.pins] = 0.0
        start = scene.start_state + np.stack([direction, np.zeros_like(direction)])
        super().prepare(dataclasses.replace(scene, settle=lambda: start))


def make(*, models: Path, seed: int) -> PerturbedStart:
    """The reference from a moved start."""
    return PerturbedStart(options={})
