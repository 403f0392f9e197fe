"""Tables of body shapes: energies on the mean body and on others, and the excess over the reference."""

from __future__ import annotations

from reports.run.finished_run import Run
from reports.statistics.body_shapes import (
    TOTAL,
    excess_energy,
    rows_of_other_shapes,
    rows_of_shapes,
)
from reports.statistics.means_and_spreads import means
from reports.tables.table import METHOD, Cell, Column, Table, metric_column, table

METRICS = (TOTAL, "energy/strain", "energy/collision", "penetration/vertices")
OTHERS, MEAN_BODY = "other shapes", "mean shape"


def shapes(run: Run) -> list[Table]:
    """Tabulate each method on all other bodies together and on the mean body, with its excess energy."""
    rows, norms = rows_of_shapes(run)
    metrics = [run.metrics[name] for name in METRICS if name in run.metrics]
    if rows.empty or not metrics:
        return []
    methods = run.ordered(set(rows["method"]) - set(run.reference_ensemble))
    lines: list[tuple[Cell, ...]] = []
    for name, part in (
        (OTHERS, rows_of_other_shapes(run)),
        (MEAN_BODY, rows[rows["scene"].isin(norms.index[norms == 0.0])]),
    ):
        cells = means(part, "method", "metric")
        lines += [
            (
                name,
                method,
                excess_energy(run, part, method)[0],
                *(cells.get((method, m.name)) for m in metrics),
            )
            for method in methods
        ]
    columns = (
        Column("scene", "Body", text=True), METHOD, Column("above", "Above the simulation", "J"),
        *map(metric_column, metrics),
    )  # fmt: skip
    return table("shapes", columns, lines, "Body shapes: means over the others, and the mean body.")
