"""Figures over time: energies and the hem frame by frame, losses of a training."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import pandas as pd

from reference_sim.trajectory import Trajectory
from reports.figures.chosen_roll_outs import SceneRollOuts, long_motion
from reports.figures.figure import Drawing
from reports.figures.plotting import few, file_name, fit, leading, log_axis, new_panels, style
from reports.run.finished_run import Run, shown_seeds
from reports.run.stored_files import PANELS, History
from reports.tables.table import number

TERMS = ("strain", "bending", "inertia")
LEAST = 1e-4  # of the largest energy that is shown: frames at rest would squeeze the rest


def energy_series(run: Run) -> Iterator[Drawing]:
    """Draw a panel for each term of one whole motion, a curve per method (the paper's figure 4)."""
    scene, frames = _frames(run)
    terms = [term for term in TERMS if term in frames and frames[term].notna().any()]
    if not terms:
        return
    methods = few(run, frames.dropna(subset=terms, how="all")["method"])
    curves = {method: frames[frames["method"] == method] for method in methods}
    figure, panels = new_panels(len(terms), 3)
    for axes, term in zip(panels, terms):
        for method, curve in reversed(curves.items()):  # the reference last, on top
            look, energy = style(run, method), curve[term].where(curve[term] > 0.0)
            axes.plot(curve["seconds"], energy, color=look.colour, linestyle=look.line)
        shown = np.concatenate([curve[term] for curve in curves.values()])
        shown = shown[np.isfinite(shown) & (shown > 0.0)]
        if len(shown):
            axes.set_ylim(max(shown.min() / 1.5, shown.max() * LEAST), 1.6 * shown.max())
            log_axis(axes, "y")
        axes.set(title=term.capitalize(), xlabel="time [s]")
    panels[0].set_ylabel("energy [J]")
    fit(figure, [style(run, method) for method in methods])
    caption = f"{scene}: energy of each frame by term, logarithmic. A frame with no energy at all is a gap."
    yield Drawing(figure, f"energy_series_{file_name(scene)}", caption)


def _frames(run: Run) -> tuple[str, pd.DataFrame]:
    """Return a motion and method, seconds and energies by term [J] of its frames.

    It is the one shown at length or, where no roll-outs were kept, the first of frame_energies.csv.
    """
    if motion := long_motion(run):
        parts = [
            pd.DataFrame(
                {"method": method, "seconds": cloth.times}
                | {term: cloth.frame_fields.get(f"energy/{term}", np.nan) for term in TERMS}
            )
            for method, cloth in motion.roll_outs.series.items()
        ]
        return motion.roll_outs.scene, pd.concat(parts)
    frames = run.frame_energies
    if frames.empty:
        return "", frames
    scene = str(frames["scene"].iloc[0])
    seeds = shown_seeds(run.frame[run.frame["scene"] == scene]).loc[scene]
    return scene, frames[(frames["scene"] == scene) & (frames["seed"] == frames["method"].map(seeds))]


YAW, FROM_END = "hem/yaw", "hem/from_end"
LEAST_YAW = np.radians(5.0)  # with less there is nothing to see
HELD = 24  # frames a body holds still at the end to count as stopped, as for the ringing
BEFORE = 4  # frames before the stop that are shown with what follows it
STOPPED = "#F3F3F3"


def hem(run: Run) -> Iterator[Drawing]:
    """Draw the hem in the motion that is shown at length, if it turns there."""
    motion = long_motion(run)
    if motion and hem_turns(run, motion.roll_outs):
        yield draw_hem(run, motion.roll_outs)


def _methods_with_hem(run: Run, roll_outs: SceneRollOuts) -> list[str]:
    """Return the methods with curves of the hem; a roll-out that ended early has no end to swing about."""
    series = roll_outs.series
    measured = {m for m, cloth in series.items() if {YAW, FROM_END} <= cloth.frame_fields.keys()}
    frames = max((series[m].frames for m in measured), default=0)
    return few(run, (m for m in measured if series[m].frames == frames))


def hem_turns(run: Run, roll_outs: SceneRollOuts) -> bool:
    """Return whether a hem turns by LEAST_YAW or more in these roll-outs."""
    methods = _methods_with_hem(run, roll_outs)
    yaw = [np.degrees(roll_outs.series[m].frame_fields[YAW]) for m in methods]
    largest = max((float(np.nanmax(np.abs(curve))) for curve in yaw), default=0.0)
    return largest >= np.degrees(LEAST_YAW)


def draw_hem(run: Run, roll_outs: SceneRollOuts) -> Drawing:
    """Draw yaw and distance; where the body stops, that is marked and what follows drawn again, larger."""
    series, body, methods = roll_outs.series, roll_outs.body, _methods_with_hem(run, roll_outs)
    yaw = {m: np.degrees(series[m].frame_fields[YAW]) for m in methods}
    stop = None if body is None else stop_frame(body)
    if stop is not None and stop >= max(series[m].frames for m in methods):
        stop = None  # every cloth ended before it
    from_end = {m: 1e3 * series[m].frame_fields[FROM_END] for m in methods}
    panels = [("yaw of the hem [degrees]", yaw, 0), ("from its end [mm]", from_end, 0)]
    if stop is not None:
        first = max(stop - BEFORE, 0)
        turned = {m: curve - curve[-1] for m, curve in yaw.items()}
        panels[1:] = [("yaw from its end [degrees]", turned, first), ("from its end [mm]", from_end, first)]
    figure, every = new_panels(len(panels), 3)
    for axes, (title, curves, first) in zip(every, panels):
        for method in reversed(methods):  # the reference last, on top
            look, times = style(run, method), series[method].times
            axes.plot(times[first:], curves[method][first:], color=look.colour, linestyle=look.line)
        if stop is not None and body is not None:
            axes.axvline(body.times[stop], color="#666666", linewidth=0.9, linestyle=":")
            axes.axvspan(body.times[stop], body.times[-1], color=STOPPED, zorder=0)
            axes.set_xlim(body.times[first], body.times[-1])
        axes.set(title=title, xlabel="time [s]")
    fit(figure, [style(run, method) for method in methods])
    caption = f"{roll_outs.scene}: the hem in the axes of the root."
    if stop is not None and body is not None:
        caption += f" Grey: the body has stopped, at {number(float(body.times[stop]))} s. "
        far = [f"{run.label(m)} {number(round(overshoot(c, stop), 1), 2)}" for m, c in yaw.items()]
        caption += f"Farthest past its end after the stop, in degrees: {', '.join(far)}."
    return Drawing(figure, f"hem_{file_name(roll_outs.scene)}", caption)


def stop_frame(body: Trajectory) -> int | None:
    """Return the frame from which the body holds still, None where it moves until the end."""
    moves = np.flatnonzero((body.positions[:-1] != body.positions[-1]).any(axis=(1, 2)))
    stop = int(moves[-1]) + 1 if len(moves) else 0
    return stop if 0 < stop < body.frames - HELD else None


def overshoot(yaw: Sequence[float] | np.ndarray, stop: int) -> float:
    """Return how far a hem swings past its end once the body has stopped.

    It is the lesser of the farthest on either side: a hem that comes to its end from one side has none.
    """
    away = np.asarray(yaw)[stop:] - yaw[-1]
    return float(min(away.max(), -away.min()))


def training_curves(run: Run) -> Iterator[Drawing]:
    """Draw the loss of every training, a figure for each garment, the first under the plain name."""
    for place, garment in enumerate(dict.fromkeys(history.garment for history in run.histories)):
        name = f"training_{file_name(garment)}" if place else "training"
        histories = [history for history in run.histories if history.garment == garment]
        shown = leading(run, {history.method for history in histories})
        histories = [history for history in histories if history.method in shown]
        if histories:
            yield _draw_garment(run, name, garment, histories)


def _draw_garment(run: Run, name: str, garment: str, histories: Sequence[History]) -> Drawing:
    known = dict.fromkeys((*PANELS.values(), *(h.panel for h in histories)))
    titles = [title for title in known if any(h.panel == title for h in histories)]
    figure, panels = new_panels(len(titles), 2)
    for axes, title in zip(panels, titles):
        of_panel = [history for history in histories if history.panel == title]
        for history in of_panel:
            look, seconds = style(run, history.method), history.column("seconds")
            axes.plot(seconds, history.column("loss"), color=look.colour, linestyle=look.line, linewidth=1.1)
        axes.set(xlabel="training time [s]", title=title)
        # Gravity may make losses negative.
        if min(history.column("loss").min() for history in of_panel) > 0.0:
            log_axis(axes, "y")
    shown = leading(run, {history.method for history in histories})
    fit(figure, [style(run, method) for method in shown])
    caption = f"{garment}: training loss against wall time; one curve per model and seed."
    return Drawing(figure, name, caption)
