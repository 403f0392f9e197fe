"""The plane of run time and error: markers and lines of methods, and labels that cover nothing."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from reports.figures.plotting import Style, family_style, log_axis, power_text, style
from reports.finished_run import ReportedMethod, Run
from reports.statistics.pareto import Point, front

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

DISTANCES = (5.0, 9.0, 14.0, 20.0, 28.0, 38.0, 50.0)  # [points] from the spot, in order of preference
NEAR = 10.0  # [points] from which on a thin line leads to the spot
# Directions in order of preference: right, left, above, below, then between them.
DIRECTIONS = ((1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (1, -1), (-1, 1), (-1, -1))
# Cost of an area [square pixel] shared with another label, a marker or line, and the outside of the axes.
ON_LABEL, ON_MARK, OUTSIDE = 12.0, 6.0, 12.0
PER_POINT, PER_RANK = 0.7, 0.4  # of a point of distance and of a less preferred direction [pixel of height]
LETTERS = 7.5  # size of labels [points]
SKIPPED = 0.3  # share of a leading line at its spot, which lies in a marker


@dataclass(frozen=True)
class Label:
    """A text, the spot that it names in data coordinates, and its colour."""

    text: str
    spot: tuple[float, float]
    colour: str


def place_labels(axes: Axes, labels: Sequence[Label], marks: np.ndarray) -> None:
    """Write labels beside their spots, the first ones first.

    Call it when limits, scales and all other content of the figure are set and `fit` has placed it.

    Args:
        axes: of the spots.
        labels: what to write.
        marks: (N,4) boxes of markers and lines that labels should not cover, see `boxes_of`.
    """
    from matplotlib.patheffects import withStroke

    pixels = _figure_of(axes).dpi / 72.0
    extent = axes.get_window_extent()
    frame = np.array([[extent.x0, extent.y0, extent.x1, extent.y1]])
    taken = np.empty((0, 4))
    for label in labels:
        spot = axes.transData.transform(label.spot)
        text = axes.annotate(
            label.text, label.spot, textcoords="offset points", xytext=(0, 0), fontsize=LETTERS,
            color=label.colour, zorder=5, annotation_clip=False, va="bottom",
            path_effects=[withStroke(linewidth=1.5, foreground="white")],
        )  # fmt: skip
        text.set_in_layout(False)
        letters = text.get_window_extent()
        places = _places(spot, letters.width, letters.height, pixels)
        costs = [cost * letters.height + _cost(box, lead, frame, taken, marks) for box, lead, cost in places]
        place = int(np.argmin(costs))
        box, lead, _ = places[place]
        text.set_position(tuple((box[:2] - spot) / pixels))
        taken = np.vstack([taken, box[None], lead])
        if len(lead):
            end = np.clip(spot, box[:2], box[2:])
            x, y = axes.transData.inverted().transform(end)
            axes.plot([label.spot[0], x], [label.spot[1], y], color=label.colour, linewidth=0.5, zorder=2.5)


def _places(
    spot: np.ndarray, width: float, height: float, pixels: float
) -> list[tuple[np.ndarray, np.ndarray, float]]:
    """Return places of a label around its spot [pixel].

    Returns:
        For each place the box (4,) of the label, boxes (N,4) along the line that leads to it, none where it
        is close, and what its distance and direction cost.
    """
    places = []
    for rank, (across, up) in enumerate(DIRECTIONS):
        for distance in DISTANCES:
            step = distance * pixels / math.hypot(across, up)
            left = spot[0] + across * step + (-width, -width / 2, 0.0)[across + 1]
            bottom = spot[1] + up * step + (-height, -height / 2, 0.0)[up + 1]
            box = np.array([left, bottom, left + width, bottom + height])
            lead = np.empty((0, 4))
            if distance > NEAR:
                end = np.clip(spot, box[:2], box[2:])
                lead = _along(np.array([spot + (end - spot) * SKIPPED, end]), pixels)
            places.append((box, lead, PER_POINT * distance + PER_RANK * rank))
    return places


def _cost(
    box: np.ndarray, lead: np.ndarray, frame: np.ndarray, taken: np.ndarray, marks: np.ndarray
) -> float:
    """Return what a place of a label costs: for all that it covers and that its leading line crosses."""
    width, height = box[2:] - box[:2]
    covered = ON_LABEL * _shared(box, taken) + ON_MARK * _shared(box, marks)
    crossed = sum(ON_LABEL * _shared(piece, taken) + ON_MARK * _shared(piece, marks) for piece in lead)
    return covered + crossed + OUTSIDE * (width * height - _shared(box, frame))


def boxes_of(axes: Axes, points: np.ndarray, size: float) -> np.ndarray:
    """Return boxes (N,4) [pixel] of markers of that size [points] at points (N,2) in data coordinates."""
    return _around(axes.transData.transform(points), size * _figure_of(axes).dpi / 72.0)


def boxes_along(axes: Axes, points: np.ndarray, size: float) -> np.ndarray:
    """Return boxes (N,4) [pixel] of a line of that width [points] through points (N,2), as `boxes_of`."""
    return _along(axes.transData.transform(points), size * _figure_of(axes).dpi / 72.0)


def _along(corners: np.ndarray, width: float) -> np.ndarray:
    """Return boxes (N,4) of a line of that width through corners (M,2), all in pixels, gaps between them."""
    pieces = [
        start + (end - start) * np.arange(0.0, 1.0, 2.0 * width / max(math.dist(start, end), width))[:, None]
        for start, end in itertools.pairwise(corners)
    ]
    return _around(np.vstack(pieces), width)


def _around(centres: np.ndarray, size: float) -> np.ndarray:
    return np.hstack([centres - size / 2.0, centres + size / 2.0])


def _shared(box: np.ndarray, others: np.ndarray) -> float:
    """Return the area [square pixel] that a box shares with others (N,4), summed."""
    wide = np.minimum(box[2], others[:, 2]) - np.maximum(box[0], others[:, 0])
    high = np.minimum(box[3], others[:, 3]) - np.maximum(box[1], others[:, 1])
    return float(np.sum(np.clip(wide, 0.0, None) * np.clip(high, 0.0, None)))


def _figure_of(axes: Axes) -> Figure:
    figure = axes.get_figure(root=True)
    assert figure is not None
    return figure


SOLVERS = Style("Solvers stopped early", "#A3324B", "X")
STARTED = ("warm-started",)  # role of solvers that start from another method
OF_REFERENCE = (
    "reference-variant",
)  # role of methods that only say how the reference depends on its options


@dataclass(frozen=True)
class Curve:
    """Points that a line joins in their order, a method alone where there is one.

    ends: label of its first and of its last point. look: of its line, and of its markers unless the marker is
    each method's own. aside: points of its kind that lie off the line.
    """

    points: Sequence[Point]
    ends: tuple[str, str]
    look: Style
    aside: Sequence[Point] = ()


def families(run: Run, points: Iterable[Point]) -> list[Curve]:
    """Return a curve for each family, in order of its level, and one for each method that has no level."""
    curves = []
    for members in _grouped(run, points, lambda method: method.family):
        method = run.methods[members[0].method]
        if method.level is None:
            curves.append(Curve(members, (run.label(method.name), ""), style(run, method.name)))
            continue
        members.sort(key=lambda point: run.methods[point.method].level or 0.0)
        look = family_style(run, method)
        first, last = (power_text(run.methods[members[end].method].level or 0.0) for end in (0, -1))
        ends = (f"{look.label}, {first}", last if len(members) > 1 else "")
        curves.append(Curve(members, ends, look))
    return curves


def of_page_one(run: Run, points: Iterable[Point]) -> list[Curve]:
    """Return the curves of page one: each network and baseline, and solvers stopped early as one curve.

    A curve of solvers joins the best at each run time; the others lie aside. So do those that start from one
    and the same method. Variants of the reference are left out.
    """
    points = list(points)
    shown = [p for p in points if run.methods[p.method].role not in OF_REFERENCE] or points
    solvers = [point for point in shown if _solver(run.methods[point.method])]
    curves = families(run, [point for point in shown if point not in solvers])
    for members in _grouped(run, solvers, lambda method: method.base):
        best = front(members)
        base = run.methods[members[0].method].base
        look = replace(family_style(run, run.methods[best[0].method]), line=":") if base else SOLVERS
        first, last = (run.label(best[end].method) for end in (0, -1))
        first = first if base or len(best) == 1 else f"{SOLVERS.label}: {first}"
        aside = [point for point in members if point not in best]
        curves.append(Curve(best, (first, last if len(best) > 1 else ""), look, aside))
    return curves


def _solver(method: ReportedMethod) -> bool:
    return method.level is not None and method.role in ("solver", *STARTED)


def _grouped(
    run: Run, points: Iterable[Point], key: Callable[[ReportedMethod], str]
) -> Iterator[list[Point]]:
    """Yield the points of methods that share a key, in the order of their first."""
    groups: dict[str, list[Point]] = {}
    for point in points:
        groups.setdefault(key(run.methods[point.method]), []).append(point)
    yield from groups.values()


DECADES = 9  # below the largest error; what is smaller is drawn on the lower edge
GREY, FRONT, BAND = "#B4B4B4", "#DCDCDC", "#F0F0F0"
NEAR_POINTS = 1.6  # times another's time and error: two labels beside them would cover each other
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


def draw_points(axes: Axes, run: Run, curves: Sequence[Curve], reference: float | None, band: float) -> Drawn:
    """Draw the curves of one panel.

    Args:
        axes: of the panel.
        run: has the styles of methods.
        curves: what is drawn.
        reference: run time of the reference [ms per frame], None where unknown.
        band: error below which differences are inconclusive.
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
                         SMALL if pale else MARKER, pale)  # fmt: skip
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


def write_labels(axes: Axes, drawn: Drawn) -> None:
    """Write the labels of a panel once the figure is laid out, see `place_labels`."""
    marks = [boxes_of(axes, line, MARKER + 1.0) for line in drawn.lines]
    marks += [boxes_along(axes, line, 1.5) for line in drawn.lines if len(line) > 1]
    place_labels(axes, drawn.labels, np.vstack(marks))


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
    if max(times) < NEAR_POINTS * min(times) and max(heights) < NEAR_POINTS * min(heights):
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
