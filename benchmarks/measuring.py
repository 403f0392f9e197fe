"""Metrics of all cells, a scene in a worker: nothing is timed here, so two scenes go side by side."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path

from .agenda import REFERENCE, Agenda
from .cell import Outcome, Task, built
from .methods import find_method
from .plan import Cell, Plan, network_of
from .presets import Preset
from .records import Records, Work
from .results import Row, RunFolder
from .rows import clock_costs, model_costs, rows_of
from .wardrobe import Wardrobe
from .workers import Failure, Job, Tell, run_jobs


def rows_of_cells(
    outcomes: Sequence[Outcome],
    agenda: Agenda,
    records: Records,
    wardrobe: Wardrobe | None,
) -> list[Row]:
    """The rows of all cells; metrics of those that have none yet are computed, scene by scene.

    A cell that is kept though it is out of date has the metrics that it had: nothing is measured of it, nor
    compared with it.
    """
    plan, kept = agenda.plan, dict[Cell, str]()
    for cell in (outcome.cell for outcome in outcomes if outcome.recorded):
        trajectory = records.find(agenda.cell(cell))
        if trajectory.remark:
            kept[cell] = trajectory.remark
    recorded = [outcome for outcome in outcomes if outcome.recorded and outcome.cell not in kept]
    works = {outcome.cell: agenda.metrics(outcome.cell) for outcome in outcomes if outcome.recorded}
    jobs = jobs_of_scenes(recorded, works, plan, records)
    ended = run_jobs(jobs, wardrobe, title="metrics", unit="cell", workers=plan.workers)
    reasons = {job.label: end.reason for job, end in zip(jobs, ended) if isinstance(end, Failure)}
    rows = []
    for outcome in outcomes:
        found = records.find(works[outcome.cell]) if outcome.recorded else None
        metrics: dict[str, float] = {}
        remark = kept.get(outcome.cell, "")
        usable = found is not None and (found.state == "finished" or remark)
        if found is not None and usable and found.result is not None:
            outcome = dataclasses.replace(outcome, reason=outcome.reason or remark)
            metrics = {**found.result, **clock_costs(outcome), **costs_of(outcome.cell, agenda, records)}
        elif remark:
            reason = f"{remark}; no metrics of it are there"
            outcome = dataclasses.replace(outcome, status="skipped", reason=reason)
        elif found is not None:
            reason = f"metrics: {reasons.get(outcome.cell.scene.name, 'the worker ended')}"
            outcome = dataclasses.replace(outcome, status="failed", reason=reason)
        rows += rows_of(outcome, metrics)
    return rows


def costs_of(cell: Cell, agenda: Agenda, records: Records) -> dict[str, float]:
    """What the cell's network has cost by its records, where it has one: no measurement of its trajectory."""
    network, plan = network_of(cell), agenda.plan
    result = records.find(agenda.network(network)).result if network else None
    if network is None or not result:
        return {}
    motions = plan.train_of(network.garment) if network.garment in plan.simulated else ()
    data = [records.find(agenda.data(motion, network.garment)) for motion in motions]
    gone = any(found.state == "missing" for found in data)
    seconds = None if gone else sum((found.result or {}).get("seconds", 0.0) for found in data)
    return model_costs(network.name, result, seconds)


def jobs_of_scenes(
    recorded: Sequence[Outcome], works: Mapping[Cell, Work], plan: Plan, records: Records
) -> list[Job]:
    """One job for each scene with cells that have no metrics yet; the largest first."""
    jobs = []
    for scene in plan.scenes:
        outcomes, wanted = [], []
        for outcome in (outcome for outcome in recorded if outcome.cell.scene == scene):
            work = works[outcome.cell]
            missing = records.find(work).state != "finished"
            if missing or outcome.cell.method.startswith(REFERENCE):
                outcomes.append(outcome)
                wanted.append(work if missing else None)
        count = sum(work is not None for work in wanted)
        if count:
            arguments = (tuple(outcomes), tuple(wanted), plan.preset, records)
            jobs.append(Job(scene.name, measure, arguments, count))
    return sorted(jobs, key=lambda job: -job.units)


def measure(
    wardrobe: Wardrobe | None,
    tell: Tell,
    outcomes: Sequence[Outcome],
    wanted: Sequence[Work | None],
    preset: Preset,
    records: Records,
) -> None:
    """Measure recorded cells of one scene beside each other, and write the records of those that are wanted.

    The others, None in `wanted`, are there because the wanted ones are compared with them.
    """
    from .evaluate import measure_scene

    folder: Path = records.folder.path
    cell = outcomes[0].cell
    task = Task(
        cell=cell, entry=find_method(cell.method), preset=preset, wardrobe=wardrobe, folder=folder
    )  # fmt: skip
    found = measure_scene(outcomes, built(task), RunFolder(folder), gap_samples=preset.gap_samples)
    for work, metrics in zip(wanted, found):
        if work is not None:
            records.keep(work, metrics, seconds=0.0)
            tell(1)
