"""python -m benchmarks.check: does your own file keep the contract? Else the remedy."""

from __future__ import annotations

import math
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial, reduce
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.assets import FEWEST_FRAMES, Assets
from benchmarks.declarations import DeclarationError, raised_at
from benchmarks.method import Method, MethodEntry
from benchmarks.plan import user_files
from benchmarks.plan.cell import Cell
from benchmarks.plan.options import add_options, study_of
from benchmarks.plan.plan import Plan, make_plan
from benchmarks.plan.study import Part, Study, StudyError
from benchmarks.presets import find_preset
from benchmarks.provenance import digest
from benchmarks.results.run_folder import RunFolder
from benchmarks.runner.cache import Cache
from benchmarks.runner.cells import build_scene, compute_cell
from benchmarks.runner.executor import Executor
from benchmarks.runner.loop import Runner
from benchmarks.runner.schedule import tasks_of
from benchmarks.runner.task import Context, Needed, Outcome, RunStopped, Task, one_line
from benchmarks.scene import BuiltScene, Scene
from benchmarks.timing import one_thread
from reference_sim import Trajectory
from reference_sim.command_line import Parser, command
from reference_sim.energies import Energy, Step

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
SIZES = replace(
    find_preset("smoke"), garment_vertices=300, frames=8, clip_frames=8, warm_up_frames=2, settle_frames=4,
    sheet_cells=4, sheet_frames=6, cell_seconds=120.0, least_seconds=0.02, repeats=1,
)  # fmt: skip
PLACE_TOLERANCE = 1e-6  # [m] of a point in its place; times a frame's length in float32
# Factor of the clock, and a microsecond, up to which the times of frames are believed.
CLOCK_SLACK = 1.1
DISPLACEMENT = 0.02  # of the mean edge, for the places at which derivatives are compared
DERIVATIVE_TOLERANCE = 1e-4  # of a derivative along a direction
SUM_ROUND_OFF = 1e-13  # of a sum of many terms, as a share of it
UNALTERED = (  # arrays of a scene
    "cloth.rest_positions", "cloth.faces", "cloth.masses", "start", "start_velocity", "obstacle.positions",
    "origin_heights", "exact", "dressed.motion.poses", "dressed.motion.translations",
    "dressed.garment.rest_positions",
)  # fmt: skip


@command(PROGRAM)
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; return its exit status."""
    one_thread()
    parser = Parser(prog=f"python -m {PROGRAM}", description=DESCRIPTION, epilog=EXAMPLES)
    parser.add_argument("files", nargs="+", metavar="FILE", help="a file")
    parser.add_argument("--scene", metavar="SCENE", dest="scenes", action="append", default=[],
        help="check the methods in this scene of benchmarks.run --list, in place of the tiny ones: for "
        "networks that are bound to a garment or a mesh")  # fmt: skip
    add_options(parser)
    options = parser.parse_args(arguments)
    faults = 0
    study = study_of(options)
    if not study.scenes:
        if any(text.lstrip().startswith("sizes") for text in options.settings):
            raise StudyError("--set sizes: tiny scenes have their own: name another one by --scene")
        study = replace(study, sizes=SIZES)
    with tempfile.TemporaryDirectory() as folder:
        plans = [plan_of(path, study, Path(folder) / str(n)) for n, path in enumerate(options.files)]
        for plan in plans:
            for name, fault in faults_of(plan):
                print(f"{name}: wrong\n  {fault}" if fault else f"{name}: fine", flush=True)
                faults += bool(fault)
    print("nothing is wrong" if not faults else f"{faults} to mend")
    return 1 if faults else 0


def plan_of(path: str, study: Study, folder: Path) -> Plan:
    """Return the plan of all that a file declares, methods in tiny scenes.

    Scenes that the study names take the place of the tiny ones; methods alone meet them. Raises
    ValueError where a run with the file would raise too, and for a file that declares nothing.
    """
    module = user_files.import_file(user_files.file_of(path))
    kinds = user_files.KINDS[:1] if study.scenes else user_files.KINDS
    declared = [kind.word for kind in kinds if hasattr(module, kind.tuple_name)]
    if not declared:
        raise DeclarationError(f"{path}: declares none of {', '.join(kind.tuple_name for kind in kinds)}")
    simulation = ("simulation",)
    parts = {
        "methods": Part(question="?", scenes=study.scenes or SCENES_OF_METHODS, methods=(path,)),
        "scenes": Part(question="?", scenes=(path,), methods=simulation),
        "metrics": Part(question="?", scenes=(SCENE_OF_METRICS,), methods=simulation),
    }
    parts = {kind: parts[kind] for kind in declared}
    metrics = (path,) if "metrics" in parts else ()
    plan = make_plan(replace(study, parts=parts, metrics=metrics), folder=folder)
    cells = (replace(cell, scene=replace(cell.scene, metrics=("cost",))) for cell in plan.cells)
    return replace(plan, cells=tuple(cells))


def faults_of(plan: Plan) -> Iterator[tuple[str, str]]:
    """Run a plan; yield each entry in each scene, and its fault, or ""."""
    skipped = {cell: cell.entry.skip(cell.scene) for cell in plan.cells}
    cells = tuple(cell for cell in plan.cells if not skipped[cell])
    for cell in {cell.method: cell for cell in plan.cells}.values():
        if not any(cell.method == other.method for other in cells):
            yield cell.method, f"is skipped in every scene: {skipped[cell]}"
    if not cells:
        return
    run = RunFolder(plan.folder)
    runner = Runner([make_check(task) for task in tasks_of(replace(plan, cells=cells))], Cache(run))
    runner.run(Executor(run, plan.open_assets() if plan.garments else None, plan.workers))
    for cell in cells:
        ids = (cell.id(), cell.id("batch"), cell.id("metrics"))
        outcomes = [runner.outcomes.get(id, Outcome()) for id in ids]
        reasons = (o.reason for o in outcomes if o.failed or o.status == "failed")
        fault = next(reasons, "").removeprefix(f"{ContractError.__name__}: ")
        measured = outcomes[2].result if outcomes[2].status == "ok" else {}
        for name, value in measured.items():
            number = value[0] if isinstance(value, (tuple, list)) else value
            if not math.isfinite(number):
                fault = fault or f"{name} is not finite: leave it out where it does not apply"
        own_scene = cell.scene.declared_in and not cell.entry.declared_in
        name = cell.method if cell.entry.declared_in else "".join(plan.metrics)
        yield cell.scene.name if own_scene else f"{name} in {cell.scene.name}", fault


def run_checked(cell: Cell, min_time: float, context: Context, outcomes: Needed) -> Outcome:
    """Run a cell, and check what a user's scene and method do.

    Raises ContractError, for what a user's code raises with file and line.
    """
    entry, models = cell.entry, context.folder.models_of(cell.scene.garment)
    try:
        if cell.scene.declared_in:
            check_scene(cell.scene, context.assets)
        outcome = compute_cell(cell, min_time, context)
        if entry.declared_in and not outcome.failed:
            scene = build_scene(cell.scene, context)
            check_method(entry, scene, partial(entry.make, models=models), cell.seed)
    except (ContractError, RunStopped):
        raise
    except Exception as error:
        place = raised_at(error, entry.declared_in or cell.scene.declared_in)
        raise ContractError(f"{one_line(error)}{f' ({place})' if place else ''}") from None
    return outcome


def make_check(task: Task) -> Task:
    """Return the task that checks what it runs in place of one that runs a cell."""
    assert isinstance(task.run, partial)
    return replace(task, run=partial(run_checked, *task.run.args)) if task.kind == "cell" else task


# --- the contract: what is demanded, each demand with its remedy ---


class ContractError(RuntimeError):
    """Faults of a user's entry, each with its remedy, separated by semicolons."""


def demand(*claims: tuple[object, str]) -> None:
    """Raise ContractError with the texts of the false claims."""
    if faults := [text for true, text in claims if not true]:
        raise ContractError("; ".join(faults))


def check_method(entry: MethodEntry, scene: BuiltScene, make: Callable[..., Method], seed: int) -> None:
    """Run a method twice with a seed, and with another one, and check what it has done.

    make(seed=seed) returns a new method. Raises ContractError with the demands not met.
    """
    before = fingerprints(scene)

    def run(seed: int) -> tuple[Trajectory, float]:
        method = make(seed=seed)
        method.prepare(scene)
        clock = time.perf_counter()
        return method.run(), time.perf_counter() - clock

    answer, seconds = run(seed)
    x, claim = np.asarray(answer.positions, np.float64), float(np.nansum(answer.frame_seconds))
    whole = len(x) == scene.frames or answer.status == "diverged"
    demand((whole, f"gives {len(x)} of {scene.frames} frames"))
    bad = np.flatnonzero(~np.isfinite(x).all(axis=(1, 2)))
    changes = [name for name, text in fingerprints(scene).items() if before.get(name) != text]
    limit = PLACE_TOLERANCE * max(1.0, np.abs(scene.start).max())
    pin = "" if entry.other_mesh else loose_pin(x, scene, limit)
    demand(
        (entry.gives_first_frame or entry.other_mesh or distance(x[0], scene.start) <= limit,
            "frame 0 is off the scene's start: put scene.start there, or say gives_first_frame=True"),
        (not pin, f"a pin is off its place in {pin}: "
            "x[cloth.pins] = scene.pin_positions(frame), or the start where that is None"),
        (entry.other_mesh or np.array_equal(answer.faces, scene.cloth.faces),
            "gives other faces than the scene's: give cloth.faces"),
        (np.shape(answer.times) == (len(x),) and np.allclose(answer.times, np.arange(len(x)) * scene.dt),
            "gives other times than np.arange(frames) * scene.dt"),
        (not len(bad) or (answer.status == "diverged" and answer.reason), "has a position that is not finite "
            f"in frame {bad.min(initial=len(x))}: say status='diverged', and why"),
        (claim <= CLOCK_SLACK * seconds + 1e-6, f"its frames say {claim:.3g} s in all, the "
            f"clock {seconds:.3g} s: give frame_seconds in seconds, of run() alone"),
        (not changes, f"alters the scene: {', '.join(changes)}: copy what you change, others read it"),
    )  # fmt: skip
    gap = distance(x, run(seed)[0].positions)
    demand((gap == 0.0, f"a second run gives other positions, by {gap:.3g} m: draw all that is random "
        "from `seed`, keep nothing between objects"))  # fmt: skip
    if not entry.seeded and entry.trained is None:
        gap = distance(x, run(seed + 1)[0].positions)
        demand((gap == 0.0, f"another seed gives other positions, by {gap:.3g} m: say seeded=True"))


def loose_pin(x: np.ndarray, scene: BuiltScene, limit: float) -> str:
    """Return the first frame of positions x (T,V,3) [m] with a pin farther than `limit` off; or ""."""
    pins = scene.cloth.pins
    for frame in range(1, len(x)) if scene.dressed is None and len(pins) else ():
        place = scene.pin_positions(frame) if scene.pin_positions else scene.start[pins]
        if distance(x[frame][pins], np.asarray(place)) > limit:
            return f"frame {frame}"
    return ""


def distance(one: np.ndarray, other: np.ndarray) -> float:
    """Return the largest distance [m] of two arrays of positions along an axis."""
    return float(np.nanmax(np.abs(one - other), initial=0.0)) if one.shape == other.shape else np.inf


def fingerprints(scene: BuiltScene) -> dict[str, str]:
    """Return name -> digest of the arrays of a scene, which nobody may alter."""
    root: Any = scene
    values = {n: reduce(lambda part, a: getattr(part, a, None), n.split("."), root) for n in UNALTERED}
    return {name: digest(np.asarray(value)) for name, value in values.items() if value is not None}


def check_scene(scene: Scene, assets: Assets | None) -> None:
    """Build a scene twice and check it. Raises ContractError, and what building raises."""
    built, twin = (scene.build(assets) for _ in range(2))
    before, after = fingerprints(built), fingerprints(twin)
    changes = [name for name in before if after.get(name) != before[name]]
    demand(
        (built.name == scene.name, f"is built as '{built.name}': give name=scene.name"),
        (built.frames >= FEWEST_FRAMES, f"has {built.frames} frames: {FEWEST_FRAMES} are needed"),
        (all(energy.cloth is built.cloth for energy in built.energies),
            "an energy is made of another cloth: use the scene's"),
        ((built.obstacle is not None) == (scene.obstacle or scene.dressed),
            "builds an obstacle and declares none, or the reverse: say obstacle=True where it has one"),
        ((built.dressed is not None) == scene.dressed,
            "is built dressed and names no garment, or the reverse: say garment= and motion= where it is"),
        (not changes, f"is built otherwise the second time: {', '.join(changes)}: draw all that is random "
            "from a fixed seed"),
    )  # fmt: skip
    for energy in twin.energies:
        if not type(energy).__module__.startswith("reference_sim."):
            check_derivatives(energy, twin)


def check_derivatives(energy: Energy, scene: BuiltScene) -> None:
    """Compare gradient and Hessian with differences of fourth order. Raises ContractError."""
    from benchmarks.validation.derivatives import DIFFERENTIATED, STEP, off_by

    cloth, random = scene.cloth, np.random.default_rng(0)
    scale = DISPLACEMENT * float(cloth.edge_lengths.mean())
    x = scene.start + scale * random.standard_normal(scene.start.shape)
    energy.prepare(Step(scene.start, scene.start_velocity, x, scene.dt, scene.obstacle, 1))
    value, gradient = energy.value_and_gradient(x)
    label = f"energy {energy.name}: its"
    shape = np.shape(gradient)
    finite = np.isfinite(value) and shape == x.shape and np.isfinite(gradient).all()
    demand((finite, f"{label} value {value} and gradient {shape}: give finite ones {x.shape}"))
    for kind, source in zip(DIFFERENTIATED, ("value", "gradient")):
        error, size = off_by(energy, x, scale * random.standard_normal(x.shape), kind)
        limit = DERIVATIVE_TOLERANCE * size + SUM_ROUND_OFF * max(abs(value), size) / STEP
        demand((error <= limit, f"{label} {kind} is not the derivative of its {source}: off by {error:.3g} "
            f"of {size:.3g}: mend it, or leave it to automatic differentiation"))  # fmt: skip


if __name__ == "__main__":
    raise SystemExit(main())
