"""From a user's files to findings: each entry is checked in tiny scenes, each in a process of its own."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from benchmarks.assets.assets import embedded_motions, open_assets
from benchmarks.cell import Cell
from benchmarks.contract.check_method import CheckMethod
from benchmarks.contract.check_metric import CheckMetrics
from benchmarks.contract.check_scene import CheckScene
from benchmarks.declarations import DeclarationError, by_name
from benchmarks.method import MethodEntry
from benchmarks.methods.catalogue.all_methods import METHODS, find_method
from benchmarks.metric import Metric
from benchmarks.metrics import declared as declared_metrics
from benchmarks.plan import user_files
from benchmarks.plan.plan import Motions, Plan
from benchmarks.presets import find_preset
from benchmarks.results.run_folder import RunFolder
from benchmarks.runner.cache import Cache
from benchmarks.runner.executor import Executor
from benchmarks.runner.loop import Runner
from benchmarks.runner.schedule import Schedule
from benchmarks.scene import Scene
from benchmarks.scenes import SCENES, all_scenes, find_scene, of_garment
from benchmarks.tasks.task import Task

SECONDS = 120.0
BARE = ("hanging_sheet", "sheet_on_sphere", "flag")  # pins at rest, an obstacle, pins that move
GARMENT, TRAIN, TEST = "tshirt", "arm_raise", "kick"
SIZES = dataclasses.replace(
    find_preset("smoke"),
    garment_vertices=300,
    frames=8,
    clip_frames=8,
    warm_up_frames=2,
    settle_frames=4,
    sheet_cells=4,
    sheet_frames=6,
    cell_seconds=SECONDS,
)


@dataclasses.dataclass
class Declarations:
    """Entries that a user's files declare."""

    methods: list[MethodEntry] = dataclasses.field(default_factory=list)
    scenes: list[Scene] = dataclasses.field(default_factory=list)
    metrics: list[Metric] = dataclasses.field(default_factory=list)


def read_files(paths: Sequence[str]) -> Declarations:
    """Return what these files declare. Raises DeclarationError where a run with one would."""
    declared = Declarations()
    for path in paths:
        if not path.endswith(".py"):
            raise DeclarationError(f"{path}: a file ends with .py")
        file = user_files.file_of(path)
        module = user_files.import_file(file)
        kinds = [kind for kind in user_files.KINDS if hasattr(module, kind.tuple_name)]
        if not kinds:
            names = ", ".join(kind.tuple_name for kind in user_files.KINDS)
            raise DeclarationError(f"{path}: declares none of {names}")
        own = Declarations(**{kind.word: user_files.entries_of(kind, file) for kind in kinds})
        user_files.check_networks(own.methods)
        by_name("method", (*METHODS, *own.methods))
        by_name("scene", (*all_scenes((), ()).values(), *own.scenes))
        if own.metrics:
            declared_metrics((file,))
        for kind in kinds:
            getattr(declared, kind.word).extend(getattr(own, kind.word))
    return declared


def check_files(
    declared: Declarations, folder: Path, seconds: float = SECONDS, scene_plan: Plan | None = None
) -> Iterator[tuple[str, bool]]:
    """Check each entry in each scene.

    Args:
        declared: of `read_files`.
        folder: is written into.
        seconds: after which one method in one scene is ended.
        scene_plan: plan of one scene, in which the methods are checked in place of the tiny ones; scenes and
            metrics are not checked then.

    Yields:
        Lines for people, and whether the entry is fine there.
    """
    if scene_plan is None:
        plan = plan_check(declared, folder)
    else:
        declared = Declarations(methods=declared.methods)
        cells = _cells(declared, [scene_plan.cells[0].scene])
        plan = dataclasses.replace(scene_plan, cells=tuple(cells), suites=("speed",), folder=folder)
    for entry in declared.methods:
        if not any(cell.entry is entry for cell in plan.cells):
            scenes = SCENES if scene_plan is None else scene_plan.scenes
            why = next(filter(None, map(entry.skip, scenes)), "no scene is meant for it")
            yield f"{entry.name}: wrong\n  is skipped in every scene: {why}", False
    run, assets = RunFolder(folder), None
    if scene_plan is not None:
        assets = scene_plan.open_assets() if plan.garments else None
    elif plan.garments:
        motions = dict.fromkeys([TRAIN, *(scene.motion for scene in plan.scenes if scene.dressed)])
        assets = open_assets(plan.preset, embedded_motions(motions), plan.garments)
    schedule = Schedule(plan)
    of_methods = dataclasses.replace(plan, cells=tuple(c for c in plan.cells if c.entry.declared_in))
    before = [t for t in Schedule(of_methods).tasks() if t.stage in ("ground truth", "training")]
    runner = Runner(before, Cache(run))
    runner.run(Executor(run, assets, 1))
    executor = Executor(run, assets, 1)
    try:
        hung = set[str]()
        for name, task in _tasks(declared, plan, schedule, seconds):
            if name not in hung:
                lines, fine, ended = _check_one(name, task, runner, executor)
                hung |= {name} if ended else set()
                yield lines, fine
    finally:
        executor.close()


def plan_check(declared: Declarations, folder: Path) -> Plan:
    """Return the plan of each method in all scenes that fit it, and of each scene with the simulation."""
    bare = [scene for scene in SCENES if scene.name in BARE]
    worn = of_garment(GARMENT).scene(TEST)
    simulations = [
        Cell(scene.at(SIZES), find_method("simulation"), 0, ("speed",)) for scene in declared.scenes
    ]
    cells = _cells(declared, [scene.at(SIZES) for scene in (*bare, worn)])
    return Plan(
        preset=SIZES, suites=("speed",), cells=(*simulations, *cells), cases=(), seeds=(0,), device="cpu",
        folder=folder, command="", motions=Motions((TRAIN,), (TEST,)),
    )  # fmt: skip


def _cells(declared: Declarations, scenes: Sequence[Scene]) -> list[Cell]:
    """Return the cells of all methods in those of the scenes that are for them."""
    return [
        Cell(scene, entry, 0, ("speed",))
        for entry in declared.methods
        for scene in scenes
        if entry.meant_for(scene) and entry.skip(scene) is None
    ]


def _tasks(
    declared: Declarations, plan: Plan, schedule: Schedule, seconds: float
) -> Iterator[tuple[str, Task]]:
    """Yield the name of each entry, and the task that checks it in a scene."""
    fields: dict[str, Any] = {"inputs": {}, "modules": (), "deadline": seconds}
    for cell in plan.cells:
        needs = schedule.cell(cell).needs
        if cell.entry.declared_in:
            yield (
                cell.method,
                CheckMethod(
                    name=cell.name, label=cell.scene.name, process=cell.name, cell=cell, needs=needs, **fields
                ),
            )
        else:
            name = cell.scene.name
            yield name, CheckScene(name=name, label="", process=name, scene=cell.scene, **fields)
    sheet = find_scene(BARE[0]).at(plan.preset)
    for home in dict.fromkeys(metric.declared_in for metric in declared.metrics):
        yield home, CheckMetrics(name=home, label=sheet.name, process=home, scene=sheet, home=home, **fields)


def _check_one(name: str, task: Task, runner: Runner, executor: Executor) -> tuple[str, bool, bool]:
    """Return lines on an entry, whether it is fine, and whether its process had to be ended."""
    failed = next((runner.outcomes[id] for id in task.needs if runner.outcomes[id].failed), None)
    outcome = failed or executor.alone(task, {})
    executor.release(task.process)
    wrong = [f"{outcome.status}: {outcome.reason}"] if outcome.failed else outcome.result["wrong"]
    notes = [] if outcome.failed else outcome.result["notes"]
    where = f"{name}{f' in {task.label}' if task.label else ''}"
    lines = [f"{where}: {'wrong' if wrong else 'fine'}", *(f"  {line}" for line in wrong)]
    lines += [f"  note: {line}" for line in notes]
    return "\n".join(lines), not wrong, outcome.status == "timeout"
