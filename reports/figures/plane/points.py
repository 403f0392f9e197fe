"""Markers and lines of methods in the plane of run time and error, and the labels that go with them."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from reports.figures.method_styles import style
from reports.figures.plane.curves import Curve
from reports.figures.plane.labels import Label, boxes_along, boxes_of, place_labels
from reports.figures.plotting import log_axis
from reports.run.finished_run import Run
from reports.statistics.pareto import Point, front

if TYPE_CHECKING:
    from matplotlib.axes import Axes

DECADES = 9  # below the largest error; what is smaller is drawn on the lower edge
GREY, FRONT, BAND = "#B4B4B4", "#DCDCDC", "#F0F0F0"
NEAR = 1.6  # times another's time and error: two labels beside them would cover each other
MARKER, SMALL = 5.5, 3.5  # sizes of markers [points]


@dataclass(frozen=True)
class Drawn:
    """Content of a panel, in data coordinates.

    below: methods whose error is too small for the panel. labels: what its curves are called, the first ones
    to be placed first. lines: points (N,2) of each curve, also of one that has a single point. band: whether
    the band of what is inconclusive is in sight.
    """

    below: set[str]
    labels: list[Label]
    lines: list[np.ndarray]
    band: bool


def draw_points(
    axes: Axes, run: Run, curves: Sequence[Curve], reference: float | None, band: float, small: bool = False
) -> Drawn:
    """Draw the curves of one panel.

    Args:
        axes: of the panel.
        run: has the styles of methods.
        curves: what is drawn.
        reference: run time of the reference [ms per frame], None where unknown.
        band: error below which differences are inconclusive.
        small: whether the panel is one of many.
    """
    points = [point for curve in curves for point in (*curve.points, *curve.aside)]
    # An error that cannot be told from the reference needs no decades of its own.
    least = max(max((p.error for p in points), default=1.0) * 10.0**-DECADES, band / 10.0)
    edge = _limits(axes, points, reference, least)
    best = front(p for p in points if p.error > least)
    if len(best) > 1:
        axes.plot([p.time for p in best], [p.error for p in best], color=FRONT, linewidth=5.0, zorder=1)
    lines, labels = [], []
    for curve in curves:
        for point in (*curve.points, *curve.aside):
            look = style(run, point.method)
            pale = point in curve.aside
            colour = GREY if point.error < band else curve.look.colour
            _draw_marker(axes, point, look.marker, colour, edge if point.error <= least else None,
                         SMALL if small or pale else MARKER, pale)  # fmt: skip
        heights = [point.error if point.error > least else edge for point in curve.points]
        lines.append(np.column_stack([[point.time for point in curve.points], heights]))
        axes.plot(*lines[-1].T, color=curve.look.colour, linestyle=curve.look.line, linewidth=1.1, zorder=2)
        lines += [np.array([[p.time, max(p.error, edge)]]) for p in curve.aside]
        labels += _labels(curve, heights)
    if band:
        axes.axhspan(edge / 10.0, band, color=BAND, zorder=0)
    if reference:
        axes.axvline(reference, color="black", linestyle=":", linewidth=1.0)
        low, high = axes.get_ylim()
        lines.append(np.array([[reference, low], [reference, high]]))
        labels.append(Label(run.label(run.reference), (reference, high / (high / low) ** 0.06), "black"))
    log_axis(axes, "x")
    log_axis(axes, "y")
    in_sight = band > axes.get_ylim()[0]
    return Drawn({p.method for p in points if p.error <= least}, labels, lines, in_sight)


def write_labels(axes: Axes, drawn: Drawn, size: float = 7.5, known: Collection[str] = ()) -> None:
    """Write the labels of a panel once the figure is laid out, see `place_labels`."""
    marks = [boxes_of(axes, line, MARKER + 1.0) for line in drawn.lines]
    marks += [boxes_along(axes, line, 1.5) for line in drawn.lines if len(line) > 1]
    place_labels(axes, drawn.labels, np.vstack(marks), size, known)


def _draw_marker(
    axes: Axes, point: Point, marker: str, colour: str, edge: float | None, size: float, pale: bool
) -> None:
    """Draw a point with its spreads; hollow at the height `edge` where that is given."""
    axes.errorbar(
        point.time,
        point.error if edge is None else edge,
        xerr=[[min(point.time_spread / 2, 0.9 * point.time)], [point.time_spread / 2]],
        yerr=[[min(point.error_spread, 0.9 * abs(point.error))], [point.error_spread]],
        color=colour, marker=marker, markersize=size, linestyle="none", elinewidth=0.8,
        zorder=2.2 if pale else 3, alpha=0.45 if pale else 1.0,
        markerfacecolor=colour if edge is None else "white",
    )  # fmt: skip


def _labels(curve: Curve, heights: Sequence[float]) -> list[Label]:
    """Return the labels of a curve's ends; one where they lie so close that two would cover each other."""
    times = [point.time for point in curve.points]
    first, last = ((times[end], heights[end]) for end in (0, -1))
    colour = curve.look.colour
    if not curve.ends[1]:
        return [Label(curve.ends[0], first, colour)]
    if max(times) < NEAR * min(times) and max(heights) < NEAR * min(heights):
        return [Label(" to ".join(curve.ends), first, colour)]
    return [Label(text, spot, colour) for text, spot in zip(curve.ends, (first, last))]


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
