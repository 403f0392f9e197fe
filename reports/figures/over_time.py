"""Figures over time: energies of each frame, losses of a training."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import pandas as pd

from reports.figures.figure import Drawing
from reports.figures.plotting import few, file_name, fit, leading, log_axis, new_panels, style
from reports.run.finished_run import Run, shown_seeds
from reports.run.stored_files import PANELS, History

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
    """Return the first motion of frame_energies.csv and its lines, of the seed shown of each method."""
    frames = run.frame_energies
    if frames.empty:
        return "", frames
    scene = str(frames["scene"].iloc[0])
    seeds = shown_seeds(run.frame[run.frame["scene"] == scene]).loc[scene]
    return scene, frames[(frames["scene"] == scene) & (frames["seed"] == frames["method"].map(seeds))]


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
