"""Error against run time, solvers, networks and baselines on one plot; or any metric against any other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from benchmarks.results.json_file import ResultsError
from reports.figures.plotting import (
    PAGE_WIDTH,
    Picture,
    file_name,
    grid,
    legend_above,
    legend_beside,
    log_axis,
    new_figure,
    power_text,
    save,
    wrapped,
)
from reports.figures.styles import family_style, style
from reports.run.rows import SUITES, Metric, Run
from reports.statistics.means import value_of
from reports.statistics.pareto import (
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
from reports.tables.numbers import number

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Of the step's own potential, which another step size changes.
OWN_STEP = ("gap/energy", "gap/relative", "step/curvature", "step/distance", "gradient/norm")
DECADES = 9  # below the largest error; what is smaller is drawn on the lower edge
GREY = "#B4B4B4"
NEAR = 1.6  # times another's time and error: two numbers beside them would cover each other
MOST_PANELS, MOST_SCENES = 4, 9  # in the PDF; the page has all


def error_against_time(folder: Path, run: Run) -> list[Picture]:
    """Of the leading scene the first error for page one, then all errors; then the first error of each scene.

    A marker per method, members of a family joined by a line.
    """
    frame, scenes = compared_cells(run)
    shown = {}
    for scene in scenes:
        rows = frame[frame["scene"] == scene]
        points = {name: found for name in ERRORS if len(found := error_points(run, rows, name)) > 1}
        if points:
            shown[scene] = (rows, [(run.metrics[name], found) for name, found in points.items()])
    if not shown:
        return []
    rows, panels = next(iter(shown.values()))
    pictures = [_draw_errors(folder, run, rows, panels[:1], lead=True)]
    if len(panels) > 1:
        pictures.append(_draw_errors(folder, run, rows, panels[:MOST_PANELS]))
    others = [(own, found[0]) for own, found in shown.values()][1:MOST_SCENES]
    return pictures + _draw_scenes(folder, run, others)


def compared_cells(run: Run) -> tuple[pd.DataFrame, list[str]]:
    """The rows of these plots, and their scenes: those of the first garment come first, and of these the ones
    on which most methods were timed.
    """
    cells = run.cells("speed", "garments")
    timed = cells[cells["usable"] & (cells["metric"] == TIME)]
    apart = run.standing_apart(timed)
    frame = cells[~cells["method"].isin(apart)]
    ran = timed[~timed["method"].isin(apart)].groupby("scene")["method"].nunique()
    first = next(iter(run.garments(frame).values()), [])
    scenes = [scene for scene in dict.fromkeys(frame["scene"]) if scene in ran]
    return frame, sorted(scenes, key=lambda scene: (scene not in first, -int(ran[scene])))


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
    """All panels of one scene; the one of page one is wide and has its legend beside it."""
    scene = rows["scene"].iloc[0]
    time = run_time(rows)
    words = "pose to vertices" if time == WHOLE else "own work"
    reference = value_of(rows, run.reference, time)
    columns = 3 if len(panels) == 3 else min(2, len(panels))
    lines = -(-len(panels) // columns)
    figure = new_figure(PAGE_WIDTH, 2.05 if lead else 0.75 + 2.0 * lines)
    every = np.atleast_1d(figure.subplots(lines, columns)).ravel()
    for axes in every[len(panels) :]:
        axes.set_axis_off()
    below: set[str] = set()
    bands = []
    for axes, (metric, points) in zip(every, panels):
        bands.append(indistinct(run, rows, metric.name))
        below |= _draw_points(axes, run, points, reference, bands[-1])
        axes.set(xlabel=f"run time, {words} [ms per frame]", title=metric.heading)
        grid(axes)
    shown = [p for _, points in panels for p in points]
    _legend(figure, run, shown, reference, beside=lead)
    caption = f"{scene}: lower left is better. Pale line: the best at each time. Grey: within the "
    caption += "reference's uncertainty."
    if lead:
        return save(figure, folder, "error_against_time", caption=caption, kind="lead")
    caption += f" Dotted: the converged simulation, {number(reference)} ms." if reference else ""
    caption += " Joined: one family, its first and last number beside. Bars: repeats and seeds or, where "
    caption += "larger, what another simulation as right as the reference changes."
    caption += _hollow(run, below) + _fewer(run, shown)
    name = f"error_against_time_{file_name(scene)}"
    return save(figure, folder, name, caption=caption, kind="speed")


def _draw_scenes(
    folder: Path, run: Run, scenes: Sequence[tuple[pd.DataFrame, tuple[Metric, list[Point]]]]
) -> list[Picture]:
    """A small panel for each scene."""
    if not scenes:
        return []
    columns = min(4, len(scenes))
    lines = -(-len(scenes) // columns)
    figure = new_figure(PAGE_WIDTH, 0.35 + 1.55 * lines)
    every = np.atleast_1d(figure.subplots(lines, columns)).ravel()
    for axes in every[len(scenes) :]:
        axes.set_axis_off()
    titles = list(dict.fromkeys(metric.heading for _, (metric, _) in scenes))
    for axes, (rows, (metric, points)) in zip(every, scenes):
        reference = value_of(rows, run.reference, run_time(rows))
        _draw_points(axes, run, points, reference, indistinct(run, rows, metric.name), small=True)
        scene = wrapped(str(rows["scene"].iloc[0]), 24)
        axes.set_title("\n".join([scene, *([metric.heading] if len(titles) > 1 else [])]), fontsize=8)
        axes.tick_params(labelsize=7)
        grid(axes)
    figure.supxlabel("run time [ms per frame]", fontsize=8.5)
    caption = f"The same of other scenes, in the colours above: {' or '.join(titles)} against run time."
    return [save(figure, folder, "error_against_time_scenes", caption=caption, kind="scenes")]


def _hollow(run: Run, below: set[str]) -> str:
    names = ", ".join(run.label(method) for method in run.ordered(below))
    return f" Hollow, on the lower edge: zero or below the panel ({names})." if below else ""


def _fewer(run: Run, points: Sequence[Point]) -> str:
    words = dict.fromkeys(f"{run.label(point.method)}{point.fewer}" for point in points if point.fewer)
    return f" Seeds that did not finish are left out: {', '.join(words)}." if words else ""


def _legend(
    figure: Figure, run: Run, points: Sequence[Point], reference: float | None, beside: bool = False
) -> None:
    methods = [run.methods[name] for name in run.ordered(p.method for p in points)]
    looks = {method.family: family_style(run, method) for method in methods}
    dotted = [replace(style(run, run.reference), marker="", line=":")] if reference else []
    legend = legend_beside if beside else legend_above
    legend(figure, [*dotted, *looks.values()], lines=False)


def _draw_points(
    axes: Axes, run: Run, points: Sequence[Point], reference: float | None, band: float, small: bool = False
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
            color=colour, marker=look.marker, markersize=3.5 if small else 5.5, linestyle="none",
            elinewidth=0.8, zorder=3,
            markerfacecolor="white" if hollow else colour,
        )  # fmt: skip
        if run.methods[point.method].level is not None:
            families.setdefault(run.methods[point.method].family, []).append(point)
    for members in families.values():
        _join(
            axes,
            run,
            sorted(members, key=lambda p: run.methods[p.method].level or 0.0),
            least,
            edge,
            named=not small,
        )
    if band:
        axes.axhspan(edge / 10.0, band, color="#F0F0F0", zorder=0)
    if reference:
        axes.axvline(reference, color="black", linestyle=":", linewidth=1.0)
    log_axis(axes, "x")
    log_axis(axes, "y")
    return {p.method for p in points if p.error <= least}


def _join(axes: Axes, run: Run, members: Sequence[Point], least: float, edge: float, named: bool) -> None:
    """The line through a family, its first and last member marked by their numbers where they are named."""
    look = family_style(run, run.methods[members[0].method])
    heights = [point.error if point.error > least else edge for point in members]
    times = [point.time for point in members]
    axes.plot(times, heights, color=look.colour, linestyle=look.line, linewidth=0.9, zorder=2)
    numbers = [power_text(run.methods[point.method].level or 0.0) for point in members]
    named_at = {(times[0], heights[0]): numbers[0], (times[-1], heights[-1]): numbers[-1]}
    if len(members) > 1 and max(times) < NEAR * min(times) and max(heights) < NEAR * min(heights):
        named_at = {(times[0], heights[0]): f"{numbers[0]} to {numbers[-1]}"}
    for spot, text in named_at.items() if named else ():
        axes.annotate(text, spot, (4, 3), textcoords="offset points", fontsize=7, color=look.colour)


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
