"""Pictures of all methods at one frame, from the front and from behind."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from reports.figures.chosen_roll_outs import SceneRollOuts, long_motion
from reports.figures.figure import Drawing
from reports.figures.plotting import PAGE_WIDTH, file_name
from reports.pictures.sheets import BACK, FRONT, SIDE, heads_of, sheet, shots
from reports.run.finished_run import Run
from reports.tables.number_texts import number

MOST = 6  # methods side by side


def side_by_side(run: Run) -> Iterator[Drawing]:
    """Draw methods that came to the end of the motion shown at length, at one frame, front and back."""
    if motion := long_motion(run):
        yield draw_side_by_side(run, motion.roll_outs, run.ordered(motion.whole)[:MOST])


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
