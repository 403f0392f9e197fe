"""Table of errors in multiples of the spread of the reference's ensemble."""

from __future__ import annotations

from reports.run.finished_run import Run
from reports.statistics.spreads import AT_REFERENCE, in_spreads
from reports.tables.table import GARMENT, METHOD, Cell, Column, Table, table


def errors_in_spreads(run: Run) -> list[Table]:
    """Tabulate distances, curvature errors and dynamics in spreads of the reference's ensemble."""
    metrics = [run.metrics[name] for name in AT_REFERENCE if name in run.metrics]
    variants = set(run.with_role("reference", "reference-variant"))
    lines: list[tuple[Cell, ...]] = []
    for garment in run.garments(run.garment_rows):
        rows = run.garment_rows[run.garment_rows["garment"] == garment]
        for method in run.ordered(set(rows[rows["usable"]]["method"]) - variants):
            values = [in_spreads(run, rows, method, metric.name) for metric in metrics]
            if any(value is not None for value in values):
                lines.append((garment, method, *values))
    columns = (GARMENT, METHOD, *(Column(metric.name, metric.title) for metric in metrics))
    caption = (
        "Distance from the reference in spreads of its ensemble: 1 is as near as another valid simulation. "
        "Mean error of the motions over their mean spread."
    )
    return table("errors_in_spreads", columns, lines, caption, grouped_by=("garment",))
