"""Energies frame by frame: strain, bending and inertia of one motion, a curve per method."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from reports.figures.chosen_roll_outs import SceneRollOuts, long_motion
from reports.figures.figure import Drawing
from reports.figures.method_styles import leading, style
from reports.figures.plotting import PAGE_WIDTH, file_name, grid, legend_above, log_axis, new_figure
from reports.run.finished_run import Run

if TYPE_CHECKING:
    from matplotlib.axes import Axes

TERMS = ("strain", "bending", "inertia")


def energy_series(run: Run) -> Iterator[Drawing]:
    """Draw a panel for each term of the motion shown at length, a curve per method (the paper's figure 4)."""
    motion = long_motion(run)
    curves = _curves(run, motion.roll_outs) if motion else {}
    if not motion or not curves:
        return
    roll_outs = motion.roll_outs
    series = roll_outs.series
    methods = leading(run, {method for of_term in curves.values() for method in of_term})
    figure = new_figure(PAGE_WIDTH, 2.35)
    panels = np.atleast_1d(figure.subplots(1, len(curves)))
    for axes, (term, of_term) in zip(panels, curves.items()):
        for method in reversed([m for m in methods if m in of_term]):  # the reference last, on top
            look, energy = style(run, method), of_term[method]
            shown = np.where(np.isfinite(energy) & (energy > 0.0), energy, np.nan)
            axes.plot(series[method].times, shown, color=look.colour, linestyle=look.line)
        _log_energy_axis(axes)
        axes.set(title=term.capitalize(), xlabel="time [s]")
        grid(axes)
    panels[0].set_ylabel("energy [J]")
    legend_above(figure, [style(run, method) for method in methods])
    scene = roll_outs.scene
    caption = f"{scene}: energy of each frame by term, logarithmic. A frame with no energy at all is a gap."
    yield Drawing(figure, f"energy_series_{file_name(scene)}", caption)


def _curves(run: Run, roll_outs: SceneRollOuts) -> dict[str, dict[str, np.ndarray]]:
    """Return term -> method -> energy of each frame (T,) [J], where there is any."""
    curves = {
        term: {
            method: cloth.frame_fields[f"energy/{term}"]
            for method, cloth in roll_outs.series.items()
            if f"energy/{term}" in cloth.frame_fields
        }
        for term in TERMS
    }
    shown = {term: of_term for term, of_term in curves.items() if of_term}
    return shown if leading(run, {method for of_term in shown.values() for method in of_term}) else {}


def _log_energy_axis(axes: Axes) -> None:
    """Make the axis logarithmic, cut four decades below the top: frames at rest would squeeze it."""
    values = np.concatenate([np.asarray(line.get_ydata(), dtype=float) for line in axes.get_lines()])
    values = values[np.isfinite(values)]
    if len(values):
        top = float(values.max())
        axes.set_ylim(max(float(values.min()) / 1.5, top * 1e-4), top * 1.6)
        log_axis(axes, "y")
