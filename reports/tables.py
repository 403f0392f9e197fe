"""The tables of a run: which numbers stand in which row and column.

Each maker takes the rows of results.csv and gives a table, or None where the run holds nothing for it.
What was not measured is None, and printed as a dash.
"""

from __future__ import annotations

from collections.abc import Sequence

from benchmarks.results import Row
from reports import bars
from reports.ablations import ablations, ablations_judged
from reports.answers import by_scene
from reports.break_even import crossings
from reports.findings import findings, recipes
from reports.garment_tables import cost, curvature, dynamics, energies, energies_by_scene, geometry, shape
from reports.stability import refusals
from reports.study_tables import dependence, hard_aftermath, hard_motions, laws
from reports.summary import Measurements, excess_energy, speed_measurements, suite_rows
from reports.table import Cell, Column, Table
from reports.throughput import throughput


def speed(rows: Sequence[Row]) -> Table | None:
    """Every point of the error-against-run-time plots."""
    measured = speed_measurements(rows)
    metrics = {
        "cost/frame": Column("run_time", "Run time", "ms"),
        "gap/relative": Column("gap", "Gap"),
        "gradient/norm": Column("gradient", "Gradient", "weights"),
        "curvature/error": Column("curvature_error", "Curvature", "1/m"),
        "curvature/histogram": Column("histogram", "Histogram", "1/m"),
        "distance/rms": Column("distance_rms", "Distance", "mm"),
    }
    lines: list[tuple[Cell, ...]] = []
    for scene in dict.fromkeys(row.scene for row in suite_rows(rows, "speed")):
        for method in measured.methods:
            means = [measured.mean(method, metric, [scene]) for metric in metrics]
            excess = excess_energy(measured, scene, method)
            if means[0] is not None:
                lines.append((scene, method, *means, excess))
    if not lines:
        return None
    head = (Column("scene", "Scene"), Column("method", "Method"))
    last = Column("excess_energy", "Excess", "J")
    return Table("speed", (*head, *metrics.values(), last), tuple(lines))


def validation(rows: Sequence[Row]) -> Table | None:
    """Measured against expected, each with its tolerance."""
    lines = [
        (check_name(row), row.unit, row.value, row.expected, row.tolerance, _judgement(row))
        for row in suite_rows(rows, "validation")
        if row.metric.startswith("check") and row.status != "skipped"
    ]
    if not lines:
        return None
    columns = (
        Column("check", "Check"),
        Column("unit", "Unit"),
        Column("measured", "Measured"),
        Column("expected", "Expected"),
        Column("tolerance", "Tolerance"),
        Column("status", "Result"),
    )
    return Table("validation", columns, tuple(lines))


def _judgement(row: Row) -> str:
    """What a check says; a row without a tolerance is a number to know, not a test."""
    return "reported" if row.status == "ok" and row.tolerance is None else row.status


def check_name(row: Row) -> str:
    """The scene, and what is measured on it where a scene has several checks."""
    detail = row.metric.partition("/")[2]
    return f"{row.scene}: {detail}" if detail else row.scene


def extremes(rows: Sequence[Row]) -> Table | None:
    """How each extreme case ended, with the gradient norm it ended at."""
    lines = [
        (row.scene, row.method, row.status, row.value, row.reason or "")
        for row in suite_rows(rows, "extremes")
        if row.metric == "outcome"
    ]
    if not lines:
        return None
    columns = (
        Column("case", "Case"),
        Column("method", "Method"),
        Column("outcome", "Outcome"),
        Column("gradient", "Largest gradient", "vertex weights"),
        Column("reason", "In words"),
    )
    return Table("extremes", columns, tuple(lines))


def unfinished(rows: Sequence[Row]) -> Table | None:
    """Every cell that failed or was skipped, once per reason, whatever the number of its metrics."""
    seen: dict[tuple[Cell, ...], int] = {}
    for row in rows:
        if row.status != "ok" and not (row.suite in ("validation", "extremes") and row.status != "skipped"):
            line = (row.suite, row.scene, row.method, row.seed, row.status, row.reason or "no reason given")
            seen[line] = seen.get(line, 0) + 1
    if not seen:
        return None
    columns = (
        Column("suite", "Suite"),
        Column("scene", "Scene"),
        Column("method", "Method"),
        Column("seed", "Seed"),
        Column("status", "Status"),
        Column("reason", "Reason"),
    )
    return Table("unfinished", columns, tuple(seen))


def metrics(rows: Sequence[Row]) -> Table | None:
    """Everything measured, one line per suite, scene, method and metric: the file to plot from."""
    lines: list[tuple[Cell, ...]] = []
    for suite in dict.fromkeys(row.suite for row in rows):
        own = Measurements(suite_rows(rows, suite))
        for scene in own.scenes:
            for method in own.methods:
                for metric in own.metrics:
                    mean = own.mean(method, metric, [scene])
                    if mean is not None:
                        lines.append((suite, scene, method, metric, own.units[metric], mean, mean.seeds))
    if not lines:
        return None
    columns = tuple(
        Column(name, name) for name in ("suite", "scene", "method", "metric", "unit", "value", "seeds")
    )
    return Table("metrics", columns, tuple(lines))


MAKERS = (
    energies,
    energies_by_scene,
    curvature,
    geometry,
    shape,
    dynamics,
    cost,
    throughput,
    findings,
    ablations,
    ablations_judged,
    bars.table,
    recipes,
    by_scene,
    crossings,
    speed,
    validation,
    laws,
    dependence,
    extremes,
    hard_motions,
    hard_aftermath,
    refusals,
    unfinished,
    metrics,
)


def make_tables(rows: Sequence[Row]) -> dict[str, Table]:
    """Every table the rows have something for, by name."""
    made = (make(rows) for make in MAKERS)
    return {table.name: table for table in made if table is not None}
