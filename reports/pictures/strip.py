"""Strips: frames of a motion, evenly spread, a row for each method."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from reports.figures.chosen_roll_outs import FEW, SceneRollOuts, long_motion, whole_motions
from reports.figures.figure import Drawing, Figure
from reports.figures.plotting import PAGE_WIDTH, file_name, wrapped
from reports.pictures.sheets import FRONT, SIDE, count_lines, sheet, shots
from reports.run.finished_run import Run
from reports.tables.number_texts import number

FRAMES = 6  # side by side


class Strip(Figure):
    """The motion that is shown at length."""

    name, files = "strip", ("strip_*",)

    def needs(self, run: Run) -> bool:
        """Return whether one of the few methods came to the end of that motion."""
        return bool(_methods(run))

    def draw(self, run: Run) -> Iterator[Drawing]:
        """Draw that motion."""
        motion = long_motion(run)
        assert motion is not None
        yield draw_strip(run, motion.roll_outs, _methods(run))


class SpareStrips(Figure):
    """Further motions, which may fill the last page."""

    name, files = "spare_strip", ("strip_*",)

    def needs(self, run: Run) -> bool:
        """Return whether the run kept roll-outs of more than one whole motion."""
        return any(motion.few for motion in whole_motions(run)[1:])

    def draw(self, run: Run) -> Iterator[Drawing]:
        """Draw each of them."""
        for motion in whole_motions(run)[1:]:
            if motion.few:
                yield draw_strip(run, motion.roll_outs, motion.few[:FEW])


def _methods(run: Run) -> list[str]:
    motion = long_motion(run)
    return [] if motion is None else [method for method in motion.few if method in motion.whole][:FEW]


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
