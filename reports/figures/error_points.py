"""Points of methods in a panel of error against run time: markers, lines of families, legend."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from reports.figures.method_styles import family_style, style
from reports.figures.plotting import legend_above, legend_beside, log_axis, power_text
from reports.run.finished_run import Run
from reports.statistics.pareto import Point, front

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas

DECADES = 9  # below the largest error; what is smaller is drawn on the lower edge
GREY = "#B4B4B4"
NEAR = 1.6  # times another's time and error: two numbers beside them would cover each other


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
