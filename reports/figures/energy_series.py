"""Energies frame by frame: strain, bending and inertia of one motion, a curve per method."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from reports.figures.figure import Drawing
from reports.figures.method_styles import few, style
from reports.figures.plotting import file_name, fit, log_axis, new_panels
from reports.run.finished_run import Run, shown_seeds

TERMS = ("strain", "bending", "inertia")
LEAST = 1e-4  # of the largest energy that is shown: frames at rest would squeeze the rest


def energy_series(run: Run) -> Iterator[Drawing]:
    """Draw a panel for each term of the first whole motion, a curve per method (the paper's figure 4)."""
    frames = run.frame_energies
    terms = [term for term in TERMS if term in frames]
    scenes = [scene for of_garment in run.garments(run.garment_rows).values() for scene in of_garment]
    scene = next((scene for scene in scenes if terms and (frames["scene"] == scene).any()), "")
    if not scene:
        return
    seeds = shown_seeds(run.garment_rows).loc[scene]
    frames = frames[(frames["scene"] == scene) & (frames["seed"] == frames["method"].map(seeds))]
    methods = few(run, frames["method"])
    curves = {method: frames[frames["method"] == method] for method in methods}
    figure, panels = new_panels(len(terms), 3)
    for axes, term in zip(panels, terms):
        for method, curve in reversed(curves.items()):  # the reference last, on top
            look, energy = style(run, method), curve[term].where(curve[term] > 0.0)
            axes.plot(curve["seconds"], energy, color=look.colour, linestyle=look.line)
        shown = np.concatenate([curve[term] for curve in curves.values()])
        shown = shown[shown > 0.0]
        if len(shown):
            axes.set_ylim(max(shown.min() / 1.5, shown.max() * LEAST), 1.6 * shown.max())
            log_axis(axes, "y")
        axes.set(title=term.capitalize(), xlabel="time [s]")
    panels[0].set_ylabel("energy [J]")
    fit(figure, [style(run, method) for method in methods])
    caption = f"{scene}: energy of each frame by term, logarithmic. A frame with no energy at all is a gap."
    yield Drawing(figure, f"energy_series_{file_name(scene)}", caption)
