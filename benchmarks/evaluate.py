"""Evaluate a few methods in this process, beside references shipped or simulated now.

The tasks are those of a run (benchmarks.runner) without its processes, cache, clock and report.
"""

from __future__ import annotations

import shutil
import sys
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import replace
from multiprocessing import get_context
from typing import Any

import numpy as np

from benchmarks.assets import Assets
from benchmarks.external.roll_out_files import MODULE
from benchmarks.metric import RollOut
from benchmarks.metrics.energy import copy_terms
from benchmarks.metrics.energy_gap import gap_scale, judge_steps
from benchmarks.plan.cell import Cell, TaskId, id_of
from benchmarks.plan.plan import Plan, runs
from benchmarks.provenance import digest_of_file
from benchmarks.references import TRAINED, Reference, find_in_package, find_reference, load_garment
from benchmarks.results.run_folder import RunFolder, model_path
from benchmarks.runner.cells import prepare_method, run_cell
from benchmarks.runner.execute_plan import held
from benchmarks.runner.ground_truth import simulate_quasi_static
from benchmarks.runner.measurements import measure_cell, roll_outs_of
from benchmarks.runner.rows import rows_of
from benchmarks.runner.run_json import RunLog, now
from benchmarks.runner.task import Context, Outcome, failure
from benchmarks.scene import Scene
from reference_sim import Potential, Trajectory
from reference_sim.minimise.lbfgs import LBFGS

# Terms that have an energy before a step is prepared.
WITHOUT_STEP = {"strain", "bending", "gravity", "inertia", "collision"}
OLDER = "SNUG or PBNS is of an earlier network of the package; benchmarks.publish references measures it"


def evaluate(plan: Plan, references: Mapping[str, Reference] | None = None) -> RunLog:
    """Run and measure the cells of a plan; write run.json and results.csv into its folder.

    Args:
        plan: cells of SNUG and PBNS count only in scenes with a reference: they are the package's.
        references: scene -> what replaces its simulation; None: those shipped.

    Raises:
        RollOutFileError: a roll-out that does not belong to its scene; then nothing is written.
    """
    assets, by_scene = assets_of(plan), dict(references or {})
    folder = RunFolder(plan.folder)
    contexts = {s.name: Context(folder, assets, {"scene": s.build(assets)}) for s in plan.scenes}
    sources = [cell for cell in plan.cells if cell.entry.role == "reference" and runs(cell)]
    simulated = {cell.scene for cell in sources if cell.entry.module != MODULE}
    notes = []
    for scene in plan.scenes if references is None else ():
        shipped = find_reference(scene, plan, contexts[scene.name].memo["scene"])
        if isinstance(shipped, str):
            notes += [f"{shipped}: it is simulated, which takes minutes"] * (scene in simulated)
            continue
        by_scene[scene.name] = shipped
        if any(digest_of_file(find_in_package(name)) != at for name, at in shipped.networks.items()):
            notes.append(OLDER)
    cells = (c for c in plan.cells if c.method not in TRAINED or c.scene.name in by_scene)
    plan = replace(plan, cells=tuple(replace(c, entry=replace(c.entry, timed=False)) for c in cells))
    for name, reference in by_scene.items():
        memo, start = contexts[name].memo, reference.positions[0]
        memo["scene"] = replace(memo["scene"], settle=lambda start=start: start)
    for cell in plan.cells:
        if cell.entry.module == MODULE:
            prepare_method(cell, contexts[cell.scene.name])
    print(*dict.fromkeys(notes), sep="\n", end="\n" * bool(notes), file=sys.stderr)
    with held(plan.folder):
        log, outcomes = RunLog(plan), dict[TaskId, Outcome]()
        if assets:
            log.open_assets(assets)
        for scene in plan.scenes:
            outcomes |= _run_scene(scene, plan, contexts[scene.name], by_scene.get(scene.name))
        log.config["finished"] = now()
        outcomes = {id: replace(o, origin=log.origin | o.origin) for id, o in outcomes.items()}
        log.write_rows(rows_of(plan, (), outcomes))
    return log


def assets_of(plan: Plan) -> Assets | None:
    """Make body, garments and motions of the scenes alone; None without a dressed one."""
    return plan.open_some(ready=load_garment(plan)) if plan.garments else None


def _run_scene(
    scene: Scene, plan: Plan, context: Context, reference: Reference | None
) -> dict[TaskId, Outcome]:
    """Return the outcomes of a scene's cells and of their metrics."""
    cells = tuple(cell for cell in plan.cells if cell.scene == scene)
    outcomes, measured = dict[TaskId, Outcome](), dict[TaskId, Outcome]()
    metrics = reference.metrics if reference else {}
    for cell in cells:
        if (reason := cell.entry.skip(scene)) is not None:
            outcomes[cell.id()] = Outcome("skipped", reason)
        elif reference and cell.entry.role == "reference":
            outcomes[cell.id()] = _save(reference, cell, context)
        elif cell.method not in metrics:
            if cell.entry.trained in TRAINED:
                models = context.folder.models_of(scene.garment)
                models.mkdir(parents=True, exist_ok=True)
                copy = model_path(models, cell.entry.trained, cell.seed)
                shutil.copyfile(find_in_package(cell.entry.trained), copy)
            outcomes[cell.id()] = run_cell(cell, 0.0, context, {})
    simulated = any(cell.entry.role == "reference" and runs(cell) for cell in cells)
    if scene.dynamic and simulated:
        solved = Outcome() if reference else _attempt(simulate_quasi_static, scene, context, {})
        if solved.usable:
            outcomes[id_of("quasi-static", scene)] = solved
        else:
            print(f"{scene.name}: quasi-static solutions: {solved.ending}", file=sys.stderr)
    samples = plan.study.sizes.gap_samples
    context.memo["roll-outs"] = roll_outs_of(cells, samples, context, outcomes)
    for cell in cells:
        if reference and cell.method in metrics:
            usual = Outcome(files=(cell.name,), result={"terms": "+".join(context.memo["scene"].terms)})
            outcomes[cell.id()] = replace(outcomes.get(cell.id(), usual), origin=dict(reference.origin))
            measured[cell.id("metrics")] = Outcome(result=metrics[cell.method])
        elif outcomes[cell.id()].files:
            with _steps_beside(context.memo["roll-outs"][cell]):
                measured[cell.id("metrics")] = _attempt(
                    measure_cell, cell, cells, samples, plan.metrics, context, outcomes
                )
    return outcomes | measured


def _attempt(task: Callable[..., Outcome], *arguments: Any) -> Outcome:
    """Return the outcome of a task, a failed one where it raises: all else is kept."""
    try:
        return task(*arguments)
    except OSError:  # as of a full disk, which the command says itself
        raise
    except Exception as error:
        return failure(error)


def _save(reference: Reference, cell: Cell, context: Context) -> Outcome:
    """Write a reference into the run's folder, as if simulated there."""
    built, folder = context.memo["scene"], context.folder
    static = np.full_like(reference.positions, np.nan)
    static[:, built.dressed.garment.hem] = reference.hem
    path = folder.trajectory_path(*cell.key)
    times = np.arange(len(static)) * built.dt
    files = {path: reference.positions, folder.quasi_static_path(cell.scene.name): static}
    for to, positions in files.items():
        Trajectory(positions, built.cloth.faces, times, status="converged").save(to)
    facts = {"terms": "+".join(built.terms)}
    return Outcome(reference.status, reference.reason, result=facts, files=(folder.relative(path),))


@contextmanager
def _steps_beside(roll_out: RollOut) -> Iterator[None]:
    """Solve time steps again in another process, while this one measures the rest."""
    if "speed" not in roll_out.suites or sys.platform != "linux":
        yield
        return
    fork: Any = get_context("fork")  # what the process needs is there, and nothing is loaded again
    _remembered[:] = [roll_out]
    with ProcessPoolExecutor(1, fork) as pool:
        roll_out.group.keep(gap_scale, pool.submit(_recall_scale))
        roll_out.keep(judge_steps, pool.submit(_recall_steps))
        yield


_remembered: list[RollOut] = []


def _recall_steps() -> Any:
    return _remembered[0].get(judge_steps)


def _recall_scale() -> Any:
    roll_out = _remembered[0]
    # It compiles the minimiser while the other process compiles the search for contact.
    if {term.name for term in roll_out.scene.energies} <= WITHOUT_STEP:
        unprepared = Potential(copy_terms(roll_out.scene))
        unprepared.hessian(roll_out.positions[0])
        LBFGS(unprepared, max_iterations=1).minimise(roll_out.positions[0])
    return roll_out.group.get(gap_scale)
