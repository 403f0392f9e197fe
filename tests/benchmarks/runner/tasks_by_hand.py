"""Plans, tasks and scenes as a test wants them, and an executor that does everything in this process."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from benchmarks.assets import Assets
from benchmarks.method import Method, MethodEntry
from benchmarks.methods import find_method
from benchmarks.methods.declared_networks import TRAININGS
from benchmarks.metric import RollOut, SceneRollOuts
from benchmarks.plan.cell import Cell
from benchmarks.plan.plan import Network, Plan
from benchmarks.plan.study import Study
from benchmarks.presets import Preset, find_preset
from benchmarks.results.run_folder import RunFolder
from benchmarks.runner.cache import Cache
from benchmarks.runner.executor import Executor
from benchmarks.runner.loop import Runner
from benchmarks.runner.networks import NetworkTraining
from benchmarks.runner.schedule import tasks_of
from benchmarks.runner.task import Context, Outcome, failure
from benchmarks.scene import BuiltScene
from benchmarks.scenes import find_garment, find_scene
from reference_sim import Trajectory, simulate

TINY = dataclasses.replace(
    find_preset("smoke"), sheet_cells=3, sheet_frames=4, cell_seconds=90.0, repeats=1, least_seconds=0.01
)


def small_scene(name: str, *, cells: int = 6, frames: int = 10) -> BuiltScene:
    """A scene of a small sheet."""
    sizes = {"sheet_cells": cells, "sheet_frames": frames}
    return dataclasses.replace(find_scene(name), sizes=(), options=sizes).build()


def thirds(positions: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The same surface in other triangles, each split at its centre: positions (T,V+F,3), faces (3F,3)."""
    centres = positions.shape[1] + np.arange(len(faces))
    split = [np.column_stack([faces[:, [k, (k + 1) % 3]], centres]) for k in range(3)]
    return np.concatenate([positions, positions[:, faces].mean(axis=2)], axis=1), np.concatenate(split)


def dressed_scene(
    motion: str, garment: str = "tshirt", *, part: str = "whole", preset: Preset | None = None
):
    """The declaration of a body in a garment."""
    return find_garment(garment).scene(motion, part).at(preset or find_preset("smoke"))


def assets_of(dressed, motion) -> Assets:
    """A dressed body as the T-shirt of a run, and one motion."""
    return Assets(dressed.body, {"tshirt": dressed.garment}, {motion.name: motion}, {})


def training(name: str, *motions: str, steps: int, key: str = "0") -> NetworkTraining:
    """The training of a network of the T-shirt."""
    simulated = TRAININGS[name].simulated
    return NetworkTraining(
        network=Network(name, 0, "tshirt"), training=TRAININGS[name], steps=steps, motions=motions,
        device="cpu", inputs={"key": key}, key=key, reads=tuple(("data", m) for m in motions if simulated),
    )  # fmt: skip


def context(folder, assets: Assets | None = None) -> Context:
    """Return the context of a process in which a task runs."""
    return Context(RunFolder(folder), assets)


def plan_of(folder: Path, *names: str, scene: str = "free_fall", how: str = "", **changes) -> Plan:
    """A plan of these methods in one scene. how: what those do that are no simulation, see misbehaving."""
    study = Study(sizes=changes.pop("preset", TINY), trained=changes.pop("trained", None))
    wrong = {
        "module": "tests.benchmarks.runner.misbehaving", "options": {"how": how}, "batched": True,
        "gives_first_frame": True,
    }  # fmt: skip
    declared = find_scene(scene).at(study.sizes)
    entries = [
        dataclasses.replace(find_method(name), **wrong if how and name != "simulation" else {})
        for name in names
    ]
    cells = tuple(Cell(declared, entry, 0, ("speed",)) for entry in entries)
    return Plan(**{"study": study, "cells": cells, "folder": folder} | changes)


def finish(plan: Plan, *stages: str, processes: bool = False) -> Runner:
    """All tasks of these stages, run or reused: here, or in processes of their own."""
    tasks = [task for task in tasks_of(plan) if task.stage in (stages or ("timed methods",))]
    folder = RunFolder(plan.folder)
    runner = Runner(tasks, Cache(folder, retry=plan.retry))
    runner.run(Executor(folder, None, 1) if processes else InProcess(folder))
    return runner


def outcome_of(plan: Plan, number: int = 0, *, processes: bool = False) -> Outcome:
    """Run one cell to the end of its process and return its outcome."""
    one = dataclasses.replace(plan, cells=plan.cells[number : number + 1])
    return finish(one, processes=processes).outcomes["cell", plan.cells[number].name]


def prepared(method: str | MethodEntry, scene: BuiltScene, models: Path = Path()) -> Method:
    """The method, by its name or entry, ready to run."""
    entry = find_method(method) if isinstance(method, str) else method
    runner = entry.make(models=models, seed=0)
    runner.prepare(scene)
    return runner


def simulated(scene: BuiltScene, **options) -> Trajectory:
    """The scene as `simulate` has it, from its start on, with these options in place of the scene's."""
    terms = {"dt": scene.dt, "frames": scene.frames, "obstacle": scene.obstacle, "start": scene.start}
    terms |= {"velocity": scene.start_velocity, "pin_positions": scene.pin_positions}
    return simulate(scene.cloth, scene.energies, **terms | options)


def trajectory_of(scene: BuiltScene, positions: np.ndarray, **fields) -> Trajectory:
    """Return positions (T,V,3) [m] as a roll-out in this scene."""
    times = np.arange(len(positions)) * scene.dt
    return Trajectory(positions, scene.cloth.faces, times, **fields)


def grouped(scene: BuiltScene, positions: dict[str, np.ndarray], **fields) -> SceneRollOuts:
    """Roll-outs of methods, by name, measured together; fields are those of each roll-out."""
    group = SceneRollOuts(scene, gap_samples=99)
    for name, x in positions.items():
        group.roll_outs.append(RollOut(group, find_method(name), trajectory_of(scene, x), **fields))
    return group


class InProcess:
    """An executor that does everything in this process."""

    workers = 1

    def __init__(self, folder: RunFolder, assets: Assets | None = None) -> None:
        self.folder, self.assets = folder, assets
        self._named: dict[str, Context] = {}

    def context(self) -> Context:
        return Context(self.folder, self.assets)

    def together(self, ready):
        while batch := ready():
            tasks, needed = batch
            context = self.context()
            for task in tasks:
                yield task, self.outcome(task, context, needed)

    def outcome(self, task, context, needed):
        try:
            return dataclasses.replace(task.run(context, needed), seconds=0.01)
        except Exception as error:
            return failure(error)

    def run_alone(self, task, needed):
        return self.outcome(task, self._named.setdefault(task.process, self.context()), needed)

    def release(self, process):
        self._named.pop(process, None)

    def close(self):
        self._named.clear()


def run_in_this_process(patch: pytest.MonkeyPatch) -> None:
    """Let runs do every task in this process: none is begun, and nothing is compiled again."""
    patch.setattr(
        "benchmarks.runner.execute_plan.Executor", lambda folder, assets, *_: InProcess(folder, assets)
    )
