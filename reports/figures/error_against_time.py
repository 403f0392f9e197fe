"""Error against run time: solvers, networks and baselines on one plot, members of a family joined."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import lru_cache

import numpy as np
import pandas as pd

from reports.figures.error_points import draw_legend, draw_points, hollow_remark, missing_remark
from reports.figures.figure import Drawing, Figure
from reports.figures.plotting import PAGE_WIDTH, file_name, grid, new_figure, wrapped
from reports.run.finished_run import Metric, Run
from reports.statistics.means_and_spreads import value_of
from reports.statistics.pareto import (
    ERRORS,
    Point,
    compared_cells,
    error_points,
    indistinct,
    run_time,
    time_label,
)
from reports.tables.number_texts import number

MOST_PANELS, MOST_SCENES = 4, 9  # in the PDF; the page has all
Scenes = list[tuple[pd.DataFrame, list[tuple[Metric, list[Point]]]]]  # rows and panels of each


class ErrorOfPageOne(Figure[Scenes]):
    """First error of the leading scene, for page one."""

    name = "error_against_time"

    def needs(self, run: Run) -> Scenes:
        """Return the scenes in which two methods have an error and a run time."""
        return _scenes(run)

    def draw(self, run: Run, data: Scenes) -> Iterator[Drawing]:
        """Draw one wide panel."""
        rows, panels = data[0]
        yield _draw_errors(run, rows, panels[:1], lead=True)


class ErrorsOfScene(Figure[Scenes]):
    """All errors of the leading scene."""

    name, files = "error_against_time_of_scene", ("error_against_time_*",)

    def needs(self, run: Run) -> Scenes:
        """Return the leading scene if it has more than one error."""
        return [scene for scene in _scenes(run)[:1] if len(scene[1]) > 1]

    def draw(self, run: Run, data: Scenes) -> Iterator[Drawing]:
        """Draw a panel for each error."""
        rows, panels = data[0]
        yield _draw_errors(run, rows, panels[:MOST_PANELS])


class ErrorsOfScenes(Figure[Scenes]):
    """First error of every other scene."""

    name = "error_against_time_scenes"

    def needs(self, run: Run) -> Scenes:
        """Return the scenes behind the leading one."""
        return _scenes(run)[1:MOST_SCENES]

    def draw(self, run: Run, data: Scenes) -> Iterator[Drawing]:
        """Draw a small panel for each scene."""
        yield _draw_scenes(run, [(rows, panels[0]) for rows, panels in data])


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


def _draw_errors(
    run: Run,
    rows: pd.DataFrame,
    panels: Sequence[tuple[Metric, list[Point]]],
    lead: bool = False,
) -> Drawing:
    """Draw panels of one scene; the one of page one is wide and has its legend beside it."""
    scene = rows["scene"].iloc[0]
    time = run_time(rows)
    reference = value_of(rows, run.reference, time)
    columns = 3 if len(panels) == 3 else min(2, len(panels))
    lines = -(-len(panels) // columns)
    figure = new_figure(PAGE_WIDTH, 2.05 if lead else 0.75 + 2.0 * lines)
    every = np.atleast_1d(figure.subplots(lines, columns)).ravel()
    for axes in every[len(panels) :]:
        axes.set_axis_off()
    below: set[str] = set()
    bands = []
    for axes, (metric, points) in zip(every, panels):
        bands.append(indistinct(run, rows, metric.name))
        below |= draw_points(axes, run, points, reference, bands[-1])
        axes.set(xlabel=time_label(time), title=metric.heading)
        grid(axes)
    shown = [p for _, points in panels for p in points]
    draw_legend(figure, run, shown, reference, beside=lead)
    caption = f"{scene}: lower left is better. Pale line: the best at each time. Grey: within the "
    caption += "reference's uncertainty."
    if lead:
        return Drawing(figure, "error_against_time", caption)
    caption += f" Dotted: the converged simulation, {number(reference)} ms." if reference else ""
    caption += " Joined: one family, its first and last number beside. Bars: repeats and seeds or, where "
    caption += "larger, the change by a perturbed reference."
    caption += hollow_remark(run, below) + missing_remark(run, shown)
    return Drawing(figure, f"error_against_time_{file_name(scene)}", caption)


def _draw_scenes(run: Run, scenes: Sequence[tuple[pd.DataFrame, tuple[Metric, list[Point]]]]) -> Drawing:
    """Draw a small panel for each scene."""
    columns = min(4, len(scenes))
    lines = -(-len(scenes) // columns)
    figure = new_figure(PAGE_WIDTH, 0.35 + 1.55 * lines)
    every = np.atleast_1d(figure.subplots(lines, columns)).ravel()
    for axes in every[len(scenes) :]:
        axes.set_axis_off()
    titles = list(dict.fromkeys(metric.heading for _, (metric, _) in scenes))
    for axes, (rows, (metric, points)) in zip(every, scenes):
        reference = value_of(rows, run.reference, run_time(rows))
        draw_points(axes, run, points, reference, indistinct(run, rows, metric.name), small=True)
        scene = wrapped(str(rows["scene"].iloc[0]), 24)
        axes.set_title("\n".join([scene, *([metric.heading] if len(titles) > 1 else [])]), fontsize=8)
        axes.tick_params(labelsize=7)
        grid(axes)
    figure.supxlabel("run time [ms per frame]", fontsize=8.5)
    caption = f"The same of other scenes, in the colours above: {' or '.join(titles)} against run time."
    return Drawing(figure, "error_against_time_scenes", caption)
