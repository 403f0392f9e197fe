"""Figures of run time: error against run time, and break-even of trainings."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence

import numpy as np
import pandas as pd

from benchmarks.metric import Metric
from reports.figures.figure import Drawing
from reports.figures.plane import SOLVERS, draw_points, of_page_one, write_labels
from reports.figures.plotting import few, fit, log_axis, new_panels, style
from reports.run.finished_run import Run
from reports.statistics.means_and_spreads import value_of
from reports.statistics.pareto import (
    ERRORS,
    Point,
    compared_cells,
    compared_costs,
    compared_scenes,
    crossing,
    error_points,
    indistinct,
    rivals,
    run_time,
    time_label,
)


def error_of_page_one(run: Run) -> Iterator[Drawing]:
    """Draw an error of the leading scene in one wide panel: the first that two methods or more have."""
    frame, scenes = compared_cells(run)
    for scene in scenes:
        rows = frame[frame["scene"] == scene]
        for name in ERRORS:
            points = error_points(run, rows, name)
            if len(points) > 1:
                yield _draw_page_one(run, rows, run.metrics[name], points)
                return


def _draw_page_one(run: Run, rows: pd.DataFrame, metric: Metric, points: Sequence[Point]) -> Drawing:
    """Draw one error of a scene in a wide panel, solvers stopped early as one curve."""
    time = run_time(rows)
    figure, (axes,) = new_panels(1)
    curves = of_page_one(run, points)
    reference = value_of(rows, run.reference, time)
    drawn = draw_points(axes, run, curves, reference, indistinct(run, rows, metric.name))
    axes.set(xlabel=time_label(time), ylabel=metric.heading)
    fit(figure)
    write_labels(axes, drawn)
    caption = f"{rows['scene'].iloc[0]}: lower left is better. Pale line: the best at each time."
    if any(curve.aside for curve in curves):
        caption += f" {SOLVERS.label} are joined where none is faster and as accurate; the others are faint."
    caption += " Grey: within the reference's uncertainty." if drawn.band else ""
    if drawn.below:
        names = ", ".join(run.label(method) for method in run.ordered(drawn.below))
        caption += f" Hollow, on the lower edge: zero or below the panel ({names})."
    return Drawing(figure, "error_against_time", caption)


MOST_FRAMES = 1e7


def break_even(run: Run) -> Iterator[Drawing]:
    """Draw total time against the number of frames, in the scenes of the first garment with timed solvers.

    Each trained network and each solver has a line; a dot stands where a training has paid.
    """
    frame = run.cells("speed", "garments")
    scenes = next(iter(compared_scenes(run, frame).values()), [])
    trained, others = compared_costs(run, frame, scenes, rivals(run, frame, scenes))
    shown = few(run, (cost.method for cost in trained))
    trained = [cost for cost in trained if cost.method in shown]
    if not trained or len(trained) + len(others) < 2:
        return
    costs = [*others, *trained]
    figure, (axes,) = new_panels(1)
    frames = np.logspace(0, math.log10(MOST_FRAMES), 200)
    for cost in costs:
        look = style(run, cost.method)
        axes.plot(frames, [cost.total(n) for n in frames], color=look.colour, linestyle=look.line)
    for network, rival in itertools.product(trained, others):
        met = crossing(network, rival)
        if met is not None and 1.0 <= met <= MOST_FRAMES:
            colour = style(run, network.method).colour
            axes.plot(met, network.total(met), "o", color=colour, markersize=4.5)
    axes.set(xlabel="frames", ylabel="data, training and frames [s]")
    log_axis(axes, "x")
    log_axis(axes, "y")
    fit(figure, [style(run, m) for m in run.ordered(cost.method for cost in costs)])
    caption = f"Total time against the number of frames ({', '.join(scenes)}). "
    yield Drawing(figure, "break_even", caption + "Dots: where a training has paid.")
