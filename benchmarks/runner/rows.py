"""From outcomes to the rows of results.csv."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Mapping, Sequence
from statistics import median
from typing import TYPE_CHECKING, Any

from benchmarks.method import MethodEntry
from benchmarks.metrics import find_metric
from benchmarks.plan.cell import Cell, TaskId
from benchmarks.plan.plan import Plan, network_of, protocol_of, protocol_of_case
from benchmarks.results.protocol import FAMILY, OWN, noise
from benchmarks.results.row import DECLARED, PRETRAINED, Row
from benchmarks.runner.networks import NAME
from benchmarks.runner.task import Outcome, Task

if TYPE_CHECKING:
    from benchmarks.validation.case import Case

MS = 1e3
SPREAD = 0.2  # of the median: repeats further apart get a remark

Outcomes = Mapping[TaskId, Outcome]


def rows_of(plan: Plan, tasks: Sequence[Task], outcomes: Outcomes) -> list[Row]:
    """Return the rows of all outcomes; cells first."""
    by_id = {task.id: task for task in tasks}
    cells = [row for cell in plan.cells for row in rows_of_cell(cell, plan, by_id, outcomes)]
    others = [row for case in plan.cases for row in _rows_of_case(case, outcomes)]
    return [*with_uncertainty(cells, plan.metrics), *others]


def rows_of_cell(
    cell: Cell, plan: Plan, tasks: Mapping[TaskId, Task], outcomes: Outcomes
) -> Iterator[Row]:
    """Yield the rows of a cell in each suite; without metrics a row with its reason."""
    outcome = outcomes.get(cell.id())
    if outcome is None:
        return
    measured = outcomes.get(cell.id("metrics"))
    network, taught_by = Outcome(), list[Outcome]()
    if (model := network_of(cell)) and model.task_id in tasks:
        network = outcomes.get(model.task_id, network)
        taught_by = [outcomes[id] for id in tasks[model.task_id].reads if id in outcomes]
    metrics: dict[str, Any] = {}  # a number, or the parts of an Estimate
    status, reason = outcome.status, outcome.reason
    if outcome.files:
        assert measured is not None
        if measured.failed:
            status, reason = measured.status, f"metrics: {measured.reason}"
        else:
            if status == "ok":
                status, reason = measured.status, measured.reason or reason
            metrics = dict(measured.result)
            if cell.timed:
                costs, remark = clock_costs(cell, plan.study.sizes.repeats, outcomes)
                metrics |= costs
                reason = reason or remark
            elif (declared_ms := cell.entry.declared_ms or outcome.result.get("declared_ms")) is not None:
                metrics["cost/frame"] = declared_ms
            if cell.scene.timed:
                metrics |= model_costs(network, taught_by)
            if status == "ok" and not metrics:
                status, reason = "skipped", "no metric that the scene names applies to it"
            reason = with_remarks(reason, network)
    batch = outcomes.get(cell.id("batch"), Outcome())
    if batch.result.get("complaint"):  # it worked on behind the clock in its run too
        status, reason, metrics = "failed", f"many at once: {batch.ending}", {}
    scene, entry = cell.scene, cell.entry
    # Of a cell without numbers: nobody asked for a time where none is taken.
    untimed = "energy" in (scene.metrics or ()) and not scene.timed
    base = Row(
        suite="", scene=scene.name, method=cell.method, seed=cell.seed,
        metric="energy/total" if untimed else "cost/frame", unit="J" if untimed else "ms",
        status=status if status != "ok" else "failed", reason=reason, terms=outcome.result.get("terms", ""),
        **_origin(outcome, protocol_of(cell, plan)),
        dtype=entry.dtype, garment=scene.garment, motion=scene.motion, part=scene.part,
        family=entry.family or entry.name, level=entry.level, role=entry.role, base=entry.base,
        seeded=entry.seeded, pairing_group=entry.pairing_group,
    )  # fmt: skip
    machines = machines_of(network, taught_by)
    of_metrics = [_row(base, status, cell.entry, *item, plan.metrics) for item in metrics.items()]
    for suite in cell.suites:
        for row in of_metrics or [base]:
            hardware = machines.get(row.metric, row.hardware)
            yield dataclasses.replace(row, suite=suite, hardware=hardware)


def _row(
    base: Row, status: str, entry: MethodEntry, name: str, measured: Any, outside: tuple[str, ...]
) -> Row:
    """Return the row of a metric; measured: a number, or the parts of an Estimate."""
    value, uncertainty, moved = measured if isinstance(measured, (tuple, list)) else (measured, None, ())
    metric, reason = find_metric(name, outside), base.reason
    if name == "cost/frame" and not entry.timed:
        reason = DECLARED
    if name == "cost/spread" and value > 100.0 * SPREAD:
        reason = reason or f"repeats lie more than {100.0 * SPREAD:.0f} % apart: read times with care"
    if not math.isfinite(value):
        reason, status = reason or f"{name} is not finite", "failed" if status == "ok" else status
    return dataclasses.replace(
        base, metric=name, unit=metric.unit, value=_finite(value), status=status, reason=reason,
        uncertainty=_finite(uncertainty),
        moved=tuple((twin, change) for twin, change in moved if math.isfinite(change)),
        seeded=entry.seeded and metric.of == "answer",
        protocol=OWN if metric.declared_in else base.protocol,
    )  # fmt: skip


def _finite(number: float | None) -> float | None:
    return float(number) if number is not None and math.isfinite(number) else None


def clock_costs(cell: Cell, repeats: int, outcomes: Outcomes) -> tuple[dict[str, float], str]:
    """Return costs by clock and process, and a remark on what went wrong.

    They are cost/frame and its percentiles, cost/whole, cost/batch [ms], cost/spread [%], cost/peak [MB].

    Times are medians of repeats; of inputs, and the peak, those of the first run.
    """
    first = outcomes[cell.id()]
    remark = ""
    batch = outcomes.get(cell.id("batch"), Outcome("skipped"))
    if batch.status not in ("ok", "skipped"):
        remark = f"many at once: {batch.ending}"
    results = [first.result]
    for number in range(1, repeats):
        repeat = outcomes.get(cell.id("repeat", number), Outcome("skipped"))
        if repeat.status == "ok":
            results.append(repeat.result)
        elif repeat.status != "skipped":
            remark = remark or f"repeat {number}: {repeat.ending}"
    seconds = [result["seconds"] for result in results]
    costs = {"cost/frame": MS * median(seconds) / first.result["frames"]}
    if "inputs" in first.result:
        costs["cost/whole"] = costs["cost/frame"] + MS * first.result["inputs"]
    for name in ("frame_p50", "frame_p95", "frame_worst"):
        if name in first.result:
            costs[f"cost/{name}"] = MS * median(r[name] for r in results if name in r)
    if len(seconds) > 1:
        costs["cost/spread"] = 100.0 * (max(seconds) - min(seconds)) / median(seconds)
    if batch.status == "ok":
        costs["cost/batch"] = MS * batch.result["seconds"]
    costs["cost/peak"] = first.result["peak"]
    return costs, remark


def model_costs(network: Outcome, taught_by: Sequence[Outcome]) -> dict[str, float]:
    """Return cost/data, /setup, /memory and /train* of a trained network."""
    if not network.result:
        return {}
    names = {
        "cost/setup": "setup_seconds", "cost/train": "seconds", "cost/memory": "megabytes",
        "cost/train_steps": "steps", "cost/train_frames": "frames",
    }  # fmt: skip
    data = network.result.get("data_seconds", sum(outcome.seconds for outcome in taught_by))
    return {"cost/data": data} | {metric: network.result[name] for metric, name in names.items()}


def machines_of(network: Outcome, taught_by: Sequence[Outcome]) -> dict[str, str]:
    """Return metric -> hardware that measured its seconds, of other tasks than the cell."""
    if NAME in network.result:
        taught_by = [network]
    metrics = {"cost/data": taught_by, "cost/setup": [network], "cost/train": [network]}
    lines = {
        metric: dict.fromkeys(outcome.origin["hardware"] for outcome in outcomes if outcome.origin)
        for metric, outcomes in metrics.items()
    }
    return {metric: " and ".join(hardware) for metric, hardware in lines.items() if hardware}


def with_remarks(reason: str, network: Outcome) -> str:
    """Return the reason of a cell, or what its network lacked; and whether this is of a file."""
    facts = network.result
    if not reason and facts.get("left_out"):
        reason = f"its network learned without {', '.join(facts['left_out'])}: no simulation is whole"
    source = f"{PRETRAINED} {facts[NAME]} of {facts['trained_at']}" if NAME in facts else ""
    return "; ".join(filter(None, (reason, source)))


def _rows_of_case(case: Case, outcomes: Outcomes) -> Iterator[Row]:
    """Yield the row of a case, also of one that died or hung.

    A hang and a crash are failures: only a solver that ends by itself may call it a timeout.
    """
    outcome = outcomes.get(("case", case.name))
    if outcome is None:
        return
    row = Row(
        case.suite, case.scene or case.name, case.method, 0, case.metric, case.unit, status="failed",
        reason=outcome.reason, expected=case.expected, tolerance=case.tolerance,
    )  # fmt: skip
    if outcome.result:
        row = Row(**outcome.result)
    unit = row.unit or find_metric(row.metric).unit  # a case says its unit itself
    origin = _origin(outcome, protocol_of_case(row.scene, row.metric))
    yield dataclasses.replace(row, **origin, unit=unit)


def _origin(outcome: Outcome, protocol: str) -> dict[str, Any]:
    """Return the origin of an outcome's rows; an earlier run's protocol stays, unless it is OWN."""
    return {"protocol": protocol, **outcome.origin, **({"protocol": OWN} if protocol == OWN else {})}


def with_uncertainty(rows: Sequence[Row], outside: tuple[str, ...] = ()) -> list[Row]:
    """Return the rows, the reference's with their noise, and what the family changes.

    Of answers, and not of what has an uncertainty of its own. outside: files of further metrics.
    """
    others: dict[tuple[str, str], dict[str, float]] = {}
    for row in rows:
        if row.method in FAMILY and row.status == "ok" and row.value is not None:
            others.setdefault((row.scene, row.metric), {})[row.method] = row.value

    def with_family(row: Row) -> Row:
        family = others.get((row.scene, row.metric), {})
        answer = row.role == "reference" and find_metric(row.metric, outside).of == "answer"
        if not answer or row.uncertainty is not None or row.value is None or not family:
            return row
        moved = {twin: value - row.value for twin, value in family.items()}
        return dataclasses.replace(row, uncertainty=noise(moved), moved=tuple(moved.items()))

    return [with_family(row) for row in rows]
