"""Distributions over vertices: mean curvature and change of area in one roll-out, a line per method."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

import numpy as np

from reports.figures.chosen_roll_outs import long_motion
from reports.figures.figure import Drawing
from reports.figures.method_styles import few, style
from reports.figures.plotting import fit, log_axis, new_panels
from reports.run.finished_run import Run
from reports.statistics.vertex_values import area_change, mean_curvature

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas

    from reference_sim.trajectory import Trajectory

EVERY = 3  # of a roll-out's frames
RARE = 0.01  # [%] the lowest share that is shown


def histograms(run: Run) -> Iterator[Drawing]:
    """Draw histograms of the methods that came to the end of the motion shown at length."""
    if motion := long_motion(run):
        roll_outs = motion.roll_outs
        series = {method: roll_outs.series[method] for method in motion.whole}
        caption = f"{roll_outs.scene}: of all vertices, in one frame of {EVERY}."
        yield Drawing(draw_histograms(run, series, roll_outs.rest), "histograms", caption)


def draw_histograms(run: Run, series: Mapping[str, Trajectory], rest: np.ndarray | None) -> Canvas:
    """Draw a panel of curvature, and one of area where its rest areas (F,) [m^2] are known."""
    methods = few(run, series)
    frames = min(series[method].frames for method in methods)
    some = {m: series[m].positions[frames // 5 : frames : EVERY] for m in methods}
    panels = {"mean curvature [1/m]": {m: mean_curvature(x, series[m].faces) for m, x in some.items()}}
    if rest is not None and all(len(series[m].faces) == len(rest) for m in methods):
        panels["change of area [%]"] = {m: area_change(x, series[m].faces, rest) for m, x in some.items()}
    figure, every = new_panels(len(panels), 2)
    for axes, (title, values) in zip(every, panels.items()):
        ends = [np.percentile(of_method, (1.0, 98.0)) for of_method in values.values()]
        low, high = min(end[0] for end in ends), max(end[1] for end in ends)
        edges = np.linspace(low, max(high, low + 1e-9), 41)
        for method in reversed(methods):
            share = 100.0 * np.histogram(values[method], edges)[0] / values[method].size
            middles, look = 0.5 * (edges[1:] + edges[:-1]), style(run, method)
            axes.plot(middles, np.maximum(share, RARE), color=look.colour, linestyle=look.line)
        axes.set(xlabel=title, ylabel="share of vertices [%]", ylim=(RARE, None))
        log_axis(axes, "y")
    fit(figure, [style(run, method) for method in methods])
    return figure
