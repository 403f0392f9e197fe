"""The plots of a run. Each maker draws one kind of figure and says what it shows."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.results import Row
from reports import palette
from reports.canvas import (
    PAGE_WIDTH,
    Picture,
    file_name,
    grid,
    legend_above,
    log_axis,
    new_figure,
    power_text,
    save,
    wrapped,
)
from reports.stability import outcome_columns
from reports.summary import suite_rows
from reports.tables import check_name
from reports.vtkhdf import MeshSeries

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SERIES_TERMS = ("strain", "bending", "inertia")
CHECKS_PER_FIGURE = 40
CASES_PER_FIGURE = 34
LEAST = 1e-6  # tolerances; what is closer is drawn on the edge


def energy_series(folder: Path, scene: str, series: dict[str, MeshSeries]) -> Picture | None:
    """Strain, bending and inertia per frame, one panel each, one curve per method (the paper's figure)."""
    terms = [t for t in SERIES_TERMS if any(f"energy/{t}" in mesh.fields for mesh in series.values())]
    methods = [m for m in series if any(f"energy/{t}" in series[m].fields for t in terms)]
    methods = palette.leading(methods)
    if not terms or not methods:
        return None
    figure = new_figure(PAGE_WIDTH, 2.35)
    panels = np.atleast_1d(figure.subplots(1, len(terms)))
    for axes, term in zip(panels, terms):
        for method in reversed(methods):  # the reference last, on top
            mesh = series[method]
            values = mesh.fields.get(f"energy/{term}")
            if values is not None:
                look = palette.style(method)
                shown = np.where(np.isfinite(values) & (values > 0.0), values, np.nan)
                axes.plot(mesh.times, shown, color=look.colour, linestyle=look.line)
        _log_energy_axis(axes)
        axes.set(title=term.capitalize(), xlabel="time [s]")
        grid(axes)
    panels[0].set_ylabel("energy [J]")
    legend_above(figure, methods, lines=True)
    caption = f"{scene}: energy of each frame by term, logarithmic. A frame with no energy at all is a gap."
    name = f"energy_series_{file_name(scene)}"
    return save(figure, folder, name, caption=caption, section="garments", kind="series")


def _log_energy_axis(axes: Axes) -> None:
    """Logarithmic, cut four decades below the top so that frames at rest do not squeeze the rest."""
    values = np.concatenate([np.asarray(line.get_ydata(), dtype=float) for line in axes.get_lines()])
    values = values[np.isfinite(values)]
    if len(values):
        top = float(values.max())
        axes.set_ylim(max(float(values.min()) / 1.5, top * 1e-4), top * 1.6)
        log_axis(axes, "y")


def validation_dots(folder: Path, rows: Sequence[Row]) -> list[Picture]:
    """How far each check is from its expected value, in units of its tolerance: left of 1 passes."""
    checks = [
        row
        for row in suite_rows(rows, "validation")
        if None not in (row.value, row.expected, row.tolerance) and np.isfinite(row.value or 0.0)
    ]
    pictures = []
    for part, first in enumerate(range(0, len(checks), CHECKS_PER_FIGURE)):
        shown = checks[first : first + CHECKS_PER_FIGURE]
        labels = [wrapped(check_name(row)) for row in shown]
        pitch = 0.28 if any("\n" in label for label in labels) else 0.19
        figure = new_figure(PAGE_WIDTH, 0.75 + pitch * len(shown))
        axes = figure.subplots()
        ratios = [_tolerances_away(row) for row in shown]
        for place, (row, ratio) in enumerate(zip(shown, ratios)):
            good = row.status == "ok"
            axes.plot(
                min(max(ratio, LEAST), 1 / LEAST),
                place,
                marker="o" if good else "X",
                color=palette.STATUS_COLOURS["ok" if good else "diverged"],
                markerfacecolor="white" if ratio < LEAST else None,
                markersize=5.5,
                linestyle="none",
                clip_on=False,
            )
        axes.axvline(1.0, color="#444444", linewidth=1.0)
        axes.set_xscale("log")
        axes.set_xlim(LEAST, max(10.0, axes.get_xlim()[1]))
        axes.set_yticks(range(len(shown)), labels)
        axes.set_ylim(len(shown) - 0.4, -0.6)
        axes.set_xlabel("distance from the expected value, in tolerances (a check passes left of 1)")
        grid(axes)
        caption = "Checks with a known answer. Circle: passed; cross: failed."
        if min(ratios) < LEAST:
            caption += " Hollow, on the left edge: closer than a millionth of the tolerance."
        name = f"validation_{part + 1}"
        pictures.append(save(figure, folder, name, caption=caption, section="validation", kind="dots"))
    return pictures


def _tolerances_away(row: Row) -> float:
    """|measured - expected| / tolerance; a number that must be exact is 0 or infinitely many away."""
    distance = abs((row.value or 0.0) - (row.expected or 0.0))
    if not row.tolerance:
        return 0.0 if distance == 0.0 else float("inf")
    return distance / row.tolerance


def extremes_outcomes(folder: Path, rows: Sequence[Row]) -> list[Picture]:
    """Cases by methods, each cell coloured and worded by how it ended."""
    found = [row for row in suite_rows(rows, "extremes") if row.metric == "outcome"]
    cases = list(dict.fromkeys(row.scene for row in found))
    methods = palette.ordered(row.method for row in found)
    if len(methods) == 1 and len(cases) == len(found):
        return [outcome_columns(folder, found)]
    pictures = []
    for part, first in enumerate(range(0, len(cases), CASES_PER_FIGURE)):
        shown = cases[first : first + CASES_PER_FIGURE]
        labels = [wrapped(case) for case in shown]
        pitch = 0.3 if any("\n" in label for label in labels) else 0.21
        figure = new_figure(min(PAGE_WIDTH, 2.9 + 1.7 * len(methods)), 0.4 + pitch * len(shown))
        axes = figure.subplots()
        for row in found:
            if row.scene in shown:
                _outcome_cell(axes, row, methods.index(row.method), shown.index(row.scene))
        axes.set_xlim(-0.5, len(methods) - 0.5)
        axes.set_ylim(len(shown) - 0.5, -0.5)
        axes.set_xticks(range(len(methods)), [palette.label(method) for method in methods])
        axes.xaxis.tick_top()
        axes.set_yticks(range(len(shown)), labels)
        axes.tick_params(length=0)
        for spine in axes.spines.values():
            spine.set_visible(False)
        caption = "How each extreme case ended; the number is the largest gradient left in vertex weights."
        name = f"extremes_{part + 1}"
        pictures.append(save(figure, folder, name, caption=caption, section="extremes", kind="outcomes"))
    return pictures


def _outcome_cell(axes: Axes, row: Row, column: int, line: int) -> None:
    """A pale cell with a strip of the status's full colour at its left."""
    from matplotlib.colors import to_rgb
    from matplotlib.patches import Rectangle

    colour = np.array(to_rgb(palette.STATUS_COLOURS[row.status]))
    pale = tuple(1.0 - 0.28 * (1.0 - colour))
    axes.add_patch(Rectangle((column - 0.48, line - 0.43), 0.96, 0.86, facecolor=pale, linewidth=0))
    axes.add_patch(Rectangle((column - 0.48, line - 0.43), 0.03, 0.86, facecolor=tuple(colour), linewidth=0))
    words = "converged" if row.status == "ok" else row.status
    axes.text(column - 0.4, line, words, ha="left", va="center", fontsize=8)
    if row.value is not None and np.isfinite(row.value):
        axes.text(column + 0.45, line, power_text(row.value), ha="right", va="center", fontsize=8)
