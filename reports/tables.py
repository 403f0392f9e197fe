"""The tables of a run: which numbers stand in which row and column.

Each maker takes the rows of results.csv and gives a table, or None where the run holds nothing for it.
What was not measured is None, and printed as a dash.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from benchmarks.results import Row
from reports.stability import refusals
from reports.summary import (
    EXTRA_TERMS,
    TERMS,
    Measurements,
    benchmark_cells,
    dressed_scenes,
    excess_energy,
    speed_measurements,
    suite_rows,
)
from reports.table import Cell, Column, Table


def _by_method(
    name: str, measurements: Measurements, scenes: Sequence[str] | None, columns: Iterable[tuple[str, Column]]
) -> Table | None:
    """One row per method with any of the metrics; columns nobody has are kept, as dashes."""
    pairs = list(columns)
    rows: list[tuple[Cell, ...]] = []
    for method in measurements.methods:
        means = [measurements.mean(method, metric, scenes) for metric, _ in pairs]
        if any(mean is not None for mean in means):
            rows.append((method, *means))
    if not rows:
        return None
    return Table(name, (Column("method", "Method"), *(column for _, column in pairs)), tuple(rows))


def energy_columns(measurements: Measurements) -> list[tuple[str, Column]]:
    """The paper's terms and the total, and any further term that some row of these carries."""
    further = [term for term in EXTRA_TERMS if f"energy/{term}" in measurements.metrics]
    names = [*TERMS[:-1], *further, TERMS[-1]]
    return [(f"energy/{term}", Column(term, term.capitalize(), "J")) for term in names]


def energies(rows: Sequence[Row]) -> Table | None:
    """Table 1 of the paper: energy per term, J per frame, mean over the dressed scenes."""
    measured = Measurements(suite_rows(rows, "garments"))
    scenes = dressed_scenes(measured)
    kept = measured.only(scenes)
    return _by_method("energies", kept, scenes, energy_columns(kept))


def energies_by_scene(rows: Sequence[Row]) -> Table | None:
    """The same scene by scene, small scenes and cut solvers included."""
    measured = Measurements(benchmark_cells(rows, "garments"))
    columns = energy_columns(measured)
    lines: list[tuple[Cell, ...]] = []
    for scene in measured.scenes:
        for method in measured.methods:
            means = [measured.mean(method, metric, [scene]) for metric, _ in columns]
            if any(mean is not None for mean in means):
                lines.append((scene, method, *means))
    if not lines:
        return None
    head = (Column("scene", "Scene"), Column("method", "Method"))
    return Table("energies_by_scene", (*head, *(column for _, column in columns)), tuple(lines))


def _dressed_table(name: str, rows: Sequence[Row], columns: list[tuple[str, Column]]) -> Table | None:
    measured = Measurements(suite_rows(rows, "garments"))
    scenes = dressed_scenes(measured)
    return _by_method(name, measured.only(scenes), scenes, columns)


def curvature(rows: Sequence[Row]) -> Table | None:
    """Table 2 of the paper, with the mean curvature itself beside its error."""
    return _dressed_table(
        "curvature",
        rows,
        [
            ("curvature/error", Column("error", "Mean-curvature error", "1/m")),
            ("curvature/mean", Column("mean", "Mean curvature", "1/m")),
            ("curvature/mean_difference", Column("mean_difference", "Difference of means", "1/m")),
        ],
    )


def geometry(rows: Sequence[Row]) -> Table | None:
    """Distance to the simulation, response to motion and penetration into the body."""
    return _dressed_table(
        "penetration",
        rows,
        [
            ("penetration/vertices", Column("vertices", "Below the skin", "%")),
            ("penetration/deep", Column("deep", "Deeper than 5 mm", "%")),
            ("penetration/own_part_p999", Column("own_part_p999", "99.9 % own-part depth", "mm")),
            ("drift/hem", Column("hem_drift", "Hem drift", "mm")),
            ("distance/rms", Column("distance_rms", "Distance", "mm")),
            ("dynamics/held_difference", Column("held_difference", "Held-pose difference", "mm")),
        ],
    )


def cost(rows: Sequence[Row]) -> Table | None:
    """Table 3 of the paper: data generation, training, run time of one frame, memory."""
    measured = Measurements(suite_rows(rows, "garments"))
    return _by_method(
        "cost",
        measured,
        None,
        [
            ("cost/data", Column("data_generation", "Data generation", "s")),
            ("cost/train", Column("training", "Training", "s")),
            ("cost/frame", Column("run_time", "Run time per frame", "ms")),
            ("cost/memory", Column("memory", "Memory", "MB")),
        ],
    )


def speed(rows: Sequence[Row]) -> Table | None:
    """Every point of the error-against-run-time plots."""
    measured = speed_measurements(rows)
    metrics = {
        "cost/frame": Column("run_time", "Run time", "ms"),
        "gap/relative": Column("gap", "Relative gap"),
        "gradient/norm": Column("gradient", "Gradient left", "weights"),
        "curvature/error": Column("curvature_error", "Curvature error", "1/m"),
        "curvature/histogram": Column("histogram", "Histogram distance", "1/m"),
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
    last = Column("excess_energy", "Energy excess", "J")
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
    cost,
    speed,
    validation,
    extremes,
    refusals,
    unfinished,
    metrics,
)


def make_tables(rows: Sequence[Row]) -> dict[str, Table]:
    """Every table the rows have something for, by name."""
    made = (make(rows) for make in MAKERS)
    return {table.name: table for table in made if table is not None}
