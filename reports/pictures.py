"""Pictures of garments in a report: page one's methods, all methods, strips of frames, the worst failures."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
import pandas as pd

from reports.cloth_colours import scales
from reports.figures.chosen_roll_outs import FEW, SceneRollOuts, long_motion, page_one_roll_outs, read_scene
from reports.figures.figure import Drawing
from reports.figures.plotting import PAGE_WIDTH, file_name, wrapped
from reports.rendering import BACK, BAR, FRONT, SIDE, count_lines, heads_of, sheet, shots
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


def colour_maps(run: Run) -> Iterator[Drawing]:
    """Draw a row of pictures for each scale of colours but that of page one, front and back in turn."""
    page_one = page_one_roll_outs(run)
    if not page_one:
        return
    roll_outs, methods = page_one
    frame, _ = roll_outs.chosen_frame(methods, run.reference)
    further = list(scales(roll_outs, methods, frame, run.reference).items())[1:]
    wide = min((PAGE_WIDTH - BAR) / len(methods), 1.52)
    tile = (wide, 0.86 * wide)
    heads = heads_of(run, methods, wide)
    for turn, (name, scale) in zip((FRONT, BACK, FRONT, BACK), further):
        figure = sheet([shots(roll_outs, methods, frame, turn, tile, scale)], tile, heads, bar=scale)
        heads = []  # the next row stands below
        side = "front" if turn == FRONT else "back"
        caption = f"{roll_outs.scene}, the frame of page one, {side}: {scale.title}."
        yield Drawing(figure, f"map_{name}", caption, vector=False)


MOST_SIDE_BY_SIDE = 6  # methods side by side


def side_by_side(run: Run) -> Iterator[Drawing]:
    """Draw methods that came to the end of the motion shown at length, at one frame, front and back."""
    if motion := long_motion(run):
        yield draw_side_by_side(run, motion.roll_outs, run.ordered(motion.whole)[:MOST_SIDE_BY_SIDE])


def draw_side_by_side(run: Run, roll_outs: SceneRollOuts, methods: Sequence[str]) -> Drawing:
    """Draw these methods; the caption names the others."""
    frame, why = roll_outs.chosen_frame(methods, run.reference)
    wide = min((PAGE_WIDTH - SIDE) / len(methods), 1.5)
    tile = (wide, 1.12 * wide)
    rows = [shots(roll_outs, methods, frame, turn, tile) for turn in (FRONT, BACK)]
    figure = sheet(rows, tile, heads_of(run, methods, wide), beside=("front", "back"))
    time = float(roll_outs.series[methods[0]].times[frame])
    caption = f"{roll_outs.scene}: frame {frame} (t = {number(time)} s), {why}."
    for reason, others in _not_shown(roll_outs, methods).items():
        names = ", ".join(map(run.label, run.ordered(others)))
        caption += f" Not shown, {reason}: {names}." if others else ""
    return Drawing(figure, f"frames_{file_name(roll_outs.scene)}", caption, vector=False)


def _not_shown(roll_outs: SceneRollOuts, methods: Sequence[str]) -> dict[str, list[str]]:
    """Return reason -> the roll-outs that are not among these methods."""
    frames = {method: cloth.frames for method, cloth in roll_outs.series.items() if method not in methods}
    last = max(roll_outs.series[method].frames for method in methods)
    return {
        "for they ended before it": [method for method, count in frames.items() if count < last],
        "for want of room": [method for method, count in frames.items() if count >= last],
    }


FRAMES = 6  # side by side


def strip(run: Run) -> Iterator[Drawing]:
    """Draw the motion shown at length, of its few methods those that came to its end."""
    motion = long_motion(run)
    few = [method for method in motion.few if method in motion.whole][:FEW] if motion else []
    if motion and few:
        yield draw_strip(run, motion.roll_outs, few)


def draw_strip(run: Run, roll_outs: SceneRollOuts, methods: Sequence[str]) -> Drawing:
    """Draw frames from the second fifth on."""
    frames = min(roll_outs.series[method].frames for method in methods)
    chosen = np.unique(np.linspace(frames // 5, frames - 1, FRAMES).astype(int))
    beside = [wrapped(run.label(method), 14) for method in methods]
    wide = (PAGE_WIDTH - SIDE * count_lines(beside)) / FRAMES
    tile = (wide, 1.05 * wide)
    columns = [shots(roll_outs, methods, int(frame), FRONT, tile) for frame in chosen]
    times = roll_outs.series[methods[0]].times
    heads = [f"{number(float(times[frame]))} s" for frame in chosen]
    figure = sheet(list(zip(*columns)), tile, heads, beside=beside)
    caption = f"{roll_outs.scene}: the same frames of each method."
    return Drawing(figure, f"strip_{file_name(roll_outs.scene)}", caption, vector=False)


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
