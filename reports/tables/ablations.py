"""Tables of ablations: variants of a method against their base."""

from __future__ import annotations

from collections.abc import Iterator

import pandas as pd

from reports.run.finished_run import Run
from reports.statistics.means_and_spreads import mean_of
from reports.statistics.relative_excess import relative_metric
from reports.statistics.verdicts import compare_methods
from reports.tables.table import GARMENT, METHOD, Cell, Table, metric_column, table

SHOWN = (
    "energy/strain", "energy/bending", "energy/gravity", "energy/inertia", "energy/collision", "energy/total",
    "curvature/error", "penetration/vertices", "dynamics/amplitude", "dynamics/correlation", "roll_out/drift",
)  # fmt: skip
# A term that is left out of the loss is of course larger; the total is the base's own loss, curvature error
# (the paper's measure) is nobody's.
COMPARED = ("energy/total", "curvature/error", "penetration/vertices", "roll_out/drift")
HEAD = (GARMENT, METHOD)


def ablations(run: Run) -> list[Table]:
    """Tabulate the numbers of each base and of its ablations that ran, by garment."""
    metrics = [run.metrics[name] for name in SHOWN if name in run.metrics]
    lines: list[tuple[Cell, ...]] = [
        (garment, method, *(mean_of(rows, method, metric.name) for metric in metrics))
        for garment, base, below, rows in _families(run)
        for method in (base, *below)
    ]
    columns = [metric_column(metric) for metric in metrics]
    caption = "Ablations: the base first, then its variants."
    return table("ablations", (*HEAD, *columns), lines, caption, grouped_by=("garment",))


def ablation_effects(run: Run) -> list[Table]:
    """Tabulate the effect of each ablation against its base, with intervals."""
    metrics = [run.metrics[name] for name in COMPARED if name in run.metrics]
    lines: list[tuple[Cell, ...]] = []
    for garment, base, below, rows in _families(run):
        for method in below:
            effects = [compare_methods(run, rows, metric, method, base).effect for metric in metrics]
            lines.append((garment, method, *effects))
    caption = (
        "Effect of each variant, over the scenes that it shares with its base. ×: variant over base, of "
        "geometric means. Numbers without × are variant minus base, in the unit of the column; of relative "
        "excess, in points."
    )
    note = (
        "Below: 95 % intervals over motions and seeds, each for itself; of points the interval on the scale "
        "of the test, with the mean nearer to 0 held."
    )
    shown = [relative_metric(metric.name) if metric.arbitrary_zero else metric for metric in metrics]
    columns = (*HEAD, *map(metric_column, shown))
    return table("ablation_effects", columns, lines, caption, grouped_by=("garment",), note=note)


def _families(run: Run) -> Iterator[tuple[str, str, list[str], pd.DataFrame]]:
    """Yield garment, base, the ablations that ran with it, and the rows of the garment."""
    for garment in run.garments(run.garment_rows):
        rows = run.garment_rows[run.garment_rows["garment"] == garment]
        usable = rows[rows["usable"]]["method"]
        ablations_here = run.standing_apart(rows)
        below = [method for method in run.ordered(usable) if method in ablations_here]
        for base in dict.fromkeys(run.methods[method].base for method in below):
            yield garment, base, [m for m in below if run.methods[m].base == base], rows
