"""Strips: frames of a motion, evenly spread, a row for each method."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from reports.figures.chosen_roll_outs import FEW, SceneRollOuts, long_motion
from reports.figures.figure import Drawing
from reports.figures.plotting import PAGE_WIDTH, file_name, wrapped
from reports.pictures.sheets import FRONT, SIDE, count_lines, sheet, shots
from reports.run.finished_run import Run
from reports.tables.number_texts import number

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
