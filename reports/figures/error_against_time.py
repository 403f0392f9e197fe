"""Error against run time: solvers, networks and baselines on one plot, members of a family joined."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from reports.figures.figure import Drawing, Figure
from reports.figures.method_styles import family_style, style
from reports.figures.plotting import (
    PAGE_WIDTH,
    file_name,
    grid,
    legend_above,
    legend_beside,
    log_axis,
    new_figure,
    power_text,
    wrapped,
)
from reports.run.finished_run import Metric, Run
from reports.statistics.means_and_spreads import value_of
from reports.statistics.pareto import (
    ERRORS,
    Point,
    compared_cells,
    error_points,
    front,
    indistinct,
    run_time,
    time_label,
)
from reports.tables.number_texts import number

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas

DECADES = 9  # below the largest error; what is smaller is drawn on the lower edge
GREY = "#B4B4B4"
NEAR = 1.6  # times another's time and error: two numbers beside them would cover each other
MOST_PANELS, MOST_SCENES = 4, 9  # in the PDF; the page has all
Scenes = list[tuple[pd.DataFrame, list[tuple[Metric, list[Point]]]]]  # rows and panels of each


class ErrorOfPageOne(Figure[Scenes]):
    """First error of the leading scene, for page one."""

    name = "error_against_time"

    def needs(self, run: Run) -> Scenes:
        """Return the scenes in which two methods have an error and a run time."""
        return _scenes(run)

    def draw(self, run: Run, data: Scenes) -> Iterator[Drawing]:
        """Draw one wide panel."""
        rows, panels = data[0]
        yield _draw_errors(run, rows, panels[:1], lead=True)


class ErrorsOfScene(Figure[Scenes]):
    """All errors of the leading scene."""

    name, files = "error_against_time_of_scene", ("error_against_time_*",)

    def needs(self, run: Run) -> Scenes:
        """Return the leading scene if it has more than one error."""
        return [scene for scene in _scenes(run)[:1] if len(scene[1]) > 1]

    def draw(self, run: Run, data: Scenes) -> Iterator[Drawing]:
        """Draw a panel for each error."""
        rows, panels = data[0]
        yield _draw_errors(run, rows, panels[:MOST_PANELS])


class ErrorsOfScenes(Figure[Scenes]):
    """First error of every other scene."""

    name = "error_against_time_scenes"

    def needs(self, run: Run) -> Scenes:
        """Return the scenes behind the leading one."""
        return _scenes(run)[1:MOST_SCENES]

    def draw(self, run: Run, data: Scenes) -> Iterator[Drawing]:
        """Draw a small panel for each scene."""
        yield _draw_scenes(run, [(rows, panels[0]) for rows, panels in data])


@lru_cache(maxsize=1)
def _scenes(run: Run) -> Scenes:
    """Return rows and panels of each scene, the leading one first."""
    frame, scenes = compared_cells(run)
    shown = []
    for scene in scenes:
        rows = frame[frame["scene"] == scene]
        points = {name: error_points(run, rows, name) for name in ERRORS}
        panels = [(run.metrics[name], of_error) for name, of_error in points.items() if len(of_error) > 1]
        if panels:
            shown.append((rows, panels))
    return shown


def _draw_errors(
    run: Run,
    rows: pd.DataFrame,
    panels: Sequence[tuple[Metric, list[Point]]],
    lead: bool = False,
) -> Drawing:
    """Draw panels of one scene; the one of page one is wide and has its legend beside it."""
    scene = rows["scene"].iloc[0]
    time = run_time(rows)
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
        below |= draw_points(axes, run, points, reference, bands[-1])
        axes.set(xlabel=time_label(time), title=metric.heading)
        grid(axes)
    shown = [p for _, points in panels for p in points]
    draw_legend(figure, run, shown, reference, beside=lead)
    caption = f"{scene}: lower left is better. Pale line: the best at each time. Grey: within the "
    caption += "reference's uncertainty."
    if lead:
        return Drawing(figure, "error_against_time", caption)
    caption += f" Dotted: the converged simulation, {number(reference)} ms." if reference else ""
    caption += " Joined: one family, its first and last number beside. Bars: repeats and seeds or, where "
    caption += "larger, the change by a perturbed reference."
    caption += hollow_remark(run, below) + missing_remark(run, shown)
    return Drawing(figure, f"error_against_time_{file_name(scene)}", caption)


def _draw_scenes(run: Run, scenes: Sequence[tuple[pd.DataFrame, tuple[Metric, list[Point]]]]) -> Drawing:
    """Draw a small panel for each scene."""
    columns = min(4, len(scenes))
    lines = -(-len(scenes) // columns)
    figure = new_figure(PAGE_WIDTH, 0.35 + 1.55 * lines)
    every = np.atleast_1d(figure.subplots(lines, columns)).ravel()
    for axes in every[len(scenes) :]:
        axes.set_axis_off()
    titles = list(dict.fromkeys(metric.heading for _, (metric, _) in scenes))
    for axes, (rows, (metric, points)) in zip(every, scenes):
        reference = value_of(rows, run.reference, run_time(rows))
        draw_points(axes, run, points, reference, indistinct(run, rows, metric.name), small=True)
        scene = wrapped(str(rows["scene"].iloc[0]), 24)
        axes.set_title("\n".join([scene, *([metric.heading] if len(titles) > 1 else [])]), fontsize=8)
        axes.tick_params(labelsize=7)
        grid(axes)
    figure.supxlabel("run time [ms per frame]", fontsize=8.5)
    caption = f"The same of other scenes, in the colours above: {' or '.join(titles)} against run time."
    return Drawing(figure, "error_against_time_scenes", caption)


def hollow_remark(run: Run, below: set[str]) -> str:
    """Return the remark of a caption on methods whose marker is hollow."""
    names = ", ".join(run.label(method) for method in run.ordered(below))
    return f" Hollow, on the lower edge: zero or below the panel ({names})." if below else ""


def missing_remark(run: Run, points: Sequence[Point]) -> str:
    """Return the remark of a caption on methods of which some seeds did not finish."""
    methods = dict.fromkeys(f"{run.label(point.method)}{point.fewer}" for point in points if point.fewer)
    return f" Seeds that did not finish are left out: {', '.join(methods)}." if methods else ""


def draw_legend(
    figure: Canvas, run: Run, points: Sequence[Point], reference: float | None, beside: bool = False
) -> None:
    """Draw a legend of the families of these points, and of the reference where its time is known."""
    methods = [run.methods[name] for name in run.ordered(p.method for p in points)]
    looks = {method.family: family_style(run, method) for method in methods}
    dotted = [replace(style(run, run.reference), marker="", line=":")] if reference else []
    legend = legend_beside if beside else legend_above
    legend(figure, [*dotted, *looks.values()], lines=False)


def draw_points(
    axes: Axes, run: Run, points: Sequence[Point], reference: float | None, band: float, small: bool = False
) -> set[str]:
    """Draw the markers of one panel; return the methods whose error is too small for it.

    reference: its run time [ms per frame]; band: error below which differences are inconclusive.
    """
    # An error that is inconclusive from the reference needs no decades of its own.
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
    """Draw the line through a family, its first and last member marked by their numbers where `named`."""
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
    """Set both axes' limits; return the height at which errors below `least` are drawn."""
    above = [p.error for p in points if p.error > least]
    low, high = min(above, default=1.0), max(above, default=1.0)
    margin = max((high / low) ** 0.1, 1.5)
    edge = low / margin**2
    axes.set_ylim(edge / 1.5 if len(above) < len(points) else low / margin, high * margin)
    times = [p.time for p in points] + ([reference] if reference else [])
    spread = max((max(times) / min(times)) ** 0.08, 1.4)
    axes.set_xlim(min(times) / spread, max(times) * spread)
    return edge
