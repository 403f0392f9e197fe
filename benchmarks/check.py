"""python -m benchmarks.check: does a file of your own keep the contract? What is wrong, and the remedy."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

from benchmarks.assets import Assets
from benchmarks.contract import ContractError, check_method, check_scene
from benchmarks.declarations import DeclarationError, by_name, raised_at
from benchmarks.method import MethodEntry
from benchmarks.methods import METHODS, find_method
from benchmarks.metric import Metric
from benchmarks.metrics import declared as declared_metrics
from benchmarks.plan import user_files
from benchmarks.plan.cell import Cell, TaskId
from benchmarks.plan.make_plan import plan_scene
from benchmarks.plan.motions import Motions
from benchmarks.plan.options import add_study_options, study_of
from benchmarks.plan.plan import Plan
from benchmarks.presets import find_preset
from benchmarks.results.run_folder import RunFolder
from benchmarks.runner.cache import Cache
from benchmarks.runner.cells import compute_cell, scene_of
from benchmarks.runner.executor import Executor
from benchmarks.runner.isolated_process import one_line
from benchmarks.runner.loop import Runner
from benchmarks.runner.schedule import tasks_of
from benchmarks.runner.task import Context, Needed, Outcome, RunStopped, Task
from benchmarks.scene import Scene
from benchmarks.scenes import SCENES, all_scenes, find_scene, of_garment
from benchmarks.timing import one_thread
from reference_sim.command_line import Parser, command

PROGRAM = "benchmarks.check"
DESCRIPTION = """Run what files of yours declare on tiny scenes, and say what is wrong: methods (shapes,
start, pins, times, the clock, the same answer twice, the scene left as it was, no connections), scenes
(built alike twice, parts, derivatives of their own energies, a simulation) and metrics (that they can be
measured)."""
EXAMPLES = """examples:
  python -m benchmarks.check mine.py            all that METHODS, SCENES and METRICS of the file declare
  python -m benchmarks.check mine.py my_scene.py
  python -m benchmarks.check mine.py --scene tshirt/kick --set sizes=smoke    methods in a scene of that size
  python -m benchmarks.check mine.py --scene shirt/kick --garment shirt.obj

exit status: 0 when nothing is wrong; 1 when something is, a line for each; 2 when a file cannot be read."""
SCENES_OF_METHODS = ("flag", "sheet_on_sphere")  # pins that move, an obstacle; and a dressed body
SCENE_OF_METRICS = "hanging_sheet"
KINDS = ("start", "data", "clips", "network", "cell", "batch")  # of tasks that tell of methods and scenes
GARMENT, TRAIN, TEST = "tshirt", "arm_raise", "kick"
SIZES = replace(
    find_preset("smoke"), garment_vertices=300, frames=8, clip_frames=8, warm_up_frames=2, settle_frames=4,
    sheet_cells=4, sheet_frames=6, cell_seconds=120.0, least_seconds=0.02, repeats=1,
)  # fmt: skip


@dataclass
class Declarations:
    """Entries that a user's file declares."""

    methods: list[MethodEntry] = field(default_factory=list)
    scenes: list[Scene] = field(default_factory=list)
    metrics: list[Metric] = field(default_factory=list)


@command(PROGRAM)
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; return its exit status."""
    one_thread()
    parser = Parser(prog=f"python -m {PROGRAM}", description=DESCRIPTION, epilog=EXAMPLES)
    parser.add_argument("what", nargs="+", metavar="FILE", help="a file")
    parser.add_argument("--scene", metavar="SCENE",
        help="check the methods in this scene of benchmarks.run --list, in place of the tiny ones: for "
        "networks that are bound to a garment or a mesh")  # fmt: skip
    add_study_options(parser)
    options, wrong = parser.parse_args(arguments), 0
    files = [read_file(path) for path in options.what]
    scene_plan = None
    if options.scene:
        if not any(declared.methods for declared in files):
            raise DeclarationError(f"--scene {options.scene}: {', '.join(options.what)} declares no METHODS")
        scene_plan = plan_scene(study_of(options), options.scene)
    for declared in files:
        with tempfile.TemporaryDirectory() as folder:
            for name, fault in check_file(declared, Path(folder), scene_plan):
                print(f"{name}: wrong\n  {fault}" if fault else f"{name}: fine", flush=True)
                wrong += bool(fault)
    print("nothing is wrong" if not wrong else f"{wrong} to mend")
    return 1 if wrong else 0


def read_file(path: str) -> Declarations:
    """Return what a file declares. Raises DeclarationError where a run with it would."""
    if not path.endswith(".py"):
        raise DeclarationError(f"{path}: a file ends with .py")
    file = user_files.file_of(path)
    module = user_files.import_file(file)
    kinds = [kind for kind in user_files.KINDS if hasattr(module, kind.tuple_name)]
    if not kinds:
        names = ", ".join(kind.tuple_name for kind in user_files.KINDS)
        raise DeclarationError(f"{path}: declares none of {names}")
    declared = Declarations(**{kind.word: user_files.entries_of(kind, file) for kind in kinds})
    user_files.check_networks(declared.methods)
    by_name("method", (*METHODS, *declared.methods))
    by_name("scene", (*all_scenes((), ()).values(), *declared.scenes))
    if declared.metrics:
        declared_metrics((file,))
    return declared


def check_file(
    declared: Declarations, folder: Path, scene_plan: Plan | None = None
) -> Iterator[tuple[str, str]]:
    """Run everything that a file declares by the ordinary runner, and check what it does.

    Args:
        declared: of `read_file`.
        folder: is written into.
        scene_plan: plan of one scene, in which the methods are checked in place of the tiny ones; scenes and
            metrics are not checked then.

    Yields:
        Each entry in each scene, and what is wrong with it there, or empty.
    """
    plan = plan_of(declared, folder, scene_plan)
    for entry in declared.methods:
        if not any(cell.method == entry.name for cell in plan.cells):
            scenes = scene_plan.scenes if scene_plan else SCENES
            why = next(filter(None, map(entry.skip, scenes)), "no scene is meant for it")
            yield entry.name, f"is skipped in every scene: {why}"
    assets = plan.open_assets() if plan.garments else None
    users = [cell for cell in plan.cells if cell.entry.declared_in or cell.scene.declared_in]
    early = outcomes_of([preparation(cell) for cell in users if not cell.entry.trained], plan, assets)
    unfit = {cell for cell in users if early.get(("prepare", cell.name), Outcome()).failed}
    plan = replace(plan, cells=tuple(cell for cell in plan.cells if cell not in unfit))
    sheets = [cell for cell in plan.cells if cell not in users]
    wanted = {cell.metrics_id for cell in sheets}
    tasks = [checked(task) for task in tasks_of(plan) if task.kind in KINDS or task.id in wanted]
    outcomes = early | (outcomes_of(tasks, plan, assets) if tasks else {})
    for cell in users:
        name = f"{cell.method} in {cell.scene.name}" if cell.entry.declared_in else cell.scene.name
        yield name, first_fault(outcomes, ("prepare", cell.name), cell.task_id, cell.batch_id)
    if sheets:
        ids = [id for cell in sheets for id in (cell.task_id, cell.metrics_id)]
        yield f"{plan.metrics[0]} in {SCENE_OF_METRICS}", first_fault(outcomes, *ids)


def plan_of(declared: Declarations, folder: Path, scene_plan: Plan | None) -> Plan:
    """Return the plan of each method in all scenes that fit it; scenes and metrics meet simulations."""
    known = (*map(find_scene, SCENES_OF_METHODS), of_garment(GARMENT).scene(TEST))
    scenes = [scene_plan.cells[0].scene] if scene_plan else [scene.at(SIZES) for scene in known]
    met = [
        (replace(scene, metrics=()), entry)
        for entry in declared.methods
        for scene in scenes
        if entry.meant_for(scene) and entry.skip(scene) is None
    ]
    if scene_plan is None:
        sheets = [find_scene(SCENE_OF_METRICS)] if declared.metrics else []
        simulated = (replace(scene.at(SIZES), metrics=()) for scene in (*declared.scenes, *sheets))
        met += [(scene, find_method("simulation")) for scene in simulated]
    tiny = Plan(
        preset=SIZES, suites=(), cells=(), cases=(), motions=Motions((TRAIN,), (TEST,)), seeds=(0,),
        metrics=tuple({metric.declared_in for metric in declared.metrics}), device="cpu", folder=folder,
        command="",
    )  # fmt: skip
    cells = tuple(Cell(scene, entry, 0, ("speed",)) for scene, entry in met)
    return replace(scene_plan or tiny, cells=cells, suites=("speed",), folder=folder)


def outcomes_of(tasks: Sequence[Task], plan: Plan, assets: Assets | None) -> dict[TaskId, Outcome]:
    """Return the outcomes of tasks, all of them done now."""
    run = RunFolder(plan.folder)
    runner = Runner(tasks, Cache(run))
    runner.run(Executor(run, assets, plan.workers))
    return runner.outcomes


def first_fault(outcomes: Mapping[TaskId, Outcome], *ids: TaskId) -> str:
    """Return why the first of these tasks has failed, empty where none has."""
    known = (outcomes.get(id, Outcome()) for id in ids)
    reasons = (outcome.reason for outcome in known if outcome.failed or outcome.status == "failed")
    return next(reasons, "").removeprefix(f"{ContractError.__name__}: ")


# --- tasks that check what they run ------------------------------------------------------------------------


@contextmanager
def located(cell: Cell) -> Iterator[None]:
    """Raise ContractError with file and line for what a user's code raises within."""
    try:
        yield
    except (ContractError, RunStopped):
        raise
    except Exception as error:
        where = raised_at(error, cell.entry.declared_in or cell.scene.declared_in)
        raise ContractError(f"{one_line(error)}{f' ({where})' if where else ''}") from None


def preparation(cell: Cell) -> Task:
    """Return the task that prepares a cell, before anything is simulated: no garment has settled."""
    return Task(
        kind="prepare", name=cell.name, label=cell.label, stage="preparing", run=partial(prepare, cell),
        code=("benchmarks/check.py",), deadline=SIZES.cell_seconds,
    )  # fmt: skip


def prepare(cell: Cell, context: Context, needed: Needed) -> Outcome:
    """Build a user's scene and check it; make a user's method and prepare it."""
    entry, scene = cell.entry, cell.scene
    with located(cell):
        if scene.declared_in:
            check_scene(scene, context.assets)
        if entry.declared_in:
            built = scene.build(context.assets)
            method = entry.make(models=context.folder.models, seed=cell.seed)
            method.prepare(replace(built, settle=lambda: built.cloth.rest_positions))
    return Outcome()


def run_checked(cell: Cell, least: float, context: Context, needed: Needed) -> Outcome:
    """Run a cell, and check what its method does."""
    entry, models = cell.entry, context.folder.models_of(cell.scene.garment)
    with located(cell):
        outcome = compute_cell(cell, least, context)
        if entry.declared_in and not outcome.failed:
            check_method(entry, scene_of(cell, context), partial(entry.make, models=models), cell.seed)
    return outcome


def checked(task: Task) -> Task:
    """Return the task that checks what it runs in place of one that runs a cell."""
    assert isinstance(task.run, partial)
    return replace(task, run=partial(run_checked, *task.run.args)) if task.kind == "cell" else task


if __name__ == "__main__":
    sys.exit(main())
