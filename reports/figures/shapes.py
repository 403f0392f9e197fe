"""Energies on bodies of several shapes, against how far each is from the mean one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from reports.figures.plotting import (  # fmt: skip
    PAGE_WIDTH,
    Picture,
    grid,
    legend_above,
    log_axis,
    new_figure,
    power_text,
    save,
)
from reports.figures.styles import style
from reports.run.rows import Run
from reports.statistics.means import means, pair
from reports.tables.numbers import number
from reports.tables.table import Cell, Column, Table, metric_column, table

SHAPE, TOTAL = "body/shape", "energy/total"
SHOWN = (TOTAL, "energy/strain", "energy/collision", "penetration/vertices")
LINEAR = ("penetration/vertices",)
OTHERS = "other shapes"
LEAST = 1e-4  # [J]: what is less is drawn here


def shapes(run: Run) -> list[Table]:
    """Each method on the mean body and on all others together, then on each body; and its total above the
    simulation's.

    Without a simulation, or a scene of another shape, there is none.
    """
    rows, sizes = _rows(run)
    elsewhere = rows[rows["scene"].map(sizes) > 0.0]
    columns = [run.metrics[name] for name in SHOWN if name in run.metrics]
    if rows.empty or not columns:
        return []
    found = means(rows, "scene", "method", "metric")
    others = means(elsewhere, "method", "metric")
    methods = run.ordered(set(rows["method"]) - set(run.twins))

    def numbers(of: pd.Series, *key: str) -> list[Cell]:
        return [of.get((*key, metric.name)) for metric in columns]

    def above(scene: str, method: str) -> float | None:
        one, other = (found.get((scene, name, TOTAL)) for name in (method, run.reference))
        return one.value - other.value if one and other and method != run.reference else None

    ordered = sorted(sizes.index, key=lambda scene: sizes[scene])
    each: list[tuple[Cell, ...]] = [
        (scene, float(sizes[scene]), method, above(scene, method), *numbers(found, scene, method))
        for scene in ordered
        for method in methods
    ]
    together: list[tuple[Cell, ...]] = [
        (OTHERS, None, method, _above(run, elsewhere, method)[0], *numbers(others, method))
        for method in methods
    ]
    of_mean = [own for own in each if own[1] == 0.0]
    heads = (
        Column("scene", "Scene", text=True), Column("shape", "Norm of the shape"),
        Column("method", "Method", text=True, method=True),
        Column("above", "Above the simulation", "J"), *map(metric_column, columns),
    )  # fmt: skip
    return [
        *table(
            "shapes", heads, [*together, *of_mean], "Body shapes: means over the others, and the mean body."
        ),
        *table("shapes_by_scene", heads, each, "Body shapes, body by body.", grouped_by=("scene",)),
    ]


def on_other_bodies(run: Run) -> str:
    """What networks, and skinning alone, have above the simulation, in a sentence; empty without a number."""
    rows, sizes = _rows(run)
    rows = rows[rows["scene"].map(sizes) > 0.0]
    told = []
    for name in run.ordered(set(rows["method"]) - set(run.twins)):
        if run.methods[name].role in ("baseline", "network", "ablation"):
            above, fewer = _above(run, rows, name)
            told += [] if above is None else [f"{run.label(name)} {number(above)}{fewer}"]
    where = f"on {(sizes > 0.0).sum()} other bodies [J]"
    return f"Total energy above the simulation's {where}: {', '.join(told)}." if told else ""


def _above(run: Run, rows: pd.DataFrame, method: str) -> tuple[float | None, str]:
    """Total energy above the simulation's [J], mean over the bodies that both have, and words on those that
    it lacks; None of the simulation itself.
    """
    if method == run.reference:
        return None, ""
    one, other = pair(rows, method, run.reference, TOTAL)
    return (one.value - other.value, one.fewer) if one and other else (None, "")


def against_shape(folder: Path, run: Run) -> list[Picture]:
    """A panel for each number, a mark for each method and body, bodies in the order of their norms.

    The zero of the total is a choice: it is drawn above that of the simulation.
    """
    rows, sizes = _rows(run)
    rows = rows[~rows["method"].isin(run.twins) & rows["usable"]]
    shown = [name for name in SHOWN if name in set(rows["metric"])]
    if not shown:
        return []
    ordered = list(sizes.sort_values(kind="stable").index)  # norms lie too near each other for an axis
    places = range(len(ordered))
    figure = new_figure(PAGE_WIDTH, 2.2 * -(-len(shown) // 2) + 0.4)
    drawn: set[str] = set()
    for number_, name in enumerate(shown, start=1):
        axes = figure.add_subplot(-(-len(shown) // 2), min(2, len(shown)), number_)
        own = rows[rows["metric"] == name].groupby(["method", "scene"])["value"].mean().unstack(0)
        own, heading = own.reindex(ordered), run.metrics[name].heading
        if name == TOTAL and run.reference in own:
            own = own.drop(columns=run.reference).sub(own[run.reference], axis=0)
            heading = f"{run.metrics[name].title} above the simulation [{run.metrics[name].unit}]"
        for method, values in own.items():
            look = style(run, str(method))
            least = values if name in LINEAR else values.clip(lower=LEAST)
            axes.plot(
                places, least.to_numpy(), color=look.colour, marker=look.marker, markersize=4, linewidth=0.5
            )
            drawn.add(str(method))
        axes.set_xticks(places, [number(sizes[scene], 2) for scene in ordered], fontsize=7)
        axes.set(xlabel="norm of the shape")
        axes.set_ylabel(heading)
        if name not in LINEAR:
            log_axis(axes, "y")
        grid(axes)
    legend_above(figure, [style(run, method) for method in run.ordered(drawn)], lines=False)
    caption = (
        "One motion on the mean body (norm 0) and on others that no training has drawn. On axes that are "
        f"logarithmic what is below {power_text(LEAST)} J is drawn there."
    )
    return [save(figure, folder, "against_shape", caption=caption, kind="shapes")]


def _rows(run: Run) -> tuple[pd.DataFrame, pd.Series]:
    """The rows of scenes whose shape is known, and scene -> its norm; none unless shapes differ."""
    cells = run.cells("shapes")
    known = cells[(cells["metric"] == SHAPE) & cells["usable"]]
    sizes = known.drop_duplicates("scene").set_index("scene")["value"]
    kept = cells["scene"].isin(sizes.index) if sizes.nunique() > 1 else np.zeros(len(cells), bool)
    return cells[kept], sizes
