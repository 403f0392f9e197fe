"""Figures of single values behind the means, and of checks with a known answer.

Values behind the means: a dot for each motion and seed, a bar at the mean.

Relative excess takes the place of the total energy where the run has it. It spans decades and may be below
zero, so it is drawn on the scale of its statistics, arcsinh(x / 1 %).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.results.protocol import SOFTENING
from reports.figures.figure import Drawing
from reports.figures.plotting import arcsinh_axis, fit, leading, log_axis, new_panels, style, wrapped
from reports.run.finished_run import Run
from reports.statistics.means_and_spreads import Mean, means
from reports.statistics.outcomes import checks, tolerances_away
from reports.statistics.relative_excess import RELATIVE_EXCESS, TOTAL, excess_of, with_relative_excess
from reports.tables.table import number

if TYPE_CHECKING:
    from matplotlib.axes import Axes

METRICS = (TOTAL, "curvature/error", "penetration/vertices")
MOST_METHODS = 24  # methods that have room below each other


def dots(run: Run) -> Iterator[Drawing]:
    """Draw cells behind the means of the first garment, a panel for each metric, a line for each method."""
    rows = run.garment_rows
    rows = rows[(rows["garment"] == run.first_garment) & rows["usable"] & rows["metric"].isin(METRICS)]
    methods = leading(run, set(rows["method"]))[:MOST_METHODS]
    if not run.first_garment or not methods:
        return
    rows = with_relative_excess(run, rows)
    measured = set(rows[rows["method"].isin(methods)]["metric"])
    names = [name for name in METRICS if name in measured]
    excess = RELATIVE_EXCESS.name if RELATIVE_EXCESS.name in measured else ""
    if excess:
        names[0] = excess
    by_method = means(rows, "method", "metric")
    labels = [wrapped(run.label(method), 28) for method in methods]
    lines = max(label.count("\n") + 1 for label in labels)
    figure, panels = new_panels(len(names), 3, sharey=True)
    for axes, name in zip(panels, names):
        of_methods = [by_method.get((method, name)) for method in methods]
        bars = [mean and mean.value for mean in of_methods]
        if name == excess:
            bars = [known and known.typical for known in (excess_of(run, rows, m) for m in methods)]
        shown = _draw_panel(axes, run, methods, of_methods, bars)
        if name == excess:
            arcsinh_axis(axes, shown, SOFTENING)
        elif min(shown) > 0.0 and max(shown) > 20.0 * min(shown):
            axes.set_xlim(min(shown) / 1.3, max(shown) * 1.3)
            log_axis(axes, "x")
        axes.set_xlabel((RELATIVE_EXCESS if name == excess else run.metrics[name]).heading)
        axes.grid(False, axis="y")
    panels[0].set_yticks(range(len(methods)), labels)
    panels[0].set_ylim(len(methods) - 0.4, -0.6)
    fit(figure, height=(0.04 + 0.13 * lines) * len(methods))
    caption = f"{run.first_garment}: each motion and seed behind the means; the bar is the mean"
    caption += ", of the relative excess its typical value." if excess else "."
    yield Drawing(figure, "dots", caption)


def _draw_panel(
    axes: Axes, run: Run, methods: list[str], of_methods: list[Mean | None], bars: list[float | None]
) -> list[float]:
    """Draw a line of dots for each method, and its bar where it has one; return the values drawn."""
    shown: list[float] = []
    for place, (method, mean, bar) in enumerate(zip(methods, of_methods, bars)):
        if mean is None:
            continue
        look, values = style(run, method), np.array(list(mean.cells.values()))
        shown += values.tolist()
        axes.plot(
            values, np.full(len(values), place), look.marker, color=look.colour, alpha=0.55,
            markersize=4, linestyle="none",
        )  # fmt: skip
        if bar is not None:
            axes.plot([bar] * 2, [place - 0.36, place + 0.36], color="#111111", linewidth=1.4)
    return shown


LOWEST = 1e-6  # tolerances away: what is nearer is drawn here


def known_answers(run: Run) -> Iterator[Drawing]:
    """Draw in order how many tolerances two checks or more lie from their answers."""
    away = [tolerances_away(row) for row in checks(run).itertuples()]
    known = sorted(float(x) for x in away if x is not None and math.isfinite(x))
    if len(known) < 2:
        return
    figure, (axes,) = new_panels(1)
    heights = np.maximum(known, LOWEST)
    axes.plot(range(1, len(known) + 1), heights, "o", color="#0072B2", markersize=3)
    axes.axhline(1.0, color="#D55E00", linewidth=1.2)
    axes.annotate("tolerance", (1, 1.0), (0, 3), textcoords="offset points", fontsize=8, color="#B04A00")
    axes.set_ylim(LOWEST / 2.0, max(3.0, 2.0 * heights[-1]))
    axes.set(xlabel="checks, in order", ylabel="tolerances away")
    log_axis(axes, "y")
    fit(figure)
    caption = f"{len(known)} checks with a known answer: distance from it over the tolerance"
    caption += f"; {number(LOWEST, 1)} stands for all that is less."
    yield Drawing(figure, "known_answers", caption)
