"""Table of how trainings ended."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from reports.run.stored_files import History
from reports.tables.costs import trainings
from tests.reports.report_folder import row, run_of


def history(seed: int, end: float, count=50, best_step=float("nan")):
    """A loss of 4 that falls to `end` after four fifths of the steps; logged every 20."""
    losses = [4.0] * (4 * count // 5) + [end] * (count - 4 * count // 5)
    rows = [{"step": 20 * k, "seconds": 0.5 * k, "loss": loss} for k, loss in enumerate(losses, 1)]
    return History("snug", "J", rows, "tshirt", seed, frames=90, best_step=best_step)


def test_how_trainings_ended_is_a_mean_over_seeds():
    (made,) = trainings(replace(run_of([row()]), histories=[history(0, 3.0), history(1, 2.0)]))
    ((garment, method, seeds, *numbers, unit),) = made.rows
    frames, steps, seconds, loss, decrease = numbers
    assert (garment, method, seeds, unit) == ("tshirt", "snug", 2, "J")
    assert (frames, steps, seconds, loss.value) == (90.0, 1000.0, 25.0, 2.5)
    # A quarter of 4, and half of it.
    assert decrease.value == 37.5 and decrease.spread == pytest.approx(12.5 * 2**0.5)
    assert decrease.complete and loss.complete
    (made,) = trainings(replace(run_of([row()]), histories=[history(0, 3.0), history(1, float("nan"))]))
    assert made.rows[0][6].missing == 1
    (made,) = trainings(replace(run_of([row()]), histories=[history(0, 3.0, best_step=20.0)]))
    assert [column.name for column in made.columns][5] == "best" and made.rows[0][5] == 20.0
    assert np.isnan(history(0, 3.0, count=45).decrease)  # nine losses at its end are no ten
    (made,) = trainings(replace(run_of([row()]), histories=[history(0, 3.0, count=9)]))
    assert "decrease" not in [column.name for column in made.columns]  # too few were logged
