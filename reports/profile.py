"""Performance profiles: on what share of the scenes does a family of methods reach an error, how fast."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from reports.data import Run
from reports.pareto import Point, fastest, of_one_problem, points_of
from reports.plotting import PAGE_WIDTH, Picture, grid, legend_above, new_figure, power_text, save
from reports.styles import family_style

METRIC = "gap/relative"
TARGETS = (1e-1, 1e-2, 1e-4)
LONGEST = 1e3  # times the fastest: the right edge


def performance_profile(folder: Path, run: Run) -> list[Picture]:
    """One figure (Dolan and More 2002): a panel for each error to be reached, a staircase per family.

    Scenes on which nobody reaches an error do not count for its panel.
    """
    scenes = list(dict.fromkeys(run.suite("speed")["scene"]))
    reached = {target: times_to_reach(run, scenes, target) for target in TARGETS}
    panels = {target: times for target, times in reached.items() if len(times) > 1}
    if not panels:
        return []
    looks = {method.family: family_style(run, method) for method in run.methods.values()}
    figure = new_figure(PAGE_WIDTH, 2.3)
    shown: set[str] = set()
    for axes, (target, times) in zip(np.atleast_1d(figure.subplots(1, len(panels))), panels.items()):
        for family, (ratios, shares) in staircases(times).items():
            look = looks[family]
            axes.step(ratios, shares, where="post", color=look.colour, linestyle=look.line, linewidth=1.2)
            axes.plot(ratios[0], shares[0], color=look.colour, marker=look.marker, markersize=4.5)
            shown.add(family)
        axes.set_xscale("log")
        axes.set(xlim=(0.9, LONGEST), ylim=(0.0, 1.04), xlabel="times the fastest method's time")
        axes.set_title(f"gap at most {power_text(target)}, {len(times)} scenes")
        grid(axes)
    figure.axes[0].set_ylabel("share of scenes")
    families = dict.fromkeys(run.methods[name].family for name in run.ordered(run.methods))
    legend_above(figure, [looks[family] for family in families if family in shown], lines=True)
    caption = (
        "Performance profile: the share of scenes on which a family reaches a relative energy gap within so "
        "many times the time of the fastest; a scene that it cannot do counts as not reached."
    )
    return [save(figure, folder, "performance_profile", caption=caption, kind="profile")]


def times_to_reach(run: Run, scenes: Sequence[str], target: float) -> dict[str, dict[str, float]]:
    """scene -> family -> time [ms per frame] of its fastest member with at most that gap."""
    frame = run.cells("speed", "garments")
    found: dict[str, dict[str, float]] = {}
    for scene in scenes:
        families: dict[str, list[Point]] = {}
        for point in of_one_problem(run, points_of(run, frame, [scene], METRIC)):
            families.setdefault(run.methods[point.method].family, []).append(point)
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
