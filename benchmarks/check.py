"""python -m benchmarks.check: does a file of your own keep the contract? What is wrong, and the remedy."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

from benchmarks.contract import ContractError, check_method, check_scene
from benchmarks.declarations import DeclarationError, raised_at
from benchmarks.plan import user_files
from benchmarks.plan.cell import Cell
from benchmarks.plan.make_plan import make_plan
from benchmarks.plan.options import add_study_options, study_of
from benchmarks.plan.plan import Plan
from benchmarks.plan.study import Part, Study
from benchmarks.presets import find_preset
from benchmarks.results.run_folder import RunFolder
from benchmarks.runner.cache import Cache
from benchmarks.runner.cells import compute_cell, scene_of
from benchmarks.runner.executor import Executor
from benchmarks.runner.isolated_process import one_line
from benchmarks.runner.loop import Runner
from benchmarks.runner.schedule import tasks_of
from benchmarks.runner.task import Context, Needed, Outcome, RunStopped, Task
from benchmarks.timing import one_thread
from reference_sim.command_line import Parser, command

PROGRAM = "benchmarks.check"
DESCRIPTION = """Run what files of yours declare on tiny scenes, and say what is wrong: methods (shapes,
start, pins, times, the clock, the same answer twice, the scene left as it was), scenes
(built alike twice, parts, derivatives of their own energies, a simulation) and metrics (that they can be
measured)."""
EXAMPLES = """examples:
  python -m benchmarks.check mine.py            all that METHODS, SCENES and METRICS of the file declare
  python -m benchmarks.check mine.py my_scene.py
  python -m benchmarks.check mine.py --scene tshirt/kick --set sizes=smoke    methods in a scene of that size
  python -m benchmarks.check mine.py --scene shirt/kick --garment shirt.obj

exit status: 0 when nothing is wrong; 1 when something is, a line for each; 2 when a file cannot be read."""
# Pins that move, an obstacle, and a dressed body.
SCENES_OF_METHODS = ("flag", "sheet_on_sphere", "{garment}/kick")
SCENE_OF_METRICS = "hanging_sheet"
KINDS = ("start", "data", "clips", "network", "cell", "batch")  # of tasks that tell of methods and scenes
SIZES = replace(
    find_preset("smoke"), garment_vertices=300, frames=8, clip_frames=8, warm_up_frames=2, settle_frames=4,
    sheet_cells=4, sheet_frames=6, cell_seconds=120.0, least_seconds=0.02, repeats=1,
)  # fmt: skip


@command(PROGRAM)
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; return its exit status."""
    one_thread()
    parser = Parser(prog=f"python -m {PROGRAM}", description=DESCRIPTION, epilog=EXAMPLES)
    parser.add_argument("what", nargs="+", metavar="FILE", help="a file")
    parser.add_argument("--scene", metavar="SCENE", dest="scenes", action="append", default=[],
        help="check the methods in this scene of benchmarks.run --list, in place of the tiny ones: for "
        "networks that are bound to a garment or a mesh")  # fmt: skip
    add_study_options(parser)
    options, wrong = parser.parse_args(arguments), 0
    study = study_of(options)
    study = study if study.scenes else replace(study, sizes=SIZES)
    with tempfile.TemporaryDirectory() as folder:
        plans = [plan_of(path, study, Path(folder) / str(n)) for n, path in enumerate(options.what)]
        for plan in plans:
            for name, fault in faults_of(plan):
                print(f"{name}: wrong\n  {fault}" if fault else f"{name}: fine", flush=True)
                wrong += bool(fault)
    print("nothing is wrong" if not wrong else f"{wrong} to mend")
    return 1 if wrong else 0


def plan_of(path: str, study: Study, folder: Path) -> Plan:
    """Return the plan of all that a file declares: methods in tiny scenes, its scenes and metrics simulated.

    Args:
        path: of the file.
        study: whose scenes, where it names some, take the place of the tiny ones: methods alone meet them.
        folder: of the run.

    Raises:
        ValueError: one line, where a run with the file would raise too, or for a file that declares nothing.
    """
    module = user_files.import_file(user_files.file_of(path))
    wanted = user_files.KINDS[:1] if study.scenes else user_files.KINDS
    declared = [kind.word for kind in wanted if hasattr(module, kind.tuple_name)]
    if not declared:
        raise DeclarationError(f"{path}: declares none of {', '.join(kind.tuple_name for kind in wanted)}")
    simulation = ("simulation",)
    parts = {
        "methods": Part(question="?", scenes=study.scenes or SCENES_OF_METHODS, methods=(path,)),
        "scenes": Part(question="?", scenes=(path,), methods=simulation),
        "metrics": Part(question="?", scenes=(SCENE_OF_METRICS,), methods=simulation),
    }
    parts = {kind: parts[kind] for kind in declared}
    metrics = (path,) if "metrics" in parts else ()
    plan = make_plan(replace(study, parts=parts, metrics=metrics), folder=folder)
    cells = (replace(cell, scene=replace(cell.scene, metrics=())) for cell in plan.cells)
    return replace(plan, cells=tuple(cells))


def faults_of(plan: Plan) -> Iterator[tuple[str, str]]:
    """Run a plan by the ordinary runner, and check what methods and scenes of a user do.

    Yields:
        Each entry in each scene, and what is wrong with it there, or empty.
    """
    skipped = {cell: cell.entry.skip(cell.scene) for cell in plan.cells}
    cells = tuple(cell for cell in plan.cells if not skipped[cell])
    for cell in {cell.method: cell for cell in plan.cells}.values():
        if not any(cell.method == other.method for other in cells):
            yield cell.method, f"is skipped in every scene: {skipped[cell]}"
    if not cells:
        return
    plan = replace(plan, cells=cells)
    names = {cell: name_of(cell) for cell in cells}
    wanted = {cell.metrics_id for cell in cells if not names[cell]}
    tasks = [checked(task) for task in tasks_of(plan) if task.kind in KINDS or task.id in wanted]
    run = RunFolder(plan.folder)
    runner = Runner(tasks, Cache(run))
    runner.run(Executor(run, plan.open_assets() if plan.garments else None, plan.workers))
    for cell, name in names.items():
        ids = (cell.task_id, cell.batch_id if name else cell.metrics_id)
        outcomes = [runner.outcomes.get(id, Outcome()) for id in ids]
        reasons = (o.reason for o in outcomes if o.failed or o.status == "failed")
        fault = next(reasons, "").removeprefix(f"{ContractError.__name__}: ")
        yield name or f"{plan.metrics[0]} in {cell.scene.name}", fault


def name_of(cell: Cell) -> str:
    """Return the name of what a user has declared of a cell; empty where it is measured alone."""
    if cell.entry.declared_in:
        return f"{cell.method} in {cell.scene.name}"
    return cell.scene.name if cell.scene.declared_in else ""


# --- tasks that check what they run ------------------------------------------------------------------------


def run_checked(cell: Cell, least: float, context: Context, needed: Needed) -> Outcome:
    """Run a cell, and check what a user's scene and method do.

    Raises ContractError, for what a user's code raises with file and line.
    """
    entry, models = cell.entry, context.folder.models_of(cell.scene.garment)
    try:
        if cell.scene.declared_in:
            check_scene(cell.scene, context.assets)
        outcome = compute_cell(cell, least, context)
        if entry.declared_in and not outcome.failed:
            check_method(entry, scene_of(cell, context), partial(entry.make, models=models), cell.seed)
    except (ContractError, RunStopped):
        raise
    except Exception as error:
        where = raised_at(error, entry.declared_in or cell.scene.declared_in)
        raise ContractError(f"{one_line(error)}{f' ({where})' if where else ''}") from None
    return outcome


def checked(task: Task) -> Task:
    """Return the task that checks what it runs in place of one that runs a cell."""
    assert isinstance(task.run, partial)
    return replace(task, run=partial(run_checked, *task.run.args)) if task.kind == "cell" else task


if __name__ == "__main__":
    sys.exit(main())
