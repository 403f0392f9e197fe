"""Variants of a method beside their base: what the variation makes worse, and better."""

from __future__ import annotations

from collections.abc import Iterator

import pandas as pd

from reports.data import Run
from reports.means import mean_of, pair
from reports.significance import difference
from reports.table import Cell, Column, Table, metric_column, table

SHOWN = (
    "energy/strain", "energy/bending", "energy/gravity", "energy/inertia", "energy/collision", "energy/total",
    "curvature/error", "penetration/vertices", "dynamics/amplitude", "dynamics/correlation", "roll_out/drift",
)  # fmt: skip
# A term that is left out of the loss is of course larger; the total is the base's own loss, curvature error
# (the paper's measure) is nobody's.
JUDGED = ("energy/total", "curvature/error", "penetration/vertices", "roll_out/drift")
HEAD = (
    Column("garment", "Garment", text=True),
    Column("method", "Method", text=True, method=True, width="1fr"),
)


def ablations(run: Run) -> list[Table]:
    """The numbers of each base and of its ablations that ran, by garment."""
    metrics = [run.metrics[name] for name in SHOWN if name in run.metrics]
    lines: list[tuple[Cell, ...]] = [
        (garment, method, *(mean_of(rows, method, metric.name) for metric in metrics))
        for garment, base, below, rows in _families(run)
        for method in (base, *below)
    ]
    columns = [metric_column(metric) for metric in metrics]
    caption = "Ablations: the base first, then its variants."
    return table("ablations", (*HEAD, *columns), lines, caption, grouped_by=("garment",))


def ablations_judged(run: Run) -> list[Table]:
    """In which measures each ablation is worse or better than its base by more than seeds scatter."""
    lines: list[tuple[Cell, ...]] = []
    for garment, base, below, rows in _families(run):
        for method in below:
            ways: dict[int, list[str]] = {1: [], -1: [], 0: []}
            for name in JUDGED:
                own, full = pair(rows, method, base, name) if name in run.metrics else (None, None)
                if own is not None and full is not None:
                    ways[difference(own, full)].append(f"{run.metrics[name].title}{own.fewer}")
            lines.append((garment, method, ", ".join(ways[1]), ", ".join(ways[-1])))
    words = [Column(way, f"{way.capitalize()} in", text=True, width="1fr") for way in ("worse", "better")]
    caption = (
        "Where each variant is worse or better than its base by more than seeds scatter, over the scenes "
        "that both have."
    )
    return table("ablations_judged", (*HEAD, *words), lines, caption, grouped_by=("garment",))


def _families(run: Run) -> Iterator[tuple[str, str, list[str], pd.DataFrame]]:
    """Garment, base, the ablations that ran beside it, and the rows of the garment."""
    for garment in run.garments(run.worn):
        rows = run.worn[run.worn["garment"] == garment]
        usable = rows[rows["usable"]]["method"]
        beside = run.standing_apart(rows)
        below = [method for method in run.ordered(usable) if method in beside]
        for base in dict.fromkeys(run.methods[method].base for method in below):
            yield garment, base, [m for m in below if run.methods[m].base == base], rows
