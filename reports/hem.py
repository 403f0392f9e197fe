"""How a hem answers to the body's motion, frame by frame: the swing that no energy of a frame shows."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np

from reports import palette
from reports.canvas import PAGE_WIDTH, Picture, file_name, grid, legend_above, new_figure, save
from reports.numbers import number
from reports.vtkhdf import MeshSeries

YAW, FROM_END = "hem/yaw", "hem/from_end"
LEAST = np.radians(5.0)  # of yaw: with less there is no swing to see
HELD = 24  # frames a body holds still at the end to count as stopped, as for the ringing
BEFORE = 4  # frames before the stop that are shown with what follows it
STOPPED = "#F3F3F3"
# What is compared where there are more methods than room: solver, its twin, paper, dynamic recipe, hybrid.
SWINGING = (
    palette.REFERENCE, palette.MOVED, "skinning", "snug", "snug-paper", "snug-dynamic",
    "snug-dynamic+lbfgs-4",
)  # fmt: skip


def hem_curves(
    folder: Path, scene: str, series: Mapping[str, MeshSeries], body: MeshSeries | None = None
) -> Picture | None:
    """Yaw of the hem in the root's axes and its distance from where it ends, a curve per method.

    Where the body stops, that is marked, and what follows is drawn again, larger. None for a scene without
    these curves, or whose hem hardly turns.
    """
    having = {m for m, mesh in series.items() if all(name in mesh.fields for name in (YAW, FROM_END))}
    frames = max((series[m].frames for m in having), default=0)  # what ended early has no end to swing about
    methods = shown(m for m in having if series[m].frames == frames)
    if not methods or max(float(np.nanmax(np.abs(series[m].fields[YAW]))) for m in methods) < LEAST:
        return None
    stop = None if body is None else stop_frame(body)
    yaw = {m: np.degrees(series[m].fields[YAW]) for m in methods}
    from_end = {m: 1e3 * series[m].fields[FROM_END] for m in methods}
    panels = [("yaw of the hem [degrees]", yaw, 0), ("from its end [mm]", from_end, 0)]
    if stop is not None:
        first = max(stop - BEFORE, 0)
        turned = {m: curve - curve[-1] for m, curve in yaw.items()}
        panels[1:] = [("yaw from its end [degrees]", turned, first), ("from its end [mm]", from_end, first)]
    figure = new_figure(PAGE_WIDTH, 2.6 if len(methods) <= 4 else 3.0)
    for axes, (title, curves, first) in zip(figure.subplots(1, len(panels)), panels):
        for method in reversed(methods):  # the reference last, on top
            look, times = palette.style(method), series[method].times
            axes.plot(times[first:], curves[method][first:], color=look.colour, linestyle=look.line)
        if stop is not None and body is not None:
            axes.axvline(body.times[stop], color="#666666", linewidth=0.9, linestyle=":")
            axes.axvspan(body.times[stop], body.times[-1], color=STOPPED, zorder=0)
            axes.set_xlim(body.times[first], body.times[-1])
        axes.set(title=title, xlabel="time [s]")
        grid(axes)
    legend_above(figure, methods, lines=True)
    caption = f"{scene}: the hem in the axes of the root."
    if stop is not None and body is not None:
        caption += f" Grey: the body has stopped, at {number(float(body.times[stop]))} s; "
        caption += "the middle and the right panel begin just before. "
        caption += _overshoots(yaw, stop)
    else:
        caption += " Each curve is one method; what the simulation does beyond the others is swing."
    name = f"hem_{file_name(scene)}"
    return save(figure, folder, name, caption=caption, section="garments", kind="hem")


def shown(methods: Iterable[str]) -> list[str]:
    """In order; those worth comparing alone, where there are more than a figure has room for."""
    found = palette.ordered(methods)
    return found if len(found) <= palette.ROOM else [method for method in found if method in SWINGING]


def stop_frame(body: MeshSeries) -> int | None:
    """The frame from which the body stays where it is, None where it does not hold still at the end."""
    last, frame = body.positions(-1), body.frames - 1
    while frame > 0 and np.array_equal(body.positions(frame - 1), last):
        frame -= 1
    return frame if 0 < frame < body.frames - HELD else None


def overshoot(yaw: Sequence[float] | np.ndarray, stop: int) -> float:
    """How far past its end a hem swings once the body has stopped: the lesser of its farthest on either side.

    A hem that comes to its end from one side has none.
    """
    away = np.asarray(yaw)[stop:] - yaw[-1]
    return float(min(away.max(), -away.min()))


def _overshoots(yaw: Mapping[str, np.ndarray], stop: int) -> str:
    far = {method: round(overshoot(curve, stop), 1) for method, curve in yaw.items()}
    parts = [f"{palette.label(method)} {number(degrees, 2)}" for method, degrees in far.items()]
    return f"Farthest past its end after the stop, in degrees: {', '.join(parts)}."
