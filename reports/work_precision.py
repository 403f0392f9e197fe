"""Error against run time, solvers, networks and baselines on one plot; or any metric against any other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from benchmarks.results import ResultsError
from reports.data import SUITES, Metric, Run
from reports.means import value_of
from reports.numbers import number
from reports.pareto import (
    ERRORS,
    SMALLER_STEPS,
    TIME,
    WHOLE,
    Point,
    front,
    indistinct,
    points_of,
    run_time,
)
from reports.plotting import (
    PAGE_WIDTH,
    Picture,
    file_name,
    grid,
    legend_above,
    log_axis,
    new_figure,
    power_text,
    save,
)
from reports.styles import family_style, style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Of the step's own potential, which another step size changes.
OWN_STEP = ("gap/energy", "gap/relative", "step/curvature", "step/distance", "gradient/norm")
DECADES = 9  # below the largest error; what is smaller is drawn on the lower edge
GREY = "#B4B4B4"


def error_against_time(folder: Path, run: Run) -> list[Picture]:
    """One figure per scene: a panel per error, a marker per method, members of a family joined by a line.

    The first garment comes first, and of its scenes the one on which most methods ran.
    """
    cells = run.cells("speed", "garments")
    timed = cells[cells["usable"] & (cells["metric"] == TIME)]
    apart = run.standing_apart(timed)
    frame = cells[~cells["method"].isin(apart)]
    ran = timed[~timed["method"].isin(apart)].groupby("scene")["method"].nunique()
    first = next(iter(run.garments(frame).values()), [])
    pictures: list[Picture] = []
    for scene in sorted(dict.fromkeys(frame["scene"]), key=lambda s: (s not in first, -int(ran.get(s, 0)))):
        rows = frame[frame["scene"] == scene]
        panels = [
            (run.metrics[name], points) for name in ERRORS if len(points := error_points(run, rows, name)) > 1
        ]
        if panels:
            if not pictures:
                pictures.append(_draw_errors(folder, run, rows, panels[:2], lead=True))
            pictures.append(_draw_errors(folder, run, rows, panels))
    return pictures


def metric_against_metric(folder: Path, run: Run, x: str, y: str, scenes: Sequence[str]) -> Picture | None:
    """One figure of metric y against metric x, means over the scenes; None where fewer than two have both.

    Both axes are logarithmic: points at x = 0 are left out. Raises ResultsError for a negative number.
    """
    found = points_of(run, run.cells(*SUITES), scenes, y, x)
    points = [point for point in found if point.time != 0.0]
    if len(points) < 2:
        return None
    for point in points:
        if min(point.time, point.error) < 0.0:
            metric, value = (x, point.time) if point.time < 0.0 else (y, point.error)
            raise ResultsError(
                f"{metric} of {point.method} is {value:.4g}: it has no place on a logarithmic axis; "
                "name another metric"
            )
    figure = new_figure(PAGE_WIDTH * 0.75, 3.6)
    axes = figure.subplots()
    below = _draw_points(axes, run, points, None, 0.0)
    axes.set(xlabel=f"{x} [{run.metrics[x].unit}]", ylabel=f"{y} [{run.metrics[y].unit}]")
    grid(axes)
    _legend(figure, run, points, None)
    caption = f"{y} against {x}, means over {', '.join(scenes)}.{_hollow(run, below)}{_fewer(run, points)}"
    zero = ", ".join(run.label(point.method) for point in found if point not in points)
    caption += f" Left out, for {x} is zero: {zero}." if zero else ""
    return save(figure, folder, file_name(f"{y}_against_{x}"), caption=caption, kind="axes")


def error_points(run: Run, rows: pd.DataFrame, metric: str) -> list[Point]:
    """The points of one panel. The reference's own error is zero by construction: it is drawn as a line."""
    points = points_of(run, rows, list(dict.fromkeys(rows["scene"])), metric)
    # Smaller steps have errors of the garment, but none of the reference's own step.
    left_out = (SMALLER_STEPS,) if metric in OWN_STEP else ()
    reference = run.with_role("reference")
    kept = [p for p in points if run.methods[p.method].family not in left_out and p.method not in reference]
    return [p for p in kept if p.time > 0.0]


def _draw_errors(
    folder: Path,
    run: Run,
    rows: pd.DataFrame,
    panels: Sequence[tuple[Metric, list[Point]]],
    lead: bool = False,
) -> Picture:
    """All panels of one scene; as the lead of page one only some of them, with a short caption."""
    scene = rows["scene"].iloc[0]
    time = run_time(rows)
    words = "pose to vertices" if time == WHOLE else "own work"
    reference = value_of(rows, run.reference, time)
    lines, columns = -(-len(panels) // 2), min(2, len(panels))
    figure = new_figure(PAGE_WIDTH * (1.0 if columns > 1 else 0.6), 0.9 + (1.7 if lead else 2.3) * lines)
    every = np.atleast_1d(figure.subplots(lines, columns)).ravel()
    for axes in every[len(panels) :]:
        axes.set_axis_off()
    below: set[str] = set()
    bands = []
    for axes, (metric, points) in zip(every, panels):
        bands.append(indistinct(run, rows, metric.name))
        below |= _draw_points(axes, run, points, reference, bands[-1])
        unit = "" if metric.unit == "1" else f" [{metric.unit}]"
        axes.set(xlabel=f"run time, {words} [ms per frame]", title=f"{metric.title}{unit}")
        grid(axes)
    shown = [p for _, points in panels for p in points]
    _legend(figure, run, shown, reference)
    brief = f"{scene}: error against run time, both logarithmic; lower left is better. Pale line: the best "
    brief += "of all methods at each time."
    caption = f"{brief} Joined: one family, its first and last number beside."
    if reference:
        caption += f" Dotted: the converged simulation, {number(reference)} ms."
    if any(p.time_spread or p.error_spread for p in shown):
        caption += (
            " Bars: run time, the range of repeats (without them, two standard deviations over seeds); "
        )
        caption += "error, one standard deviation over seeds or, where larger, what another simulation as "
        caption += "right as the reference changes."
    if any(bands):
        caption += " Grey: as near as such simulations are to each other; of the gap, what the reference "
        caption += "leaves where contact planes are searched at the end of its steps. A tenth of that is the "
        caption += "lower edge."
    if lead:
        return save(figure, folder, "error_against_time", caption=brief, kind="lead")
    name = f"error_against_time_{file_name(scene)}"
    caption += _hollow(run, below) + _fewer(run, shown)
    return save(figure, folder, name, caption=caption, kind="speed")


def _hollow(run: Run, below: set[str]) -> str:
    names = ", ".join(run.label(method) for method in run.ordered(below))
    return f" Hollow, on the lower edge: zero or below the panel ({names})." if below else ""


def _fewer(run: Run, points: Sequence[Point]) -> str:
    words = dict.fromkeys(f"{run.label(point.method)}{point.fewer}" for point in points if point.fewer)
    return f" Seeds that did not finish are left out: {', '.join(words)}." if words else ""


def _legend(figure: Figure, run: Run, points: Sequence[Point], reference: float | None) -> None:
    methods = [run.methods[name] for name in run.ordered(p.method for p in points)]
    looks = {method.family: family_style(run, method) for method in methods}
    dotted = [replace(style(run, run.reference), marker="", line=":")] if reference else []
    legend_above(figure, [*dotted, *looks.values()], lines=False)


def _draw_points(
    axes: Axes, run: Run, points: Sequence[Point], reference: float | None, band: float
) -> set[str]:
    """The markers of one panel; returns the methods whose error is too small for it."""
    # What cannot be told from the reference needs no decades of its own.
    least = max(max((p.error for p in points), default=1.0) * 10.0**-DECADES, band / 10.0)
    edge = _limits(axes, points, reference, least)
    best = front(p for p in points if p.error > least)
    if len(best) > 1:
        axes.plot([p.time for p in best], [p.error for p in best], color="#DCDCDC", linewidth=5.0, zorder=1)
    families: dict[str, list[Point]] = {}
    for point in points:
        look = style(run, point.method)
        hollow = point.error <= least
        colour = GREY if point.error < band else look.colour
        axes.errorbar(
            point.time,
            edge if hollow else point.error,
            xerr=[[min(point.time_spread / 2, 0.9 * point.time)], [point.time_spread / 2]],
            yerr=[[min(point.error_spread, 0.9 * abs(point.error))], [point.error_spread]],
            color=colour, marker=look.marker, markersize=5.5, linestyle="none", elinewidth=0.8, zorder=3,
            markerfacecolor="white" if hollow else colour,
        )  # fmt: skip
        if run.methods[point.method].level is not None:
            families.setdefault(run.methods[point.method].family, []).append(point)
    for members in families.values():
        _join(axes, run, sorted(members, key=lambda p: run.methods[p.method].level or 0.0), least, edge)
    if band:
        axes.axhspan(edge / 10.0, band, color="#F0F0F0", zorder=0)
    if reference:
        axes.axvline(reference, color="black", linestyle=":", linewidth=1.0)
    log_axis(axes, "x")
    log_axis(axes, "y")
    return {p.method for p in points if p.error <= least}


def _join(axes: Axes, run: Run, members: Sequence[Point], least: float, edge: float) -> None:
    """The line through a family, its first and last member marked by their numbers."""
    look = family_style(run, run.methods[members[0].method])
    heights = [point.error if point.error > least else edge for point in members]
    times = [point.time for point in members]
    axes.plot(times, heights, color=look.colour, linestyle=look.line, linewidth=0.9, zorder=2)
    for place in sorted({0, len(members) - 1}):
        text = power_text(run.methods[members[place].method].level or 0.0)
        spot = (times[place], heights[place])
        axes.annotate(text, spot, (4, 3), textcoords="offset points", fontsize=6.5, color=look.colour)


def _limits(axes: Axes, points: Sequence[Point], reference: float | None, least: float) -> float:
    """Set both axes' limits; returns the height at which errors below `least` are drawn."""
    above = [p.error for p in points if p.error > least]
    low, high = min(above, default=1.0), max(above, default=1.0)
    margin = max((high / low) ** 0.1, 1.5)
    edge = low / margin**2
    axes.set_ylim(edge / 1.5 if len(above) < len(points) else low / margin, high * margin)
    times = [p.time for p in points] + ([reference] if reference else [])
    spread = max((max(times) / min(times)) ** 0.08, 1.4)
    axes.set_xlim(min(times) / spread, max(times) * spread)
    return edge
