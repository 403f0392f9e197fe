"""Energies frame by frame, and frames per second."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from reports.data import Run
from reports.means import means
from reports.numbers import number
from reports.pareto import TIME
from reports.plotting import (
    PAGE_WIDTH,
    Picture,
    file_name,
    grid,
    legend_above,
    log_axis,
    new_figure,
    save,
)
from reports.styles import leading, style

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from reference_sim.trajectory import Trajectory

SERIES_TERMS = ("strain", "bending", "inertia")
BATCH = "cost/batch"


def energy_series(folder: Path, run: Run, scene: str, series: Mapping[str, Trajectory]) -> Picture | None:
    """Strain, bending and inertia per frame, one panel each, one curve per method (the paper's figure)."""
    curves = {
        term: {
            m: s.frame_fields[f"energy/{term}"]
            for m, s in series.items()
            if f"energy/{term}" in s.frame_fields
        }
        for term in SERIES_TERMS
    }
    curves = {term: own for term, own in curves.items() if own}
    methods = leading(run, {method for own in curves.values() for method in own})
    if not methods:
        return None
    figure = new_figure(PAGE_WIDTH, 2.35)
    panels = np.atleast_1d(figure.subplots(1, len(curves)))
    for axes, (term, own) in zip(panels, curves.items()):
        for method in reversed([m for m in methods if m in own]):  # the reference last, on top
            look = style(run, method)
            shown = np.where(np.isfinite(own[method]) & (own[method] > 0.0), own[method], np.nan)
            axes.plot(series[method].times, shown, color=look.colour, linestyle=look.line)
        _log_energy_axis(axes)
        axes.set(title=term.capitalize(), xlabel="time [s]")
        grid(axes)
    panels[0].set_ylabel("energy [J]")
    legend_above(figure, [style(run, method) for method in methods], lines=True)
    caption = f"{scene}: energy of each frame by term, logarithmic. A frame with no energy at all is a gap."
    return save(figure, folder, f"energy_series_{file_name(scene)}", caption=caption, kind="series")


def _log_energy_axis(axes: Axes) -> None:
    """Logarithmic, cut four decades below the top so that frames at rest do not squeeze the rest."""
    values = np.concatenate([np.asarray(line.get_ydata(), dtype=float) for line in axes.get_lines()])
    values = values[np.isfinite(values)]
    if len(values):
        top = float(values.max())
        axes.set_ylim(max(float(values.min()) / 1.5, top * 1e-4), top * 1.6)
        log_axis(axes, "y")


def throughput(folder: Path, run: Run) -> list[Picture]:
    """Frames per second of each network of the first garment, alone (hollow) and in a batch (full).

    Of the scenes that were measured both ways.
    """
    cells = run.cells("garments", "speed")
    batched = cells[(cells["metric"] == BATCH) & cells["usable"] & (cells["garment"] != "")]
    if not len(batched):
        return []
    garment, scenes = next(iter(run.garments(batched).items()))
    rows = cells[cells["scene"].isin(scenes) & cells["metric"].isin([TIME, BATCH])]
    rows = rows.merge(batched[["scene", "method"]].drop_duplicates(), on=["scene", "method"])
    times = means(rows, "method", "metric")
    apart = run.standing_apart(batched)
    methods = [m for m in run.ordered(rows["method"]) if m not in apart and (m, TIME) in times.index]
    figure = new_figure(PAGE_WIDTH, 0.75 + 0.24 * len(methods))
    axes = figure.subplots()
    rates = {m: [1e3 / times[m, TIME].value, 1e3 / times[m, BATCH].value] for m in methods}
    for place, (method, both) in enumerate(rates.items()):
        look = style(run, method)
        axes.plot(both, [place, place], color=look.colour, linewidth=1.6, zorder=2)
        for rate, fill in zip(both, ("white", look.colour)):
            axes.plot(rate, place, marker=look.marker, color=look.colour, markerfacecolor=fill, zorder=3)
        for rate, shift, side in ((min(both), -7, "right"), (max(both), 7, "left")):
            axes.annotate(
                number(float(f"{rate:.2e}"), 6, trim=True), (rate, place), (shift, 0), fontsize=8,
                textcoords="offset points", ha=side, va="center",
            )  # fmt: skip
    every = [rate for both in rates.values() for rate in both]
    axes.set_xlim(min(every) / 1.7, max(every) * 1.7)
    log_axis(axes, "x")
    axes.set_yticks(range(len(methods)), [run.label(method) for method in methods])
    axes.set_ylim(len(methods) - 0.5, -0.5)
    axes.set_xlabel("frames per second")
    grid(axes, "x")
    caption = (
        f"{garment}: frames per second of each network with its skinning, one frame at a time (hollow) and "
    )
    caption += "many bodies at once (full), both on one core."
    return [save(figure, folder, "throughput", caption=caption, kind="throughput")]
