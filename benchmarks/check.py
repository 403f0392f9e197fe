"""python -m benchmarks.check: does a file of your own keep the contract? What is wrong, and the remedy."""

from __future__ import annotations

import dataclasses
import math
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from benchmarks.assets import Assets
from benchmarks.contract import PrepareCell, watched_method, watched_scene
from benchmarks.declarations import DeclarationError, by_name
from benchmarks.method import MethodEntry
from benchmarks.methods.catalogue.all_methods import METHODS, find_method
from benchmarks.metric import Metric
from benchmarks.metrics import declared as declared_metrics
from benchmarks.plan import user_files
from benchmarks.plan.make_plan import plan_scene
from benchmarks.plan.motions import Motions
from benchmarks.plan.options import REPLACED, add_study_options, study_of
from benchmarks.plan.plan import STATES, Cell, Plan, TaskId
from benchmarks.presets import find_preset
from benchmarks.results.run_folder import RunFolder
from benchmarks.runner.cache import Cache
from benchmarks.runner.executor import Executor
from benchmarks.runner.loop import Runner
from benchmarks.runner.schedule import tasks_of
from benchmarks.runner.task import Outcome, Task
from benchmarks.scene import Scene
from benchmarks.scenes import SCENES, all_scenes, find_scene, of_garment
from benchmarks.timing import one_thread
from reference_sim.command_line import Parser, command

PROGRAM = "benchmarks.check"
DESCRIPTION = """Run what files of yours declare on tiny scenes, and say what is wrong: methods (shapes,
start, pins, times, the clock, the same answer twice, the scene left as it was, no connections), scenes
(built alike twice, parts, derivatives of their own energies, a simulation) and metrics (declared, finite,
the same twice)."""
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
SIZES = dataclasses.replace(
    find_preset("smoke"), garment_vertices=300, frames=8, clip_frames=8, warm_up_frames=2, settle_frames=4,
    sheet_cells=4, sheet_frames=6, cell_seconds=120.0, least_seconds=0.02, repeats=1,
)  # fmt: skip


@dataclasses.dataclass
class Declarations:
    """Entries that a user's file declares."""

    methods: list[MethodEntry] = dataclasses.field(default_factory=list)
    scenes: list[Scene] = dataclasses.field(default_factory=list)
    metrics: list[Metric] = dataclasses.field(default_factory=list)


@command(PROGRAM)
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; return its exit status."""
    one_thread()
    parser = Parser(
        prog=f"python -m {PROGRAM}", description=DESCRIPTION, epilog=EXAMPLES,
        replaced=REPLACED
        | {"--seconds": "a method in a tiny scene is ended after two minutes, elsewhere as in a run"},
    )  # fmt: skip
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
            for line, fine in check_file(declared, Path(folder), scene_plan):
                print(line, flush=True)
                wrong += not fine
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
) -> Iterator[tuple[str, bool]]:
    """Run everything that a file declares, under watch.

    Args:
        declared: of `read_file`.
        folder: is written into.
        scene_plan: plan of one scene, in which the methods are checked in place of the tiny ones; scenes and
            metrics are not checked then.

    Yields:
        Lines for people on each entry in each scene, and whether it is fine there.
    """
    plan = _plan_of(declared, folder, scene_plan)
    for entry in declared.methods:
        if not any(cell.method == entry.name for cell in plan.cells):
            scenes = scene_plan.scenes if scene_plan else SCENES
            why = next(filter(None, map(entry.skip, scenes)), "no scene is meant for it")
            yield _verdict(entry.name, f"is skipped in every scene: {why}")
    assets = plan.open_assets() if plan.garments else None
    early = [cell for cell in plan.cells if cell.entry.declared_in and not cell.entry.trained]
    prepared = _run([_preparation(cell) for cell in early], plan, assets)
    unfit = {cell: outcome for cell in early if (outcome := prepared["prepare", cell.name]).failed}
    plan = dataclasses.replace(plan, cells=tuple(cell for cell in plan.cells if cell not in unfit))
    tasks = [task for task in tasks_of(plan) if task.kind in KINDS]
    outcomes = _run(tasks, plan, assets) if tasks else {}
    for cell in (*unfit, *(cell for cell in plan.cells if cell.scene.metrics is None)):
        outcome = unfit.get(cell) or outcomes[cell.task_id]
        batch = outcomes.get(cell.batch_id, Outcome())
        wrong = outcome.reason if outcome.failed else ""
        if not wrong and batch.status not in ("ok", "skipped"):
            wrong = f"batch(): {batch.reason}"
        name = f"{cell.method} in {cell.scene.name}" if cell.entry.declared_in else cell.scene.name
        yield _verdict(name, wrong, "" if outcome.status == "ok" else f"ends as {outcome.status}")
    if plan.metrics:
        sheets = {cell.metrics_id for cell in plan.cells if cell.scene.metrics is not None}
        measured = [task for task in tasks_of(plan) if task.id in sheets]
        once, again = (_run(measured, plan, assets, known=outcomes) for _ in range(2))
        yield _verdict(f"{plan.metrics[0]} in {SCENE_OF_METRICS}", _wrong_numbers(once, again))


def _plan_of(declared: Declarations, folder: Path, scene_plan: Plan | None) -> Plan:
    """Return the plan of each method in all scenes that fit it; scenes and metrics meet simulations."""
    if scene_plan is not None:
        cells = _cells(declared, [scene_plan.cells[0].scene])
        return dataclasses.replace(scene_plan, cells=cells, suites=("speed",), folder=folder)
    scenes = [*map(find_scene, SCENES_OF_METHODS), of_garment(GARMENT).scene(TEST)]
    cells = _cells(declared, [scene.at(SIZES) for scene in scenes])
    simulation, stopped = find_method("simulation"), find_method("lbfgs-10")
    cells += tuple(
        Cell(watched_scene(scene.at(SIZES)), simulation, 0, ("speed",)) for scene in declared.scenes
    )
    if declared.metrics:
        sheet = dataclasses.replace(find_scene(SCENE_OF_METRICS).at(SIZES), metrics=())
        cells += tuple(Cell(sheet, entry, 0, ("speed",)) for entry in (simulation, stopped))
    return Plan(
        preset=SIZES, suites=("speed",), cells=cells, cases=(), seeds=(0,), device="cpu", folder=folder,
        command="", metrics=tuple({metric.declared_in for metric in declared.metrics}),
        motions=Motions((TRAIN,), (TEST,)),
    )  # fmt: skip


def _cells(declared: Declarations, scenes: Sequence[Scene]) -> tuple[Cell, ...]:
    """Return the cells of all methods in those of the scenes that are for them, all of it measured."""
    return tuple(
        Cell(dataclasses.replace(scene, metrics=None), watched_method(entry), 0, ("speed",))
        for entry in declared.methods
        for scene in scenes
        if entry.meant_for(scene) and entry.skip(scene) is None
    )


def _preparation(cell: Cell) -> PrepareCell:
    return PrepareCell(
        name=cell.name,
        label=cell.label,
        cell=cell,
        inputs={},
        code=("benchmarks/check.py",),
        deadline=SIZES.cell_seconds,
    )


def _run(
    tasks: Sequence[Task], plan: Plan, assets: Assets | None, known: Mapping[TaskId, Outcome] = {}
) -> dict[TaskId, Outcome]:
    """Return the outcomes of tasks, all of them done now. known: outcomes of others."""
    run = RunFolder(plan.folder)
    runner = Runner(tasks, Cache(run, only=STATES))
    runner.outcomes |= known
    runner.run(Executor(run, assets, plan.workers))
    return runner.outcomes


def _wrong_numbers(once: Mapping[TaskId, Outcome], again: Mapping[TaskId, Outcome]) -> str:
    """Return what is wrong with the numbers of two measurements, or empty."""
    for id, outcome in once.items():
        if outcome.failed:
            return outcome.reason
        for name, value in outcome.result.items() if id[0] == "metrics" else ():
            number = value[0] if isinstance(value, tuple) else value
            if not math.isfinite(number):
                return f"{name} is {number}: leave out what does not apply"
            if again[id].result.get(name) != value:
                return f"{name} is {value}, then {again[id].result.get(name)}: fix its seed"
    return ""


def _verdict(name: str, wrong: str, note: str = "") -> tuple[str, bool]:
    lines = [f"{name}: {'wrong' if wrong else 'fine'}"]
    lines += [f"  {wrong.removeprefix('ContractError: ')}"] if wrong else []
    lines += [f"  note: {note}"] if note and not wrong else []
    return "\n".join(lines), not wrong


if __name__ == "__main__":
    sys.exit(main())
