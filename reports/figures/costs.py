"""Figures of run time: error against run time, and break-even of trainings."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from functools import lru_cache

import numpy as np
import pandas as pd

from benchmarks.metric import Metric
from reports.figures.figure import Drawing
from reports.figures.plane import SOLVERS, draw_points, families, of_page_one, write_labels
from reports.figures.plotting import LABELLED, few, file_name, fit, log_axis, new_panels, style, wrapped
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
from reports.tables.table import number

MOST_PANELS, MOST_SCENES = 4, 7  # in the PDF; the page has all
BAND_REMARK = " Grey: within the reference's uncertainty."  # remark of a caption
Scenes = list[tuple[pd.DataFrame, list[tuple[Metric, list[Point]]]]]  # rows and panels of each


def error_of_page_one(run: Run) -> Iterator[Drawing]:
    """Draw the first error of the leading scene in one wide panel."""
    for rows, panels in _scenes(run)[:1]:
        yield _draw_page_one(run, rows, *panels[0])


def errors_of_scene(run: Run) -> Iterator[Drawing]:
    """Draw the errors of the leading scene, where it has more than one."""
    for rows, panels in _scenes(run)[:1]:
        if len(panels) > 1:
            yield _draw_scene(run, rows, panels[:MOST_PANELS])


def errors_of_scenes(run: Run) -> Iterator[Drawing]:
    """Draw the first error of every other scene."""
    if others := _scenes(run)[1:MOST_SCENES]:
        yield _draw_scenes(run, [(rows, panels[0]) for rows, panels in others])


@lru_cache(maxsize=1)
def _scenes(run: Run) -> Scenes:
    """Return rows and panels of each scene, the leading one first."""
    frame, scenes = compared_cells(run)
    shown = []
    for scene in scenes:
        rows = frame[frame["scene"] == scene]
        points = {name: error_points(run, rows, name) for name in ERRORS}
        panels = [(run.metrics[name], of_error) for name, of_error in points.items() if len(of_error) > 1]
        if panels:
            shown.append((rows, panels))
    return shown


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
    caption += (BAND_REMARK if drawn.band else "") + hollow_remark(run, drawn.below)
    return Drawing(figure, "error_against_time", caption)


def _draw_scene(run: Run, rows: pd.DataFrame, panels: Sequence[tuple[Metric, list[Point]]]) -> Drawing:
    """Draw a panel for each error of one scene, every family a line of its own."""
    scene, time = rows["scene"].iloc[0], run_time(rows)
    reference = value_of(rows, run.reference, time)
    figure, every = new_panels(len(panels), 2)
    drawn = []
    for axes, (metric, points) in zip(every, panels):
        band = indistinct(run, rows, metric.name)
        drawn.append(draw_points(axes, run, families(run, points), reference, band))
        axes.set(xlabel=time_label(time), title=metric.heading)
    fit(figure, height=LABELLED)
    known: set[str] = set()
    for axes, panel in zip(every, drawn):
        write_labels(axes, panel, size=6.5, known=known)
        known |= {label.text for label in panel.labels}
    caption = f"{scene}: lower left is better. Pale line: the best at each time."
    caption += BAND_REMARK if any(panel.band for panel in drawn) else ""
    caption += f" Dotted: the converged simulation, {number(reference)} ms." if reference else ""
    caption += " Joined: one family, its first and last number beside. Bars: repeats and seeds or, where "
    caption += "larger, the change by a perturbed reference."
    below = {method for panel in drawn for method in panel.below}
    caption += hollow_remark(run, below) + missing_remark(run, [p for _, points in panels for p in points])
    return Drawing(figure, f"error_against_time_{file_name(scene)}", caption)


def _draw_scenes(run: Run, scenes: Sequence[tuple[pd.DataFrame, tuple[Metric, list[Point]]]]) -> Drawing:
    """Draw a small panel for each scene."""
    figure, every = new_panels(len(scenes), 3)
    titles = list(dict.fromkeys(metric.heading for _, (metric, _) in scenes))
    for axes, (rows, (metric, points)) in zip(every, scenes):
        reference = value_of(rows, run.reference, run_time(rows))
        band = indistinct(run, rows, metric.name)
        draw_points(axes, run, families(run, points), reference, band, small=True)
        scene = wrapped(str(rows["scene"].iloc[0]), 24)
        axes.set_title("\n".join([scene, *([metric.heading] if len(titles) > 1 else [])]), fontsize=8)
        axes.tick_params(labelsize=7)
    figure.supxlabel("run time [ms per frame]", fontsize=8.5)
    fit(figure)
    caption = f"The same of other scenes, in the colours above: {' or '.join(titles)} against run time."
    return Drawing(figure, "error_against_time_scenes", caption)


def hollow_remark(run: Run, below: set[str]) -> str:
    """Return the remark of a caption on methods whose marker is hollow."""
    names = ", ".join(run.label(method) for method in run.ordered(below))
    return f" Hollow, on the lower edge: zero or below the panel ({names})." if below else ""


def missing_remark(run: Run, points: Sequence[Point]) -> str:
    """Return the remark of a caption on methods of which some seeds did not finish."""
    methods = dict.fromkeys(f"{run.label(point.method)}{point.fewer}" for point in points if point.fewer)
    return f" Seeds that did not finish are left out: {', '.join(methods)}." if methods else ""


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
