"""Tasks and scenes as a test wants them, without a plan."""

from __future__ import annotations

import dataclasses
import time
from contextlib import suppress

import numpy as np
import pytest

from benchmarks.assets import Assets
from benchmarks.methods.declared_networks import TRAININGS
from benchmarks.presets import Preset, find_preset
from benchmarks.results.run_folder import RunFolder
from benchmarks.runner.networks import NetworkTraining
from benchmarks.runner.task import Context, failure
from benchmarks.scene import BuiltScene
from benchmarks.scenes import SCENES, of_garment


def small_scene(name: str, *, cells: int = 6, frames: int = 10) -> BuiltScene:
    """A scene of a small sheet."""
    scene = next(scene for scene in SCENES if scene.name == name)
    sizes = {"sheet_cells": cells, "sheet_frames": frames}
    return dataclasses.replace(scene, sizes=(), options=sizes).build()


def thirds(positions: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The same surface in other triangles, each split at its centre: positions (T,V+F,3), faces (3F,3)."""
    centres = positions.shape[1] + np.arange(len(faces))
    split = [np.column_stack([faces[:, [k, (k + 1) % 3]], centres]) for k in range(3)]
    return np.concatenate([positions, positions[:, faces].mean(axis=2)], axis=1), np.concatenate(split)


def dressed_scene(motion: str, garment: str = "tshirt", *, part: str = "whole", preset: Preset | None = None):
    """The declaration of a body in a garment."""
    return of_garment(garment).scene(motion, part).at(preset or find_preset("smoke"))


def assets_of(dressed, motion) -> Assets:
    """A dressed body as the T-shirt of a run, and one motion."""
    return Assets(dressed.body, {"tshirt": dressed.garment}, {motion.name: motion}, {})


def training(name: str, *motions: str, steps: int, key: str = "0", device: str = "cpu") -> NetworkTraining:
    """The training of a network of the T-shirt."""
    return NetworkTraining(
        training=name, seed=0, garment="tshirt", steps=steps,
        chosen=TRAININGS.get(name), motions=motions, device=device, inputs={"key": key}, software={},
        simulated={m: ("data", m) for m in motions if name in TRAININGS and TRAININGS[name].simulated},
    )  # fmt: skip


def context(folder, assets: Assets | None = None, **fields) -> Context:
    """Return the context of a process in which a task runs."""
    return Context(RunFolder(folder), assets, **fields)


class Bar:
    """A progress bar that counts the units of which it is told."""

    total, n = 100, 0

    def update(self, units=1):
        self.n += units


class InProcess:
    """An executor that does everything here: the seam behind which a cluster could stand."""

    side_by_side = 1

    def __init__(self, folder: RunFolder, assets: Assets | None = None) -> None:
        self.folder, self.assets = folder, assets
        self._named: dict[str, Context] = {}

    def context(self) -> Context:
        return Context(self.folder, self.assets)

    def together(self, ready, bar):
        while batch := ready():
            tasks, needed = batch
            context = self.context()
            for task in tasks:
                yield task, self.outcome(task, context, needed)

    def outcome(self, task, context, needed):
        clock = time.perf_counter()
        try:
            outcome = task.run(context, needed)
        except Exception as error:
            outcome = failure(error)
        return dataclasses.replace(outcome, seconds=time.perf_counter() - clock)

    def begin(self, tasks):
        for task, _ in tasks:
            with suppress(Exception):
                task.begin and task.begin(self._named.setdefault(task.process, self.context()))

    def alone(self, task, needed):
        return self.outcome(task, self._named.setdefault(task.process, self.context()), needed)

    def release(self, process):
        self._named.pop(process, None)

    def close(self):
        self._named.clear()


def run_in_this_process(patch: pytest.MonkeyPatch) -> None:
    """Let runs do every task in this process: none is begun, and nothing is compiled again."""
    patch.setattr(
        "benchmarks.runner.execute_plan.Executor", lambda folder, assets, _: InProcess(folder, assets)
    )
