"""Table of body shapes: relative excess and energies on the mean body and on others."""

from __future__ import annotations

from reports.run.finished_run import Run
from reports.statistics.body_shapes import rows_of_other_shapes, rows_of_shapes
from reports.statistics.means_and_spreads import means
from reports.statistics.relative_excess import SKINNING, TOTAL, excess_of
from reports.tables.table import METHOD, Cell, Column, Table, metric_column, table

METRICS = (TOTAL, "energy/strain", "energy/collision", "penetration/vertices")
OTHERS, MEAN_BODY = "other shapes", "mean shape"


def shapes(run: Run) -> list[Table]:
    """Tabulate each method on all other bodies together and on the mean body, with its relative excess."""
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
        for method in methods:
            excess = None if method in (run.reference, SKINNING) else excess_of(run, part, method)
            share = (excess.effect, excess.mean) if excess else (None, None)
            lines.append((name, method, *share, *(cells.get((method, m.name)) for m in metrics)))
    columns = (
        Column("scene", "Body", text=True), METHOD, Column("typical", "Typical", "%", digits=2),
        Column("mean", "Mean", "%", digits=2), *map(metric_column, metrics),
    )  # fmt: skip
    caption = (
        "Body shapes: the others together, and the mean body, in one motion. Typical (geometric, with its "
        "interval over bodies and seeds) and mean: relative excess; energies and penetration: means."
    )
    return table("shapes", columns, lines, caption)
