"""Charts of the report: error against run time, relative excess by motion, energies frame by frame."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from benchmarks.metric import Metric
from reports.figures.plotting import (
    GRID,
    PAGE_WIDTH,
    PANEL,
    Drawing,
    Style,
    family_style,
    file_name,
    fit,
    log_axis,
    new_figure,
    new_panels,
    power_text,
    style,
)
from reports.finished_run import Run, shown_frames
from reports.statistics.means_and_spreads import value_of
from reports.statistics.outcomes import leads
from reports.statistics.pareto import (
    ERRORS,
    Point,
    error_points,
    front,
    noise_floor,
    run_time,
    select_plot_cells,
    time_label,
)
from reports.statistics.relative_excess import RELATIVE_EXCESS, SKINNING, add_excess
from reports.tables.table import name_scene

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SOLVERS = Style("Solvers stopped early", "#A3324B", "X")
STARTED = "warm-started"  # role of solvers that start from another method
OF_REFERENCE = "reference-variant"  # role of simulations with other options than the reference's


@dataclass(frozen=True)
class Curve:
    """Points that a line joins in their order, a method alone where there is one.

    look: of its line and its entry in the legend. aside: points of its kind that lie off the line.
    """

    points: Sequence[Point]
    look: Style
    aside: Sequence[Point] = ()


def curves_of(run: Run, points: Iterable[Point]) -> list[Curve]:
    """Return a curve for each family, and one for solvers stopped early.

    A curve of solvers joins the best at each run time; the others lie aside. So do those that start from
    one and the same method. Variants of the reference are left out.
    """
    points = list(points)
    marks = [p for p in points if run.methods[p.method].role != OF_REFERENCE] or points
    groups: dict[tuple[bool, str], list[Point]] = {}
    for point in marks:
        method = run.methods[point.method]
        solver = method.level is not None and method.role in ("solver", STARTED)
        key = (True, method.base) if solver else (False, method.family)
        groups.setdefault(key, []).append(point)
    ordered = sorted(groups.items(), key=lambda group: group[0][0])
    return [_solvers(run, members) if early else _family(run, members) for (early, _), members in ordered]


def _solvers(run: Run, members: list[Point]) -> Curve:
    """Return the curve of solvers stopped early, or of those that start from one method."""
    best, look = front(members), SOLVERS
    if base := run.methods[members[0].method].base:
        look = family_style(run, run.methods[members[0].method])
        look = replace(look, label=f"{run.label(base)} + solver", line=":")
    return Curve(best, look, [p for p in members if p not in best])


def _family(run: Run, members: list[Point]) -> Curve:
    """Return the curve of methods that differ by one number, in order of it, or of one method alone."""
    method = run.methods[members[0].method]
    if method.level is None:
        return Curve(members, style(run, method.name))
    levels = {p.method: run.methods[p.method].level or 0.0 for p in members}
    members.sort(key=lambda p: levels[p.method])
    ends = dict.fromkeys(power_text(levels[p.method]) for p in (members[0], members[-1]))
    look = family_style(run, method)
    return Curve(members, replace(look, label=f"{look.label}, {' to '.join(ends)}"))


DECADES = 9  # below the largest error; what is smaller is named, not drawn
GREY, FRONT, BAND = "#B4B4B4", "#DCDCDC", "#F0F0F0"
MARKER, DOT = 5.5, 3.5  # sizes of markers [points]


def draw_points(
    axes: Axes, run: Run, curves: Sequence[Curve], reference: float | None, band: float
) -> set[str]:
    """Draw the curves of one panel; return the methods whose error is zero or too small for it.

    Args:
        axes: of the panel.
        run: has the styles of methods.
        curves: what is drawn.
        reference: run time of the reference [ms per frame], None where unknown.
        band: error below which differences are inconclusive.
    """
    points = [p for curve in curves for p in (*curve.points, *curve.aside)]
    floor = _floor(points, band)
    best = front(p for p in points if p.error > floor)
    if len(best) > 1:
        axes.plot([p.time for p in best], [p.error for p in best], color=FRONT, linewidth=5.0, zorder=1)
    for curve in curves:
        marks = [p for p in curve.points if p.error > floor]
        times, errors = [p.time for p in marks], [p.error for p in marks]
        axes.plot(times, errors, color=curve.look.colour, linestyle=curve.look.line, linewidth=1.1)
        for point in (*marks, *(p for p in curve.aside if p.error > floor)):
            colour = GREY if point.error < band else curve.look.colour
            pale = point in curve.aside
            width, height = point.time_spread / 2, point.error_spread
            axes.errorbar(
                point.time,
                point.error,
                xerr=[[min(width, 0.9 * point.time)], [width]],
                yerr=[[min(height, 0.9 * point.error)], [height]],
                color=colour,
                marker=style(run, point.method).marker,
                markersize=DOT if pale else MARKER,
                elinewidth=0.8,
                zorder=2.2 if pale else 3,
                alpha=0.45 if pale else 1.0,
            )
    if reference:
        axes.axvline(reference, color="black", linestyle=":", linewidth=1.0)
    axes.margins(0.08)
    log_axis(axes, "x")
    log_axis(axes, "y")
    low, high = axes.get_ylim()
    axes.set_ylim(low, high)
    if band > low:
        axes.axhspan(low, band, color=BAND, zorder=0)
    return {p.method for p in points if p.error <= floor}


def _floor(points: Sequence[Point], band: float) -> float:
    """Return the error below which none is drawn: what is within the reference's needs no decades."""
    largest = max((p.error for p in points), default=0.0)
    return max(largest * 10.0**-DECADES, band / 10.0)


def error_of_page_one(run: Run) -> Drawing | None:
    """Draw an error of the leading scene in one wide panel: the first that tells two methods apart."""
    frame, scenes = select_plot_cells(run)
    for scene in scenes:
        rows = frame[frame["scene"] == scene]
        for name in ERRORS:
            points = error_points(run, rows, name)
            band = noise_floor(run, rows, name)
            if sum(p.error > _floor(points, band) for p in points) > 1:
                return _draw_page_one(run, rows, run.metrics[name], points, band)
    return None


def _draw_page_one(
    run: Run, rows: pd.DataFrame, metric: Metric, points: Sequence[Point], band: float
) -> Drawing:
    """Draw one error of a scene in a wide panel, solvers stopped early as one curve.

    band: error below which differences are inconclusive.
    """
    time = run_time(rows)
    figure, (axes,) = new_panels(1)
    curves = curves_of(run, points)
    reference = value_of(rows, run.reference, time)
    below = draw_points(axes, run, curves, reference, band)
    entries = [curve.look for curve in curves]
    if reference:
        entries.append(Style(run.label(run.reference), "black", "", ":"))
    axes.set(xlabel=time_label(time), ylabel=metric.heading)
    fit(figure, entries, markers=True)
    scene = name_scene(rows["scene"].iloc[0])
    caption = f"{scene}: lower left is better."
    if any(line.get_color() == FRONT for line in axes.lines):
        caption += " Pale line: the best at each time."
    for solvers in (c for c in curves if c.look is SOLVERS):
        first, last = (run.label(solvers.points[end].method) for end in (0, -1))
        caption += f" {SOLVERS.label}: from {first} to {last}"
        caption += "; faint: solvers that another beats in both." if solvers.aside else "."
    caption += " Grey: within the reference's uncertainty." if band > axes.get_ylim()[0] else ""
    if below:
        names = ", ".join(run.label(method) for method in run.order(below))
        caption += f" Zero or below the panel: {names}."
    return Drawing(figure, "error_against_time", caption)


MOST_ROWS, ROW = 15, 0.19  # methods, and inches of each


EXPLODED = 1e4  # [%] a median that no axis should hold beside the others


def excess_by_motion(run: Run) -> Drawing | None:
    """Draw relative excess: a row for each method of each garment, a dot for each motion."""
    rows = add_excess(run, run.garment_rows)
    rows = rows[(rows["metric"] == RELATIVE_EXCESS.name) & rows["usable"]]
    rows = rows[~rows["method"].isin([*run.with_role("reference", OF_REFERENCE), SKINNING])]
    excesses = rows.groupby(["garment", "method", "scene"])["value"].mean()
    medians = excesses.groupby(["garment", "method"]).median().sort_values()
    if len(excesses) == len(medians):  # none in two motions
        return None
    several = medians.index.unique("garment").size > 1
    labels = [run.label(name) + f", {garment}" * several for garment, name in medians.index]
    count = min(int((medians < EXPLODED).sum()), MOST_ROWS)
    figure = new_figure(PAGE_WIDTH, max(ROW * count, PANEL) + 0.6)
    axes = figure.add_subplot(xlabel="relative excess [%]")
    axes.set_xscale("symlog", linthresh=10.0, subs=(2, 5) if excesses.max() < 200.0 else (3,))
    for set_formatter in (axes.xaxis.set_major_formatter, axes.xaxis.set_minor_formatter):
        set_formatter(lambda value, _: power_text(value))
    axes.grid(True, axis="x", color=GRID, linewidth=0.6)
    for place, (key, median) in enumerate(medians[:count].items()):
        values, colour = excesses[key], style(run, key[1]).colour
        axes.plot(values, [place] * len(values), "o", color=colour, markersize=DOT, alpha=0.6, mew=0.0)
        axes.plot(median, place, "|", color="black", markersize=9.0)
    axes.set_yticks(range(count), labels[:count])
    axes.invert_yaxis()
    caption = "A dot for each motion: 0 is the simulation, 100 skinning alone; bar: the median."
    caption += f" Higher medians: {', '.join(labels[count:])}." * (len(labels) > count)
    return Drawing(figure, "excess_by_motion", caption)


TERMS = ("strain", "bending", "inertia")
# Least share of the largest energy that is shown: frames at rest would squeeze the rest.
SHARE = 1e-4


def energy_series(run: Run) -> Drawing | None:
    """Draw a panel for each term of one whole motion, a curve per method (the paper's figure 4)."""
    frames = shown_frames(run, run.frame)
    if frames.empty:
        return None
    scene = str(frames["scene"].iloc[0])
    frames = frames[frames["scene"] == scene]
    terms = [term for term in TERMS if term in frames and frames[term].notna().any()]
    have = set(frames.dropna(subset=terms, how="all")["method"])
    methods = leads(run, run.frame[run.frame["method"].isin(have)])
    if not terms or not methods:
        return None
    curves = {method: frames[frames["method"] == method] for method in methods}
    figure, panels = new_panels(len(terms))
    for axes, term in zip(panels, terms):
        for method, curve in reversed(curves.items()):  # the reference last, on top
            look, energy = style(run, method), curve[term].where(curve[term] > 0.0)
            axes.plot(curve["seconds"], energy, color=look.colour, linestyle=look.line)
        energies = np.concatenate([curve[term] for curve in curves.values()])
        energies = energies[np.isfinite(energies) & (energies > 0.0)]
        if len(energies):
            axes.set_ylim(max(energies.min() / 1.5, energies.max() * SHARE), 1.6 * energies.max())
            log_axis(axes, "y")
        axes.set(title=term.capitalize(), xlabel="time [s]")
    panels[0].set_ylabel("energy [J]")
    fit(figure, [style(run, method) for method in methods])
    caption = f"{name_scene(scene)}: energy of each frame by term. A frame without energy is a gap."
    return Drawing(figure, f"energy_series_{file_name(scene)}", caption)
