"""Pictures of garments in a report: page one's methods, all methods, the worst failures."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
import pandas as pd

from reports.cloth_colours import error_scale
from reports.figures.chosen_roll_outs import SceneRollOuts, long_motion, page_one_roll_outs, read_scene
from reports.figures.figure import Drawing
from reports.figures.plotting import PAGE_WIDTH, file_name, wrapped
from reports.rendering import BACK, BAR, FRONT, SIDE, heads_of, sheet, shots
from reports.run.finished_run import Run
from reports.statistics.means_and_spreads import mean_of
from reports.statistics.outcomes import overstretched
from reports.statistics.pareto import compared_cells
from reports.tables.table import number, with_spread

Item = TypeVar("Item")
MOST_IN_LEAD = 5  # pictures in a row
BELOW = ("step/distance", "distance/rms")  # the number below a picture: the first that is known


def lead_row(run: Run) -> Iterator[Drawing]:
    """Draw the methods of page one, coloured by one-step error where it is known; their error below each."""
    page_one = page_one_roll_outs(run)
    if not page_one:
        return
    roll_outs, methods = page_one
    frame, _ = roll_outs.chosen_frame(methods, run.reference)
    scale = error_scale(roll_outs, methods, frame, run.reference)
    columns = len(in_rows(methods)[0])
    tile = (wide := (PAGE_WIDTH - BAR) / max(columns, 3), 1.55 if columns == len(methods) else 1.2)
    cells, _ = compared_cells(run)
    rows = cells[cells["scene"] == roll_outs.scene]
    heads, below = heads_of(run, methods, wide), [error_below(run, rows, method) for method in methods]
    if columns < len(methods):  # heads stand over the first row alone
        heads, below = [], ["\n".join(filter(None, texts)) for texts in zip(heads, below)]
    pictures = shots(roll_outs, methods, frame, FRONT, tile, scale)
    figure = sheet(in_rows(pictures), tile, heads, below=in_rows(below), bar=scale)
    time = float(roll_outs.series[methods[0]].times[frame])
    caption = f"{roll_outs.scene} at {number(time)} s."
    if scale:
        of_step = "the minimum of the frame's own time step"
        origin = of_step if roll_outs.has_steps(methods) else "the simulation's vertex"
        caption += f" Colour: distance from {origin}; below: mean over frames."
    yield Drawing(figure, "lead", caption, vector=False)


def in_rows(items: Sequence[Item]) -> list[Sequence[Item]]:
    """Return the items in as few rows of at most MOST as there can be, about equally long.

    >>> [len(row) for row in in_rows("abcdefg")]
    [4, 3]
    """
    columns = math.ceil(len(items) / math.ceil(len(items) / MOST_IN_LEAD))
    return [items[first : first + columns] for first in range(0, len(items), columns)]


def error_below(run: Run, rows: pd.DataFrame, method: str) -> str:
    """Return the method's number for the first metric of BELOW that any method has."""
    for metric in BELOW:
        if metric in set(rows[rows["usable"]]["metric"]):
            mean = mean_of(rows, method, metric)
            text = with_spread(mean.value, mean.spread or None) if mean else ""
            return f"{text} {run.metrics[metric].unit}" if text else ""
    return ""


MOST_SIDE_BY_SIDE = 6  # methods side by side


def side_by_side(run: Run) -> Iterator[Drawing]:
    """Draw methods that came to the end of the motion shown at length, at one frame, front and back."""
    if motion := long_motion(run):
        yield draw_side_by_side(run, motion, run.ordered(motion.whole)[:MOST_SIDE_BY_SIDE])


def draw_side_by_side(run: Run, roll_outs: SceneRollOuts, methods: Sequence[str]) -> Drawing:
    """Draw these methods; the caption names the others."""
    frame, why = roll_outs.chosen_frame(methods, run.reference)
    wide = min((PAGE_WIDTH - SIDE) / len(methods), 1.5)
    tile = (wide, 1.12 * wide)
    rows = [shots(roll_outs, methods, frame, turn, tile) for turn in (FRONT, BACK)]
    figure = sheet(rows, tile, heads_of(run, methods, wide), beside=("front", "back"))
    time = float(roll_outs.series[methods[0]].times[frame])
    caption = f"{roll_outs.scene}: frame {frame} (t = {number(time)} s), {why}."
    if others := set(roll_outs.series) - set(methods):
        names = ", ".join(map(run.label, run.ordered(others)))
        caption += f" Not shown, for they ended before it or for want of room: {names}."
    return Drawing(figure, f"frames_{file_name(roll_outs.scene)}", caption, vector=False)


MOST_FAILURES, OF_ONE = 4, 2  # failures that are shown, and how many of them by one method
STRAIN = "energy/strain"


@dataclass(frozen=True)
class Failure:
    """A roll-out that went far wrong: its method, the frame to look at, and a text for below it."""

    roll_outs: SceneRollOuts
    method: str
    frame: int
    text: str


def failures(run: Run) -> Iterator[Drawing]:
    """Draw trained networks with most strain over the simulation's, where their roll-outs are on disk."""
    worst = worst_failures(run)
    if not worst:
        return
    wide = PAGE_WIDTH / max(len(worst), 4)
    tile = (wide, 1.1 * wide)
    images = [shots(f.roll_outs, [f.method], f.frame, FRONT, tile)[0] for f in worst]
    names = [f"{run.label(f.method)}: {f.roll_outs.scene.rpartition('/')[2]}" for f in worst]
    heads = [wrapped(name, round(14 * wide)) for name in names]
    figure = sheet([images], tile, heads, below=[[f.text for f in worst]])
    caption = "The worst of trained networks by strain over the simulation's: each at its worst frame."
    yield Drawing(figure, "failures", caption, vector=False)


def worst_failures(run: Run) -> list[Failure]:
    """Return the failures that are shown."""
    failures: list[Failure] = []
    shown: Counter[str] = Counter()
    for method, scene, _, strain, ratio in overstretched(run):
        if len(failures) == MOST_FAILURES or shown[method] == OF_ONE:
            continue
        roll_outs = read_scene(run, run.frame[run.frame["scene"] == scene], [method])
        if method in roll_outs.series:
            cloth = roll_outs.series[method]
            curve = cloth.frame_fields.get(STRAIN)
            last = cloth.frames - 1
            frame = last if curve is None else int(np.argmax(np.nan_to_num(curve[: cloth.frames])))
            text = f"{number(strain)} J of strain,\n{number(ratio)} × the simulation's"
            failures.append(Failure(roll_outs, method, frame, text))
            shown[method] += 1
    return failures
