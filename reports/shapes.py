"""Energies on bodies of several shapes, against how far each is from the mean one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from reports.data import Run
from reports.means import means
from reports.numbers import number
from reports.plotting import PAGE_WIDTH, Picture, grid, legend_above, log_axis, new_figure, save
from reports.styles import style
from reports.table import Cell, Column, Table, metric_column, table

SHAPE, TOTAL = "body/shape", "energy/total"
SHOWN = (TOTAL, "energy/strain", "energy/collision", "penetration/vertices")
LINEAR = (TOTAL, "penetration/vertices")
LEAST = 1e-4  # [J]: what is less is drawn here


def shapes(run: Run) -> list[Table]:
    """Each method on the mean body, on each other one, and their mean; and its total above the simulation's.

    Without a simulation, or a scene of another shape, there is none.
    """
    rows, sizes = _rows(run)
    columns = [run.metrics[name] for name in SHOWN if name in run.metrics]
    if rows.empty or not columns:
        return []
    found = means(rows, "scene", "method", "metric")
    other = rows[rows["scene"].map(sizes) > 0.0]
    others = means(other, "method", "metric")
    methods = run.ordered(set(rows["method"]))

    def line(of: pd.Series, *key: str) -> tuple[Cell, ...]:
        values = [of.get((*key, metric.name)) for metric in columns]
        ours, theirs = of.get((*key, TOTAL)), of.get((*key[:-1], run.reference, TOTAL))
        above = ours.value - theirs.value if ours and theirs and key[-1] != run.reference else None
        return (above, *values)

    ordered = sorted(sizes.index, key=lambda scene: sizes[scene])
    lines: list[tuple[Cell, ...]] = [
        (scene, float(sizes[scene]), method, *line(found, scene, method))
        for scene in ordered
        for method in methods
    ]
    together = [("other shapes", None, method, *line(others, method)) for method in methods]
    heads = (
        Column("scene", "Scene", text=True), Column("shape", "Norm of the shape"),
        Column("method", "Method", text=True, method=True),
        Column("above", "Above the simulation", "J"),
    )  # fmt: skip
    caption = "Body shapes: means over the other shapes, then scene by scene."
    return table(
        "shapes", (*heads, *map(metric_column, columns)), [*together, *lines], caption,
        grouped_by=("scene",),
    )  # fmt: skip


def against_shape(folder: Path, run: Run) -> list[Picture]:
    """A panel for each number, a mark for each method and body, bodies in the order of their norms."""
    rows, sizes = _rows(run)
    shown = [name for name in SHOWN if name in set(rows["metric"])]
    if not shown:
        return []
    ordered = list(sizes.sort_values(kind="stable").index)  # norms lie too near each other for an axis
    places = range(len(ordered))
    figure = new_figure(PAGE_WIDTH, 2.2 * -(-len(shown) // 2) + 0.4)
    drawn: set[str] = set()
    for number_, name in enumerate(shown, start=1):
        axes = figure.add_subplot(-(-len(shown) // 2), min(2, len(shown)), number_)
        own = rows[rows["metric"] == name]
        for method, line in own.groupby("method"):
            values, look = line.groupby("scene")["value"].mean().reindex(ordered), style(run, str(method))
            least = values if name in LINEAR else values.clip(lower=LEAST)
            axes.plot(
                places, least.to_numpy(), color=look.colour, marker=look.marker, markersize=4, linewidth=0.5
            )
            drawn.add(str(method))
        axes.set_xticks(places, [number(sizes[scene], 2) for scene in ordered], fontsize=7)
        axes.set(xlabel="norm of the shape")
        axes.set_ylabel(run.metrics[name].heading)
        if name not in LINEAR:
            log_axis(axes, "y")
        grid(axes)
    legend_above(figure, [style(run, method) for method in run.ordered(drawn)], lines=False)
    caption = "One motion on the mean body (norm 0) and on others that no training has drawn."
    return [save(figure, folder, "against_shape", caption=caption, kind="shapes")]


def _rows(run: Run) -> tuple[pd.DataFrame, pd.Series]:
    """The usable rows of scenes whose shape is known, and scene -> its norm; none unless shapes differ."""
    cells = run.cells("shapes")
    cells = cells[cells["usable"]]
    sizes = cells[cells["metric"] == SHAPE].drop_duplicates("scene").set_index("scene")["value"]
    kept = cells["scene"].isin(sizes.index) if sizes.nunique() > 1 else np.zeros(len(cells), bool)
    return cells[kept], sizes
