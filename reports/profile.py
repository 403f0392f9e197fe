"""Performance profiles: on what share of the scenes does a family of methods reach an error, how fast."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from benchmarks.results import Row
from reports import palette
from reports.canvas import PAGE_WIDTH, Picture, grid, legend_above, new_figure, power_text, save
from reports.fronts import Point, fastest, points_of
from reports.summary import Measurements, speed_measurements, suite_rows

METRIC = "gap/relative"
TARGETS = (1e-1, 1e-2, 1e-4)
LONGEST = 1e3  # times the fastest: the right edge


def performance_profile(folder: Path, rows: Sequence[Row]) -> list[Picture]:
    """One figure (Dolan and More 2002): a panel for each error to be reached, a staircase per family.

    Scenes on which nobody reaches an error do not count for its panel.
    """
    measured = speed_measurements(rows)
    scenes = list(dict.fromkeys(row.scene for row in suite_rows(rows, "speed")))
    reached = {target: times_to_reach(measured, scenes, target) for target in TARGETS}
    panels = {target: times for target, times in reached.items() if len(times) > 1}
    if not panels:
        return []
    figure = new_figure(PAGE_WIDTH, 2.9)
    shown: set[str] = set()
    for axes, (target, times) in zip(np.atleast_1d(figure.subplots(1, len(panels))), panels.items()):
        for family, (ratios, shares) in staircases(times).items():
            look = palette.family_style(family) if family not in measured.methods else palette.style(family)
            axes.step(ratios, shares, where="post", color=look.colour, linestyle=look.line, linewidth=1.2)
            axes.plot(ratios[0], shares[0], color=look.colour, marker=look.marker, markersize=4.5)
            shown.add(family)
        axes.set_xscale("log")
        axes.set(xlim=(0.9, LONGEST), ylim=(0.0, 1.04), xlabel="times the fastest method's time")
        axes.set_title(f"gap at most {power_text(target)}, {len(times)} scenes")
        grid(axes)
    figure.axes[0].set_ylabel("share of scenes")
    legend_above(figure, palette.ordered(shown), lines=True)
    caption = "Performance profile: the share of scenes on which a method, cut where it is fastest, reaches "
    caption += "a relative energy gap within so many times the time of the fastest. A method that never gets "
    caption += "there has no line; networks and what starts from a body run on dressed bodies alone."
    return [save(figure, folder, "performance_profile", caption=caption, section="speed", kind="profile")]


def times_to_reach(
    measured: Measurements, scenes: Sequence[str], target: float
) -> dict[str, dict[str, float]]:
    """scene -> family -> time [ms per frame] of its fastest member with at most that gap."""
    found: dict[str, dict[str, float]] = {}
    for scene in scenes:
        families: dict[str, list[Point]] = {}
        for point in points_of(measured, [scene], METRIC):
            cut = palette.cut_of(point.method)
            if point.method != palette.MOVED and (cut is None or cut.family != "simulation-dt"):
                families.setdefault(cut.family if cut else point.method, []).append(point)
        times = {name: best.time for name, points in families.items() if (best := fastest(points, target))}
        if times:
            found[scene] = times
    return found


def staircases(times: dict[str, dict[str, float]]) -> dict[str, tuple[list[float], list[float]]]:
    """family -> ratios to the fastest, ascending, and the share of scenes solved within each of them."""
    ratios: dict[str, list[float]] = {}
    for families in times.values():
        least = min(families.values())
        for family, time in families.items():
            ratios.setdefault(family, []).append(time / least)
    stairs = {}
    for family, found in ratios.items():
        found.sort()
        shares = [(k + 1) / len(times) for k in range(len(found))]
        stairs[family] = ([*found, LONGEST], [*shares, shares[-1]])
    return stairs
