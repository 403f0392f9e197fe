"""Error against run time: solvers, networks, hybrids and baselines on one plot; or any metric against any."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.results import ResultsError, Row
from reports import palette
from reports.ablations import set_apart
from reports.canvas import PAGE_WIDTH, Picture, file_name, grid, legend_above, log_axis, new_figure, save
from reports.fronts import TIME, Point, front, points_of
from reports.numbers import number
from reports.summary import Measurements, dressed_scenes, speed_measurements

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

ERRORS = (
    ("gap/relative", "relative energy gap"),
    ("curvature/error", "mean-curvature error [1/m]"),
    ("distance/rms", "distance to the simulation [mm]"),
    ("gradient/norm", "gradient left [vertex weights]"),
)
OWN_STEP = ("gap/relative", "gradient/norm")  # of the step's own potential, which another step size changes
DECADES = 9  # below the largest error; what is smaller is drawn on the lower edge
FLOOR = "distance/floor"  # [mm] between two references that began a nanometre apart
GREY = "#B4B4B4"
REFERENCES = (palette.REFERENCE, palette.MOVED)  # whose distance is the floor, not an error


def error_against_time(folder: Path, rows: Sequence[Row]) -> list[Picture]:
    """One figure per scene: a panel per error, a marker per method, members of a family joined by a line.

    Dressed bodies come first, and of those the one on which most methods ran.
    """
    every = speed_measurements(rows)
    apart = set_apart(every, every.scenes, TIME)
    measured = speed_measurements(row for row in rows if row.method not in apart)
    dressed = dressed_scenes(measured)
    ran = {s: sum(bool(measured.seeds(s, m, TIME)) for m in measured.methods) for s in measured.scenes}
    pictures = []
    for scene in sorted(measured.scenes, key=lambda scene: (scene not in dressed, -ran[scene])):
        panels = [
            (metric, title, points)
            for metric, title in ERRORS
            if len(points := _errors(measured, scene, metric)) > 1
        ]
        if panels:
            section = "speed" if any(r.suite == "speed" and r.scene == scene for r in rows) else "garments"
            pictures.append(_draw_errors(folder, measured, scene, panels, section))
    return pictures


def metric_against_metric(
    folder: Path, rows: Sequence[Row], x: str, y: str, scenes: Sequence[str]
) -> Picture | None:
    """One figure of metric y against metric x, means over the scenes; None where fewer than two have both.

    Both axes are logarithmic. Raises ResultsError for an x that is not positive, or a negative y.
    """
    measured = speed_measurements(rows)
    points = points_of(measured, scenes, y, x)
    if len(points) < 2:
        return None
    for point in points:
        if point.time <= 0.0 or point.error < 0.0:
            metric, value = (x, point.time) if point.time <= 0.0 else (y, point.error)
            raise ResultsError(
                f"{metric} of {point.method} is {value:.4g}: it has no place on a logarithmic axis; "
                "name another metric"
            )
    figure = new_figure(PAGE_WIDTH * 0.75, 3.6)
    axes = figure.subplots()
    below = _draw_points(axes, points, None, 0.0)
    units = {m: f"{m} [{measured.units[m]}]" for m in (x, y)}
    axes.set(xlabel=units[x], ylabel=units[y])
    grid(axes)
    _legend(figure, points, None)
    caption = f"{y} against {x}, means over {', '.join(scenes)}.{_hollow(below)}"
    name = file_name(f"{y}_against_{x}")
    return save(figure, folder, name, caption=caption, section="speed", kind="axes")


def _errors(measured: Measurements, scene: str, metric: str) -> list[Point]:
    """The points of one panel. The reference's own error is zero by construction: it is drawn as a line."""
    found = []
    for point in points_of(measured, [scene], metric):
        cut = palette.cut_of(point.method)
        other_problem = cut is not None and cut.family == "simulation-dt" and metric in OWN_STEP
        if point.method not in REFERENCES and point.time > 0.0 and not other_problem:
            found.append(point)
    return found


def _draw_errors(
    folder: Path,
    measured: Measurements,
    scene: str,
    panels: Sequence[tuple[str, str, list[Point]]],
    section: str,
) -> Picture:
    reference = measured.value(palette.REFERENCE, TIME, [scene])
    lines, columns = -(-len(panels) // 2), min(2, len(panels))
    figure = new_figure(PAGE_WIDTH * (1.0 if columns > 1 else 0.6), 0.9 + 2.3 * lines)
    axes_list = np.atleast_1d(figure.subplots(lines, columns)).ravel()
    for axes in axes_list[len(panels) :]:
        axes.set_axis_off()
    below: set[str] = set()
    floor = _floor(measured, scene)
    for axes, (metric, title, points) in zip(axes_list, panels):
        below |= _draw_points(axes, points, reference, floor if metric == "distance/rms" else 0.0)
        axes.set(xlabel="run time [ms per frame]", title=title)
        grid(axes)
    shown = [p for _, _, points in panels for p in points]
    _legend(figure, shown, reference)
    caption = f"{scene}: error against run time, both logarithmic; lower left is better. Pale line: the best "
    caption += "of all methods at each time. Joined markers: one solver cut after more and more iterations, "
    caption += "the first and last number of them beside."
    if reference:
        caption += f" Dotted line: the converged simulation, {number(reference)} ms."
    if any(p.time_spread or p.error_spread for p in shown):
        caption += " Bars: run time, as wide as repeats lie apart (without repeats, two standard deviations "
        caption += "over seeds); error, a standard deviation over seeds up and down."
    if floor:
        caption += f" Grey: under {number(floor)} mm, as far as two simulations that start 1 nm apart drift."
    caption += _hollow(below)
    name = f"error_against_time_{file_name(scene)}"
    return save(figure, folder, name, caption=caption, section=section, kind="speed")


def _hollow(below: set[str]) -> str:
    names = ", ".join(palette.label(m) for m in palette.ordered(below))
    return f" Hollow, on the lower edge: zero or below the panel ({names})." if below else ""


def _floor(measured: Measurements, scene: str) -> float:
    floors = [measured.value(m, FLOOR, [scene]) for m in measured.methods]
    return max((value for value in floors if value is not None), default=0.0)


def _legend(figure: Figure, points: Sequence[Point], reference: float | None) -> None:
    names = []
    for method in palette.ordered(p.method for p in points):
        cut = palette.cut_of(method)
        names.append(cut.family if cut else method)
    legend_above(figure, [*([palette.REFERENCE] if reference else []), *dict.fromkeys(names)], lines=False)


def _draw_points(axes: Axes, points: Sequence[Point], reference: float | None, floor: float) -> set[str]:
    """The markers of one panel; returns the methods whose error is too small for it."""
    least = max((p.error for p in points), default=1.0) * 10.0**-DECADES
    edge = _limits(axes, points, reference, least)
    best = front(p for p in points if p.error > least)
    if len(best) > 1:
        axes.plot([p.time for p in best], [p.error for p in best], color="#DCDCDC", linewidth=5.0, zorder=1)
    families: dict[str, list[tuple[palette.Cut, Point]]] = {}
    for point in points:
        look = palette.style(point.method)
        hollow, grey = point.error <= least, point.error < floor
        colour = GREY if grey else look.colour
        axes.errorbar(
            point.time,
            edge if hollow else point.error,
            xerr=[[min(point.time_spread / 2, 0.9 * point.time)], [point.time_spread / 2]],
            yerr=[[min(point.error_spread, 0.9 * abs(point.error))], [point.error_spread]],
            color=colour, marker=look.marker, markersize=5.5, linestyle="none", elinewidth=0.8, zorder=3,
            markerfacecolor="white" if hollow else colour,
        )  # fmt: skip
        if cut := palette.cut_of(point.method):
            families.setdefault(cut.family, []).append((cut, point))
    for name, members in families.items():
        _join(axes, palette.family_style(name), sorted(members, key=lambda m: m[0].order), least, edge)
    if floor:
        axes.axhspan(edge / 10.0, floor, color="#F4F4F4", zorder=0)
    if reference:
        axes.axvline(reference, color="black", linestyle=":", linewidth=1.0)
    log_axis(axes, "x")
    log_axis(axes, "y")
    return {p.method for p in points if p.error <= least}


def _join(
    axes: Axes,
    look: palette.Style,
    members: Sequence[tuple[palette.Cut, Point]],
    least: float,
    edge: float,
) -> None:
    """The line through a family, its first and last member marked by their numbers."""
    heights = [point.error if point.error > least else edge for _, point in members]
    times = [point.time for _, point in members]
    axes.plot(times, heights, color=look.colour, linestyle=look.line, linewidth=0.9, zorder=2)
    for place in sorted({0, len(members) - 1}):
        spot = (times[place], heights[place])
        text = members[place][0].mark
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
