"""Charts of the report: error and total cost against time, energies, dots.

Relative excess takes the place of the total energy where the run has it. It spans decades and may be below
zero, so its dots stand on the scale of its statistics, arcsinh(x / 1 %).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from benchmarks.metric import Metric
from benchmarks.results.protocol import SOFTENING
from reports.figures.figure import Drawing
from reports.figures.plane import SOLVERS, curves_of, draw_points
from reports.figures.plotting import (
    arcsinh_axis,
    few,
    file_name,
    fit,
    leading,
    log_axis,
    new_panels,
    style,
    wrapped,
)
from reports.finished_run import Run, shown_seeds
from reports.statistics.means_and_spreads import Mean, means, value_of
from reports.statistics.pareto import (
    ERRORS,
    Point,
    compared_cells,
    compared_costs,
    compared_scenes,
    crossing,
    error_points,
    indistinct,
    rivals,
    run_time,
    time_label,
)
from reports.statistics.relative_excess import RELATIVE_EXCESS, TOTAL, excess_of, with_relative_excess

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def error_of_page_one(run: Run) -> Iterator[Drawing]:
    """Draw an error of the leading scene in one wide panel: the first that two methods or more have."""
    frame, scenes = compared_cells(run)
    for scene in scenes:
        rows = frame[frame["scene"] == scene]
        for name in ERRORS:
            points = error_points(run, rows, name)
            if len(points) > 1:
                yield _draw_page_one(run, rows, run.metrics[name], points)
                return


def _draw_page_one(run: Run, rows: pd.DataFrame, metric: Metric, points: Sequence[Point]) -> Drawing:
    """Draw one error of a scene in a wide panel, solvers stopped early as one curve."""
    time = run_time(rows)
    figure, (axes,) = new_panels(1)
    curves = curves_of(run, points)
    reference = value_of(rows, run.reference, time)
    drawn = draw_points(axes, run, curves, reference, indistinct(run, rows, metric.name))
    axes.set(xlabel=time_label(time), ylabel=metric.heading)
    fit(figure, drawn.entries, markers=True)
    caption = f"{rows['scene'].iloc[0]}: lower left is better. Pale line: the best at each time."
    for solvers in (curve for curve in curves if curve.look is SOLVERS):
        first, last = (run.label(solvers.points[end].method) for end in (0, -1))
        caption += f" {SOLVERS.label}: from {first} to {last}"
        caption += "; faint: solvers that another beats in both." if solvers.aside else "."
    caption += " Grey: within the reference's uncertainty." if drawn.band else ""
    if drawn.below:
        names = ", ".join(run.label(method) for method in run.ordered(drawn.below))
        caption += f" Hollow, on the lower edge: zero or below the panel ({names})."
    return Drawing(figure, "error_against_time", caption)


MOST_FRAMES = 1e7


def break_even(run: Run) -> Iterator[Drawing]:
    """Draw total time against the number of frames, in the scenes of the first garment with timed solvers.

    Each trained network and each solver has a line; a dot stands where a training has paid.
    """
    frame = run.cells("speed", "garments")
    scenes = next(iter(compared_scenes(run, frame).values()), [])
    trained, others = compared_costs(run, frame, scenes, rivals(run, frame, scenes))
    shown = few(run, (cost.method for cost in trained))
    trained = [cost for cost in trained if cost.method in shown]
    if not trained or len(trained) + len(others) < 2:
        return
    costs = [*others, *trained]
    figure, (axes,) = new_panels(1)
    frames = np.logspace(0, math.log10(MOST_FRAMES), 200)
    for cost in costs:
        look = style(run, cost.method)
        axes.plot(frames, [cost.total(n) for n in frames], color=look.colour, linestyle=look.line)
    for network, rival in itertools.product(trained, others):
        met = crossing(network, rival)
        if met is not None and 1.0 <= met <= MOST_FRAMES:
            colour = style(run, network.method).colour
            axes.plot(met, network.total(met), "o", color=colour, markersize=4.5)
    axes.set(xlabel="frames", ylabel="data, training and frames [s]")
    log_axis(axes, "x")
    log_axis(axes, "y")
    fit(figure, [style(run, m) for m in run.ordered(cost.method for cost in costs)])
    caption = f"Total time against the number of frames ({', '.join(scenes)}). "
    yield Drawing(figure, "break_even", caption + "Dots: where a training has paid.")


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


METRICS = (TOTAL, "curvature/error", "penetration/vertices")
MOST_METHODS = 24  # methods that have room below each other


def dots(run: Run) -> Iterator[Drawing]:
    """Draw cells behind the means of the first garment, a panel for each metric, a line for each method."""
    rows = run.garment_rows
    rows = rows[(rows["garment"] == run.first_garment) & rows["usable"] & rows["metric"].isin(METRICS)]
    methods = leading(run, set(rows["method"]))[:MOST_METHODS]
    if not run.first_garment or not methods:
        return
    rows = with_relative_excess(run, rows)
    measured = set(rows[rows["method"].isin(methods)]["metric"])
    names = [name for name in METRICS if name in measured]
    excess = RELATIVE_EXCESS.name if RELATIVE_EXCESS.name in measured else ""
    if excess:
        names[0] = excess
    by_method = means(rows, "method", "metric")
    labels = [wrapped(run.label(method), 28) for method in methods]
    lines = max(label.count("\n") + 1 for label in labels)
    figure, panels = new_panels(len(names), 3, sharey=True)
    for axes, name in zip(panels, names):
        of_methods = [by_method.get((method, name)) for method in methods]
        bars = [mean and mean.value for mean in of_methods]
        if name == excess:
            bars = [known and known.typical for known in (excess_of(run, rows, m) for m in methods)]
        shown = _draw_panel(axes, run, methods, of_methods, bars)
        if name == excess:
            arcsinh_axis(axes, shown, SOFTENING)
        elif min(shown) > 0.0 and max(shown) > 20.0 * min(shown):
            axes.set_xlim(min(shown) / 1.3, max(shown) * 1.3)
            log_axis(axes, "x")
        axes.set_xlabel((RELATIVE_EXCESS if name == excess else run.metrics[name]).heading)
        axes.grid(False, axis="y")
    panels[0].set_yticks(range(len(methods)), labels)
    panels[0].set_ylim(len(methods) - 0.4, -0.6)
    fit(figure, height=(0.04 + 0.13 * lines) * len(methods))
    caption = f"{run.first_garment}: each motion and seed behind the means; the bar is the mean"
    caption += ", of the relative excess its typical value." if excess else "."
    yield Drawing(figure, "dots", caption)


def _draw_panel(
    axes: Axes, run: Run, methods: list[str], of_methods: list[Mean | None], bars: list[float | None]
) -> list[float]:
    """Draw a line of dots for each method, and its bar where it has one; return the values drawn."""
    shown: list[float] = []
    for place, (method, mean, bar) in enumerate(zip(methods, of_methods, bars)):
        if mean is None:
            continue
        look, values = style(run, method), np.array(list(mean.cells.values()))
        shown += values.tolist()
        axes.plot(
            values, np.full(len(values), place), look.marker, color=look.colour, alpha=0.55,
            markersize=4, linestyle="none",
        )  # fmt: skip
        if bar is not None:
            axes.plot([bar] * 2, [place - 0.36, place + 0.36], color="#111111", linewidth=1.4)
    return shown
