"""Stability maps: for which stiffness and time step a scene's step converges."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

import pandas as pd

from reports.figures.figure import Drawing
from reports.figures.method_styles import STATUS_COLOURS
from reports.figures.plotting import fit, new_panels, power_text
from reports.run.finished_run import Run
from reports.statistics.outcomes import map_points

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FEW, MANY = 2.0, 300.0  # iterations at the ends of the colour scale
PALE, DEEP = (0.90, 0.95, 0.99), (0.03, 0.27, 0.49)


def stability_maps(run: Run) -> Iterator[Drawing]:
    """Draw all maps side by side: a cell per step, coloured by its iterations or by how it failed."""
    rows, points = run.suite("extremes"), map_points(run)
    rows = rows[rows["case"].isin(points)]
    rows = rows.assign(
        factor=rows["case"].map(lambda case: points[case][0]),
        dt=rows["case"].map(lambda case: points[case][1]),
    )
    maps = {str(scene): of_scene for scene, of_scene in rows.groupby("scene", sort=False)}
    if not maps:
        return
    widths = [of_scene["dt"].nunique() for of_scene in maps.values()]
    height = max(of_scene["factor"].nunique() for of_scene in maps.values())
    figure, panels = new_panels(len(maps), len(maps), width_ratios=widths)
    for axes, (scene, of_scene) in zip(panels, maps.items()):
        _panel(axes, of_scene)
        axes.grid(False)
        axes.set_title(scene.replace("_", " "))
    panels[0].set_ylabel("stiffness, as a multiple of cotton's")
    fit(figure, height=0.27 * height)
    caption = (
        "Stiffness and time step: one step from a noisy start. Blue: converged, with its number of "
        "iterations, deeper for more. Other colours: not converged, by how it ended; "
        "a cross: a false claim, a crash or a hang."
    )
    yield Drawing(figure, "stability_maps", caption)


def _panel(axes: Axes, rows: pd.DataFrame) -> None:
    factors, steps = sorted(set(rows["factor"])), sorted(set(rows["dt"]))
    for row in rows.itertuples():
        _cell(axes, steps.index(row.dt), factors.index(row.factor), str(row.status), float(row.value))  # type: ignore[arg-type]
    axes.set_xlim(-0.5, len(steps) - 0.5)
    axes.set_ylim(-0.5, len(factors) - 0.5)
    axes.set_xticks(range(len(steps)), [power_text(dt) for dt in steps])
    axes.set_yticks(range(len(factors)), [power_text(factor) for factor in factors])
    axes.set_xlabel("time step [s]")
    axes.tick_params(length=0)
    for spine in axes.spines.values():
        spine.set_visible(False)


def _cell(axes: Axes, column: int, line: int, status: str, iterations: float) -> None:
    """Draw a filled cell with the iterations, or with the word for how the step ended."""
    from matplotlib.patches import Rectangle

    converged = status == "ok"
    colour = shade(iterations) if converged else STATUS_COLOURS[status]
    axes.add_patch(Rectangle((column - 0.48, line - 0.46), 0.96, 0.92, facecolor=colour, linewidth=0))
    word = f"{iterations:.0f}" if converged else "✕" if status == "failed" else status
    text = axes.text(column, line, word, ha="center", va="center", fontsize=7.5)
    text.set_color("white" if not converged or iterations > 40.0 else "#222222")


def shade(iterations: float) -> tuple[float, float, float]:
    """Return a colour from pale to deep blue, by the logarithm of the iterations."""
    place = min(math.log(max(iterations, FEW) / FEW) / math.log(MANY / FEW), 1.0)
    red, green, blue = (a + place * (b - a) for a, b in zip(PALE, DEEP))
    return red, green, blue
