"""The plane of run time and error: markers, lines and limits of methods."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from reports.figures.plotting import Style, family_style, log_axis, power_text, style
from reports.finished_run import ReportedMethod, Run
from reports.statistics.pareto import Point, front

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SOLVERS = Style("Solvers stopped early", "#A3324B", "X")
STARTED = "warm-started"  # role of solvers that start from another method
OF_REFERENCE = "reference-variant"  # role of methods that only say how the reference depends on its options


@dataclass(frozen=True)
class Curve:
    """Points that a line joins in their order, a method alone where there is one.

    look: of its line and its entry in the legend. aside: points of its kind that lie off the line.
    """

    points: Sequence[Point]
    look: Style
    aside: Sequence[Point] = ()


def curves_of(run: Run, points: Iterable[Point]) -> list[Curve]:
    """Return a curve for each family of networks and baselines, and one for solvers stopped early.

    A curve of solvers joins the best at each run time; the others lie aside. So do those that start from one
    and the same method. Variants of the reference are left out.
    """
    points = list(points)
    shown = [p for p in points if run.methods[p.method].role != OF_REFERENCE] or points
    solvers = [point for point in shown if _is_solver(run.methods[point.method])]
    alone = [point for point in shown if point not in solvers]
    curves = [_family(run, members) for members in _grouped(run, alone, lambda method: method.family)]
    for members in _grouped(run, solvers, lambda method: method.base):
        best, look = front(members), SOLVERS
        if base := run.methods[members[0].method].base:
            look = family_style(run, run.methods[members[0].method])
            look = replace(look, label=f"{run.label(base)} + solver", line=":")
        curves.append(Curve(best, look, [point for point in members if point not in best]))
    return curves


def _family(run: Run, members: list[Point]) -> Curve:
    """Return the curve of methods that differ by one number, in order of it, or of one method alone."""
    method = run.methods[members[0].method]
    if method.level is None:
        return Curve(members, style(run, method.name))
    members.sort(key=lambda point: run.methods[point.method].level or 0.0)
    levels = dict.fromkeys(power_text(run.methods[p.method].level or 0.0) for p in (members[0], members[-1]))
    look = family_style(run, method)
    return Curve(members, replace(look, label=f"{look.label}, {' to '.join(levels)}"))


def _is_solver(method: ReportedMethod) -> bool:
    return method.level is not None and method.role in ("solver", STARTED)


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
MARKER, SMALL = 5.5, 3.5  # sizes of markers [points]


@dataclass(frozen=True)
class Drawn:
    """Content of a panel.

    below: methods whose error is too small for the panel. entries: of its legend. band: whether the band of
    what is inconclusive is in sight.
    """

    below: set[str]
    entries: list[Style]
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
    for curve in curves:
        for point in (*curve.points, *curve.aside):
            look = style(run, point.method)
            pale = point in curve.aside
            colour = GREY if point.error < band else curve.look.colour
            _draw_marker(axes, point, look.marker, colour, edge if point.error <= least else None,
                         SMALL if pale else MARKER, pale)  # fmt: skip
        heights = [point.error if point.error > least else edge for point in curve.points]
        times = [point.time for point in curve.points]
        axes.plot(times, heights, color=curve.look.colour, linestyle=curve.look.line, linewidth=1.1, zorder=2)
    entries = [curve.look for curve in curves]
    if band:
        axes.axhspan(edge / 10.0, band, color=BAND, zorder=0)
    if reference:
        axes.axvline(reference, color="black", linestyle=":", linewidth=1.0)
        entries.append(Style(run.label(run.reference), "black", "", ":"))
    log_axis(axes, "x")
    log_axis(axes, "y")
    return Drawn({p.method for p in points if p.error <= least}, entries, band > axes.get_ylim()[0])


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
