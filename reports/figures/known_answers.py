"""Checks with a known answer: how many tolerances each lies away from it."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from reports.figures.figure import Drawing
from reports.figures.plotting import fit, log_axis, new_panels
from reports.run.finished_run import Run
from reports.statistics.outcomes import checks, tolerances_away
from reports.tables.number_texts import number

LOWEST = 1e-6  # tolerances away: what is nearer is drawn here


def known_answers(run: Run) -> Iterator[Drawing]:
    """Draw in order how many tolerances two checks or more lie from their answers."""
    away = [tolerances_away(row) for row in checks(run).itertuples()]
    known = sorted(float(x) for x in away if x is not None and math.isfinite(x))
    if len(known) < 2:
        return
    figure, (axes,) = new_panels(1)
    heights = np.maximum(known, LOWEST)
    axes.plot(range(1, len(known) + 1), heights, "o", color="#0072B2", markersize=3)
    axes.axhline(1.0, color="#D55E00", linewidth=1.2)
    axes.annotate("tolerance", (1, 1.0), (0, 3), textcoords="offset points", fontsize=8, color="#B04A00")
    axes.set_ylim(LOWEST / 2.0, max(3.0, 2.0 * heights[-1]))
    axes.set(xlabel="checks, in order", ylabel="tolerances away")
    log_axis(axes, "y")
    fit(figure)
    caption = f"{len(known)} checks with a known answer: distance from it over the tolerance"
    caption += f"; {number(LOWEST, 1)} stands for all that is less."
    yield Drawing(figure, "known_answers", caption)
