"""Relative excess: 0 % is the reference, 100 % skinning alone, whatever else a run has."""

from __future__ import annotations

import pytest

from reports.statistics.relative_excess import RELATIVE_EXCESS, with_relative_excess
from reports.tables.findings import relative_excess
from tests.reports.report_folder import row, run_of

ENSEMBLE = "simulation-perturbed-1e-4"


def shares(*rows):
    run = run_of(rows)
    made = with_relative_excess(run, run.frame)
    return made[made["metric"] == RELATIVE_EXCESS.name].set_index("method")


def of(method, value, **more):
    return row("tshirt/kick", method, "energy/total", value, **more)


def test_a_method_that_is_declared_a_baseline_is_not_skinning():
    """A user's method is one by default, and may come before skinning or without it."""
    given = of("simulation", 1.0), of("untrained", 5.0), of("snug", 1.5)
    assert shares(*given).empty
    made = shares(*given, of("skinning", 2.0))
    assert made.loc[["simulation", "skinning", "snug", "untrained"], "value"].tolist() == pytest.approx(
        [0.0, 100.0, 50.0, 400.0]
    )


@pytest.mark.parametrize("status, members", [("ok", [ENSEMBLE]), ("stalled", [])])
def test_a_member_of_the_ensemble_that_stalled_takes_no_part(status, members):
    reason = "?" * (status != "ok")
    made = shares(
        of("simulation", 1.0),
        of(ENSEMBLE, 1.2, status=status, reason=reason),
        of("skinning", 2.0),
        of("snug", 1.5),
    )
    assert [name for name, _ in made.loc["snug", "moved"]] == members


def test_the_mean_is_over_independent_sources_and_the_caption_says_so():
    energies = {"01_01_a": 10.0, "01_01_b": 20.0, "kick": 60.0}
    rows = [
        row(f"tshirt/{motion}", method, "energy/total", value)
        for motion, energy in energies.items()
        for method, value in (("simulation", 0.0), ("skinning", 100.0), ("snug", energy))
    ]
    (made,) = relative_excess(run_of(rows))
    mean = made.rows[0][[column.name for column in made.columns].index("mean")]
    assert mean == pytest.approx((15.0 + 60.0) / 2.0)
    assert made.caption.endswith("and mean: over independent sources and seeds.")
