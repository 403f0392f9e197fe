"""python -m benchmarks.check: does a file of your own keep the contract? What is wrong, and the remedy."""

from __future__ import annotations

import argparse
import dataclasses
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from benchmarks.cell import Cell
from benchmarks.methods import find_method
from benchmarks.plan import user_files
from benchmarks.plan.plan import Motions, Plan
from benchmarks.presets import find_preset
from benchmarks.process.timing import one_thread
from benchmarks.registry import DeclarationError
from benchmarks.results.run_folder import RunFolder
from benchmarks.scenes import SCENES, find_scene, of_garment
from reference_sim.command.command_line import Parser, command

if TYPE_CHECKING:
    from benchmarks.runner.local_executor import LocalExecutor
    from benchmarks.runner.loop import Runner
    from benchmarks.runner.schedule import Schedule
    from benchmarks.tasks.task import Task

PROGRAM = "benchmarks.check"
SECONDS = 120.0
BARE = ("hanging_sheet", "sheet_on_sphere", "flag")  # pins at rest, an obstacle, pins that move
GARMENT, TRAIN, TEST = "tshirt", "arm_raise", "kick"
SIZES: dict[str, Any] = {
    "garment_vertices": 300, "frames": 8, "clip_frames": 8, "warm_up_frames": 2, "settle_frames": 4,
    "sheet_cells": 4, "sheet_frames": 6, "cell_seconds": SECONDS,
}  # fmt: skip
DESCRIPTION = """Call everything that the benchmark would call, on tiny scenes, and say what is wrong:
methods (shapes, start, pins, times, the clock, the same answer twice, the scene left as it was, no
connections), scenes (built alike twice, parts, derivatives of their own energies, a simulation) and metrics
(declared, finite, the same twice)."""
EXAMPLES = """examples:
  python -m benchmarks.check mine.py            all that METHODS, SCENES and METRICS of the file declare
  python -m benchmarks.check mine.py my_scene.py
  python -m benchmarks.check mine.py --seconds 300

exit status: 0 when nothing is wrong; 1 when something is, a line for each; 2 when a file cannot be read."""


def make_parser() -> argparse.ArgumentParser:
    """The options of the command."""
    parser = Parser(prog=f"python -m {PROGRAM}", description=DESCRIPTION, epilog=EXAMPLES)
    parser.add_argument("what", nargs="+", metavar="FILE", help="a file")
    parser.add_argument("--seconds", type=float, default=SECONDS,
        help=f"after which one method in one scene is ended (default {SECONDS:g})")  # fmt: skip
    return parser


@command(PROGRAM)
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; returns its exit status."""
    one_thread()
    options = make_parser().parse_args(arguments)
    if not options.seconds > 0.0:
        raise DeclarationError(f"--seconds {options.seconds:g}: give a positive number")
    declared, wrong = read(options.what), 0
    with tempfile.TemporaryDirectory() as folder:
        for line, fine in check(declared, Path(folder), options.seconds):
            print(line, flush=True)
            wrong += not fine
    print("nothing is wrong" if not wrong else f"{wrong} to mend")
    return 1 if wrong else 0


def read(words: Sequence[str]) -> dict[str, list[Any]]:
    """Return word of a kind -> what these files declare. Raises DeclarationError."""
    declared: dict[str, list[Any]] = {kind.word: [] for kind in user_files.KINDS}
    for word in words:
        if not word.endswith(".py"):
            raise DeclarationError(f"{word}: a file ends with .py")
        file = user_files.file_of(word)
        module = user_files.imported(file)
        kinds = [kind for kind in user_files.KINDS if hasattr(module, kind.tuple_name)]
        if not kinds:
            names = ", ".join(kind.tuple_name for kind in user_files.KINDS)
            raise DeclarationError(f"{word}: declares none of {names}")
        for kind in kinds:
            declared[kind.word] += user_files.entries_of(kind, file)
    return declared


def check(
    declared: dict[str, list[Any]], folder: Path, seconds: float = SECONDS
) -> Iterator[tuple[str, bool]]:
    """Lines on each entry in each scene, and whether they are fine. Writes into the folder."""
    from benchmarks.assets.assets import embedded_motions, open_assets
    from benchmarks.runner.cache import Cache
    from benchmarks.runner.local_executor import LocalExecutor
    from benchmarks.runner.loop import NoLog, Runner
    from benchmarks.runner.schedule import Schedule

    plan = plan_of(declared, folder)
    for entry in declared["methods"]:
        if not any(cell.entry is entry for cell in plan.cells):
            why = next(filter(None, map(entry.skip, SCENES)), "no scene is meant for it")
            yield f"{entry.name}: wrong\n  is skipped in every scene: {why}", False
    run, assets = RunFolder(folder), None
    if plan.garments:
        motions = dict.fromkeys([TRAIN, *(scene.motion for scene in plan.scenes if scene.dressed)])
        assets = open_assets(plan.preset, embedded_motions(motions), plan.garments)
    schedule = Schedule(plan)
    of_methods = dataclasses.replace(plan, cells=tuple(c for c in plan.cells if c.entry.declared_in))
    before = [t for t in Schedule(of_methods).tasks() if t.stage in ("ground truth", "training")]
    runner = Runner(before, Cache(run))
    runner.run(LocalExecutor(run, assets, 1), NoLog())
    executor = LocalExecutor(run, assets, 1)
    try:
        hung = set[str]()
        for name, task in _tasks(declared, plan, schedule, seconds):
            if name not in hung:
                lines, fine, ended = _looked_at(name, task, runner, executor)
                hung |= {name} if ended else set()
                yield lines, fine
    finally:
        executor.close()


def plan_of(declared: dict[str, list[Any]], folder: Path) -> Plan:
    """Each method with all that it can be asked for, and each scene with the simulation."""
    preset = dataclasses.replace(find_preset("smoke"), **SIZES)
    bare = [scene for scene in SCENES if scene.name in BARE]
    worn = of_garment(GARMENT).scene(TEST)
    own = [Cell(scene.at(preset), find_method("simulation"), 0, ("speed",)) for scene in declared["scenes"]]
    cells = [
        Cell(scene.at(preset), entry, 0, ("speed",))
        for entry in declared["methods"]
        for scene in (*bare, worn)
        if entry.meant_for(scene) and entry.skip(scene) is None
    ]
    return Plan(
        preset=preset, suites=("speed",), cells=(*own, *cells), cases=(), seeds=(0,), device="cpu",
        folder=folder, command="", motions=Motions((TRAIN,), (TEST,)),
    )  # fmt: skip


def _tasks(
    declared: dict[str, list[Any]], plan: Plan, schedule: Schedule, seconds: float
) -> Iterator[tuple[str, Task]]:
    """(name of the entry, task that looks at it in a scene)"""
    from benchmarks.contract.check_method import CheckMethod
    from benchmarks.contract.check_metric import CheckMetrics
    from benchmarks.contract.check_scene import CheckScene

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
    for home in dict.fromkeys(metric.declared_in for metric in declared["metrics"]):
        yield home, CheckMetrics(name=home, label=sheet.name, process=home, scene=sheet, home=home, **fields)


def _looked_at(name: str, task: Task, runner: Runner, executor: LocalExecutor) -> tuple[str, bool, bool]:
    """What is said of an entry, whether it is fine, and whether its process had to be ended."""
    failed = next((runner.outcomes[id] for id in task.needs if runner.outcomes[id].failed), None)
    outcome = failed or executor.alone(task, {})
    executor.release(task.process)
    wrong = [f"{outcome.status}: {outcome.reason}"] if outcome.failed else outcome.result["wrong"]
    notes = [] if outcome.failed else outcome.result["notes"]
    where = f"{name}{f' in {task.label}' if task.label else ''}"
    lines = [f"{where}: {'wrong' if wrong else 'fine'}", *(f"  {line}" for line in wrong)]
    lines += [f"  note: {line}" for line in notes]
    return "\n".join(lines), not wrong, outcome.status == "timeout"


if __name__ == "__main__":
    sys.exit(main())
