"""A data set of three short sequences of the tube, built without simulating."""

from __future__ import annotations

import json
import time
from functools import cache
from pathlib import Path

import numpy as np

from reference_sim.trajectory import Trajectory
from snug.motion.library import make_motion
from snug.networks.dressed_body import DressedBody
from snug.training.simulated_data import INDEX
from tests.benchmarks.runner.tasks_by_hand import InProcess

FRAMES = 18  # two windows of the supervised network


class Here(InProcess):
    """Simulates in this process; stops as by Ctrl-C after `most` sequences."""

    most, done = 1_000_000, 0

    def __init__(self, plan, folder, assets) -> None:
        super().__init__(folder, assets)

    def together(self, ready, bar):
        for one in super().together(ready, bar):
            Here.done += 1
            yield one
            if Here.done >= Here.most:
                raise KeyboardInterrupt


def draped(scene, entry, folder) -> Trajectory:
    """In place of a simulation: the garment skinned to the body, and times as a clock shows them."""
    worn = scene.dressed
    positions = DressedBody(worn.body, worn.garment).skinned(worn.motion)
    clock = np.full(len(positions), time.perf_counter())
    times = np.arange(len(positions)) / worn.motion.fps
    return Trajectory(positions, worn.garment.faces, times, clock, status="converged")


make_once = cache(make_motion)  # half a second for each command otherwise


def words(tube: Path, out: Path, *more: str) -> list[str]:
    given = ["--sequences", "3", "--frames", str(FRAMES), "--settle", "2", "--garment", str(tube)]
    return ["build", *given, *more, "-o", str(out)]


def changed_index(folder: Path, change) -> None:
    """Let `change` have the index of a data set, and keep what it made of it."""
    index = json.loads((folder / INDEX).read_text())
    change(index)
    (folder / INDEX).write_text(json.dumps(index))
