"""Break-even of trainings: total time of N frames for each trained network and its rival solvers."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator

import numpy as np

from reports.figures.figure import Drawing
from reports.figures.method_styles import few, style
from reports.figures.plotting import fit, log_axis, new_panels
from reports.run.finished_run import Run
from reports.statistics.break_even import compared_costs, compared_scenes, crossing, rivals

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
