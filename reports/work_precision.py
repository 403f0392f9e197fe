"""Error against run time: solvers, networks and baselines on one plot."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.results import Row
from reports import palette
from reports.canvas import PAGE_WIDTH, Picture, file_name, grid, legend_above, log_axis, new_figure, save
from reports.numbers import number
from reports.summary import Measurements, dressed_scenes, excess_energy, speed_measurements

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ERRORS = (
    ("curvature/error", "mean-curvature error [1/m]"),
    ("gap/relative", "relative energy gap"),
    ("excess", "energy above simulation [J]"),
)


def _error(measured: Measurements, scene: str, method: str, error: str) -> float | None:
    if method == palette.REFERENCE:
        return None
    if error == "excess":
        return excess_energy(measured, scene, method)
    return measured.value(method, error, [scene])


def error_against_time(folder: Path, rows: Sequence[Row]) -> list[Picture]:
    """One figure per scene: a panel per error measure, a marker per method, cut solvers joined by a line.

    Dressed bodies come first, and of those the one on which most methods ran.
    """
    measured = speed_measurements(rows)
    dressed = dressed_scenes(measured)
    ran = {
        s: sum(bool(measured.seeds(s, m, "cost/frame")) for m in measured.methods) for s in measured.scenes
    }
    pictures = []
    for scene in sorted(measured.scenes, key=lambda scene: (scene not in dressed, -ran[scene])):
        times = {m: measured.value(m, "cost/frame", [scene]) for m in measured.methods}
        points: dict[str, dict[str, tuple[float, float]]] = {}
        for key, _ in ERRORS:
            for method, time in times.items():
                error = _error(measured, scene, method, key)
                if time is not None and time > 0.0 and error is not None:
                    points.setdefault(key, {})[method] = (time, error)
        if sum(len(found) for found in points.values()) >= 2:
            section = "speed" if any(r.suite == "speed" and r.scene == scene for r in rows) else "garments"
            pictures.append(
                _draw_error_against_time(folder, scene, points, times.get(palette.REFERENCE), section)
            )
    return pictures


def _draw_error_against_time(
    folder: Path,
    scene: str,
    points: dict[str, dict[str, tuple[float, float]]],
    reference_time: float | None,
    section: str,
) -> Picture:
    panels = [(key, title) for key, title in ERRORS if key in points]
    methods = palette.ordered(method for found in points.values() for method in found)
    families = {cut[0] for method in methods if (cut := palette.family_of(method))}
    named = [m for m in methods if not palette.family_of(m)] + palette.ordered(families)
    figure = new_figure(PAGE_WIDTH if len(panels) > 1 else PAGE_WIDTH * 0.6, 2.5 if len(panels) > 1 else 2.8)
    below: set[str] = set()
    for axes, (key, title) in zip(np.atleast_1d(figure.subplots(1, len(panels))), panels):
        below |= _draw_points(axes, points[key], reference_time)
        axes.set(xlabel="run time [ms per frame]", title=title)
        grid(axes)
    if reference_time:
        named = [palette.REFERENCE, *named]
    legend_above(figure, named, lines=False)
    caption = f"{scene}: error against run time, both logarithmic; lower left is better."
    if families:
        caption += " The number beside a marker counts the iterations after which the solver was cut."
    if reference_time:
        caption += f" Dotted line: the converged simulation, {number(reference_time)} ms."
    if below:
        names = ", ".join(palette.label(m) for m in palette.ordered(below))
        caption += f" Hollow, on the lower edge: zero or below the simulation ({names})."
    name = f"error_against_time_{file_name(scene)}"
    return save(figure, folder, name, caption=caption, section=section, kind="speed")


def _draw_points(
    axes: Axes, points: dict[str, tuple[float, float]], reference_time: float | None
) -> set[str]:
    """The markers of one panel; returns the methods whose error is zero or negative."""
    above = {m: p for m, p in points.items() if p[1] > 0.0}
    low = min((p[1] for p in above.values()), default=1.0)
    high = max((p[1] for p in above.values()), default=1.0)
    margin = max((high / low) ** 0.12, 1.6)
    floor = low / margin**2
    axes.set_ylim(floor / 1.5 if len(above) < len(points) else low / margin, high * margin)
    families: dict[str, list[tuple[int, float, float]]] = {}
    for method, (time, error) in points.items():
        look = palette.style(method)
        hollow = error <= 0.0
        shown = floor if hollow else error
        axes.plot(
            time,
            shown,
            marker=look.marker,
            color=look.colour,
            markerfacecolor="white" if hollow else look.colour,
            markersize=6.5,
            linestyle="none",
            zorder=3,
        )
        if cut := palette.family_of(method):
            families.setdefault(cut[0], []).append((cut[1], time, shown))
    for name, cuts in families.items():
        cuts.sort()
        colour = palette.style(name).colour
        axes.plot([c[1] for c in cuts], [c[2] for c in cuts], color=colour, linewidth=1.0, zorder=2)
        for count, time, shown in cuts:
            axes.annotate(
                str(count), (time, shown), (4, 4), textcoords="offset points", fontsize=7.5, color=colour
            )
    if reference_time:
        axes.axvline(reference_time, color="black", linestyle=":", linewidth=1.0)
    times = [p[0] for p in points.values()] + ([reference_time] if reference_time else [])
    spread = max((max(times) / min(times)) ** 0.1, 1.5)
    axes.set_xlim(min(times) / spread, max(times) * spread)
    log_axis(axes, "x")
    log_axis(axes, "y")
    return set(points) - set(above)
