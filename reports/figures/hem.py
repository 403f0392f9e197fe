"""How a hem answers to the body's motion, frame by frame: the dynamics that no energy of a frame shows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from reports.figures.plotting import PAGE_WIDTH, Picture, file_name, grid, legend_above, new_figure, save
from reports.figures.styles import leading, style
from reports.run.rows import Run
from reports.tables.numbers import number

if TYPE_CHECKING:
    from reference_sim.trajectory.trajectory import Trajectory

YAW, FROM_END = "hem/yaw", "hem/from_end"
LEAST = np.radians(5.0)  # of yaw: with less there is nothing to see
HELD = 24  # frames a body holds still at the end to count as stopped, as for the ringing
BEFORE = 4  # frames before the stop that are shown with what follows it
STOPPED = "#F3F3F3"


def hem_curves(
    folder: Path, run: Run, scene: str, series: Mapping[str, Trajectory], body: Trajectory | None = None
) -> Picture | None:
    """Yaw of the hem in the root's axes and its distance from where it ends, a curve per method.

    Where the body stops, that is marked, and what follows is drawn again, larger. None for a scene without
    these curves, or whose hem hardly turns.
    """
    having = {m for m, mesh in series.items() if {YAW, FROM_END} <= mesh.frame_fields.keys()}
    frames = max((series[m].frames for m in having), default=0)  # what ended early has no end to swing about
    methods = leading(run, (m for m in having if series[m].frames == frames))
    yaw = {m: np.degrees(series[m].frame_fields[YAW]) for m in methods}
    if max((float(np.nanmax(np.abs(curve))) for curve in yaw.values()), default=0.0) < np.degrees(LEAST):
        return None
    stop = None if body is None else stop_frame(body)
    from_end = {m: 1e3 * series[m].frame_fields[FROM_END] for m in methods}
    panels = [("yaw of the hem [degrees]", yaw, 0), ("from its end [mm]", from_end, 0)]
    if stop is not None:
        first = max(stop - BEFORE, 0)
        turned = {m: curve - curve[-1] for m, curve in yaw.items()}
        panels[1:] = [("yaw from its end [degrees]", turned, first), ("from its end [mm]", from_end, first)]
    figure = new_figure(PAGE_WIDTH, 2.6 if len(methods) <= 4 else 3.0)
    for axes, (title, curves, first) in zip(figure.subplots(1, len(panels)), panels):
        for method in reversed(methods):  # the reference last, on top
            look, times = style(run, method), series[method].times
            axes.plot(times[first:], curves[method][first:], color=look.colour, linestyle=look.line)
        if stop is not None and body is not None:
            axes.axvline(body.times[stop], color="#666666", linewidth=0.9, linestyle=":")
            axes.axvspan(body.times[stop], body.times[-1], color=STOPPED, zorder=0)
            axes.set_xlim(body.times[first], body.times[-1])
        axes.set(title=title, xlabel="time [s]")
        grid(axes)
    legend_above(figure, [style(run, method) for method in methods], lines=True)
    caption = f"{scene}: the hem in the axes of the root."
    if stop is not None and body is not None:
        caption += f" Grey: the body has stopped, at {number(float(body.times[stop]))} s. "
        far = [f"{run.label(m)} {number(round(overshoot(c, stop), 1), 2)}" for m, c in yaw.items()]
        caption += f"Farthest past its end after the stop, in degrees: {', '.join(far)}."
    return save(figure, folder, f"hem_{file_name(scene)}", caption=caption, kind="hem")


def stop_frame(body: Trajectory) -> int | None:
    """The frame from which the body stays where it is, None where it does not hold still at the end."""
    moves = np.flatnonzero((body.positions[:-1] != body.positions[-1]).any(axis=(1, 2)))
    stop = int(moves[-1]) + 1 if len(moves) else 0
    return stop if 0 < stop < body.frames - HELD else None


def overshoot(yaw: Sequence[float] | np.ndarray, stop: int) -> float:
    """How far past its end a hem swings once the body has stopped: the lesser of its farthest on either side.

    A hem that comes to its end from one side has none.
    """
    away = np.asarray(yaw)[stop:] - yaw[-1]
    return float(min(away.max(), -away.min()))
