"""Energies frame by frame, the cells behind the means, curvatures, sizes of meshes, and checks."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from reports.figures.plotting import (
    PAGE_WIDTH,
    Picture,
    file_name,
    grid,
    legend_above,
    log_axis,
    new_figure,
    save,
    wrapped,
)
from reports.figures.styles import leading, style
from reports.run.rows import Run
from reports.statistics.means import means
from reports.tables.numbers import number

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from reference_sim.trajectory.trajectory import Trajectory

SERIES_TERMS = ("strain", "bending", "inertia")
DOTTED = ("energy/total", "curvature/error", "penetration/vertices")
SIZED, VERTICES, STEPS = ("curvature/error", "curvature/mean"), "mesh/vertices", "mesh/steps"
EVERY = 3  # of a roll-out's frames, in histograms
RARE = 0.01  # [%] the lowest share that they show
MOST_LINES = 24  # methods that have room below each other
LEAST = 1e-6  # tolerances away: what is nearer is drawn here


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


def dots(folder: Path, run: Run) -> list[Picture]:
    """The cells behind the means of the first garment: a dot per motion and seed, a bar at the mean."""
    garment, rows = next(
        ((g, run.worn[run.worn["garment"] == g]) for g in run.garments(run.worn)), ("", run.worn)
    )
    rows = rows[rows["usable"]]
    shown = [name for name in DOTTED if name in set(rows["metric"])]
    methods = leading(run, set(rows[rows["metric"].isin(shown)]["method"]))[:MOST_LINES]
    if not shown or not methods or not garment:
        return []
    found = means(rows[rows["metric"].isin(shown)], "method", "metric")
    labels = [wrapped(run.label(method), 28) for method in methods]
    lines = max(label.count("\n") + 1 for label in labels)
    figure = new_figure(PAGE_WIDTH, 0.65 + (0.04 + 0.13 * lines) * len(methods))
    for axes, name in zip(np.atleast_1d(figure.subplots(1, len(shown), sharey=True)), shown):
        for place, method in enumerate(methods):
            mean = found.get((method, name))
            if mean is None:
                continue
            look, values = style(run, method), np.array(list(mean.cells.values()))
            axes.plot(values, np.full(len(values), place), look.marker, color=look.colour, alpha=0.55,
                markersize=4, linestyle="none")  # fmt: skip
            axes.plot([mean.value] * 2, [place - 0.36, place + 0.36], color="#111111", linewidth=1.4)
        every = np.concatenate(
            [list(found[m, name].cells.values()) for m in methods if (m, name) in found.index]
        )
        if every.min() > 0.0 and every.max() > 20.0 * every.min():
            axes.set_xlim(every.min() / 1.3, every.max() * 1.3)
            log_axis(axes, "x")
        axes.set_xlabel(run.metrics[name].heading)
        grid(axes, "x")
    figure.axes[0].set_yticks(range(len(methods)), labels)
    figure.axes[0].set_ylim(len(methods) - 0.4, -0.6)
    caption = f"{garment}: each motion and seed behind the means; the bar is the mean."
    return [save(figure, folder, "dots", caption=caption, kind="dots")]


def histograms(
    folder: Path, run: Run, scene: str, series: Mapping[str, Trajectory], rest: np.ndarray | None
) -> Picture:
    """How often vertices have which mean curvature, and change of area, in a roll-out; a line per method.

    rest: areas (F,) [m^2] of faces at rest.
    """
    from reports.page.vertex_values import area_change, mean_curvature

    methods = leading(run, series)
    frames = min(series[method].frames for method in methods)
    some = {m: series[m].positions[frames // 5 : frames : EVERY] for m in methods}
    panels = {"mean curvature [1/m]": {m: mean_curvature(x, series[m].faces) for m, x in some.items()}}
    if rest is not None and all(len(series[m].faces) == len(rest) for m in methods):
        panels["change of area [%]"] = {m: area_change(x, series[m].faces, rest) for m, x in some.items()}
    figure = new_figure(PAGE_WIDTH, 2.2)
    for axes, (title, found) in zip(np.atleast_1d(figure.subplots(1, len(panels))), panels.items()):
        ends = [np.percentile(own, (1.0, 98.0)) for own in found.values()]
        low, high = min(end[0] for end in ends), max(end[1] for end in ends)
        edges = np.linspace(low, max(high, low + 1e-9), 41)
        for method in reversed(methods):
            share = 100.0 * np.histogram(found[method], edges)[0] / found[method].size
            middles, look = 0.5 * (edges[1:] + edges[:-1]), style(run, method)
            axes.plot(middles, np.maximum(share, RARE), color=look.colour, linestyle=look.line)
        axes.set(xlabel=title, ylabel="share of vertices [%]", ylim=(RARE, None))
        log_axis(axes, "y")
        grid(axes)
    legend_above(figure, [style(run, method) for method in methods], lines=True)
    caption = f"{scene}: of all vertices, in one frame of {EVERY}."
    return save(figure, folder, "histograms", caption=caption, kind="histograms")


def against_vertices(folder: Path, run: Run) -> list[Picture]:
    """Errors against the number of vertices, a line per method, of a garment's scenes that declare it."""
    rows = run.frame[run.frame["usable"] & (run.frame["garment"] != "")]
    finer = rows[(rows["metric"] == STEPS) & (rows["value"] > 1.0)]["scene"]
    rows = rows[~rows["scene"].isin(finer)]
    sizes = rows[rows["metric"] == VERTICES].drop_duplicates("scene").set_index("scene")["value"]
    rows = rows[rows["scene"].isin(sizes.index) & (rows["method"] != "")]
    shown = [name for name in SIZED if len(rows[rows["metric"] == name])]
    if sizes.nunique() < 2 or not shown:
        return []
    figure = new_figure(PAGE_WIDTH / 2, 2.5)
    drawn: set[str] = set()
    for axes, name in zip(np.atleast_1d(figure.subplots(1, len(shown))), shown):
        own = rows[rows["metric"] == name].assign(size=lambda r: r["scene"].map(sizes))
        for method, line in own.groupby("method"):
            curve = line.groupby("size")["value"].mean()
            look = style(run, str(method))
            axes.plot(curve.index, curve.to_numpy(), color=look.colour, marker=look.marker, markersize=4)
            drawn.add(str(method))
        axes.set(xlabel="vertices", ylim=(0.0, None))
        axes.set_ylabel(run.metrics[name].heading)
        grid(axes)
    legend_above(figure, [style(run, method) for method in run.ordered(drawn)], lines=False)
    caption = "The same motion on meshes of several sizes, each beside the simulation on its own mesh."
    return [save(figure, folder, "against_vertices", caption=caption, kind="sizes")]


def known_answers(folder: Path, run: Run) -> list[Picture]:
    """Every check as a mark: how many tolerances it lies from its known answer."""
    from reports.tables.tables import checks, tolerances_away

    rows = checks(run)
    away = np.array([np.nan if (far := tolerances_away(row)) is None else far for row in rows.itertuples()])
    judged = np.sort(away[np.isfinite(away)])
    if len(judged) < 2:
        return []
    figure = new_figure(PAGE_WIDTH, 1.75)
    axes = figure.subplots()
    heights = np.maximum(judged, LEAST)
    axes.plot(range(1, len(judged) + 1), heights, "o", color="#0072B2", markersize=3)
    axes.axhline(1.0, color="#D55E00", linewidth=1.2)
    axes.annotate("tolerance", (1, 1.0), (0, 3), textcoords="offset points", fontsize=8, color="#B04A00")
    axes.set_ylim(LEAST / 2.0, max(3.0, 2.0 * heights[-1]))
    axes.set(xlabel="checks, in order", ylabel="tolerances away")
    log_axis(axes, "y")
    grid(axes)
    caption = f"{len(judged)} checks with a known answer: distance from it over the tolerance"
    caption += f"; {number(LEAST, 1)} stands for all that is less."
    return [save(figure, folder, "known_answers", caption=caption, kind="known answers")]
