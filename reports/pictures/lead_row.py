"""Pictures of page one: its methods side by side at one frame, coloured by error."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import TypeVar

import pandas as pd

from reports.figures.chosen_roll_outs import page_one_roll_outs
from reports.figures.figure import Drawing
from reports.figures.plotting import PAGE_WIDTH
from reports.pictures.colour_scales import scales
from reports.pictures.sheets import BAR, FRONT, heads_of, sheet, shots
from reports.run.finished_run import Run
from reports.statistics.means_and_spreads import mean_of
from reports.statistics.pareto import compared_cells
from reports.tables.number_texts import number, with_spread

Item = TypeVar("Item")
MOST = 5  # pictures in a row
BELOW = ("step/distance", "distance/rms")  # the number below a picture: the first that is known


def lead_row(run: Run) -> Iterator[Drawing]:
    """Draw the methods of page one, coloured by one-step error where it is known; their error below each."""
    page_one = page_one_roll_outs(run)
    if not page_one:
        return
    roll_outs, methods = page_one
    frame, _ = roll_outs.chosen_frame(methods, run.reference)
    name, scale = next(iter(scales(roll_outs, methods, frame, run.reference).items()), ("", None))
    columns = len(in_rows(methods)[0])
    tile = (wide := (PAGE_WIDTH - BAR) / max(columns, 3), 1.55 if columns == len(methods) else 1.2)
    cells, _ = compared_cells(run)
    rows = cells[cells["scene"] == roll_outs.scene]
    heads, below = heads_of(run, methods, wide), [error_below(run, rows, method) for method in methods]
    if columns < len(methods):  # heads stand over the first row alone
        heads, below = [], ["\n".join(filter(None, texts)) for texts in zip(heads, below)]
    pictures = shots(roll_outs, methods, frame, FRONT, tile, scale)
    figure = sheet(in_rows(pictures), tile, heads, below=in_rows(below), bar=scale)
    colour = {
        "step": "distance from the minimum of the frame's own time step; below: mean over frames",
        "distance": "distance from the simulation's vertex; below: mean over frames",
    }.get(name, scale.title if scale else "none")
    time = float(roll_outs.series[methods[0]].times[frame])
    caption = f"{roll_outs.scene} at {number(time)} s. Colour: {colour}."
    yield Drawing(figure, "lead", caption, vector=False)


def in_rows(items: Sequence[Item]) -> list[Sequence[Item]]:
    """Return the items in as few rows of at most MOST as there can be, about equally long.

    >>> [len(row) for row in in_rows("abcdefg")]
    [4, 3]
    """
    columns = math.ceil(len(items) / math.ceil(len(items) / MOST))
    return [items[first : first + columns] for first in range(0, len(items), columns)]


def error_below(run: Run, rows: pd.DataFrame, method: str) -> str:
    """Return the method's number for the first metric of BELOW that any method has."""
    for metric in BELOW:
        if metric in set(rows[rows["usable"]]["metric"]):
            mean = mean_of(rows, method, metric)
            text = with_spread(mean.value, mean.spread or None) if mean else ""
            return f"{text} {run.metrics[metric].unit}" if text else ""
    return ""
