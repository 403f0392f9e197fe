"""Relative excess: 0 % is the reference, 100 % skinning alone, whatever else a run has."""

from __future__ import annotations

import numpy as np
import pytest

from reports.statistics.relative_excess import RELATIVE_EXCESS, add_excess
from reports.tables.findings import relative_excess
from tests.reports.report_folder import row, run_of

ENSEMBLE = "simulation-perturbed-1e-4"


def shares(*rows):
    run = run_of(rows)
    frame = add_excess(run, run.frame)
    return frame[frame["metric"] == RELATIVE_EXCESS.name].set_index("method")


def of(method, value, metric="energy/total", **more):
    return row("tshirt/kick", method, metric, value, **more)


def test_a_method_that_is_declared_a_baseline_is_not_skinning():
    """A user's method is one by default, and may come before skinning or without it."""
    rows = of("simulation", 1.0), of("untrained", 5.0), of("snug", 1.5)
    assert shares(*rows).empty
    table = shares(*rows, of("skinning", 2.0))
    values = {"simulation": 0.0, "skinning": 100.0, "snug": 50.0, "untrained": 400.0}
    assert table["value"].to_dict() == pytest.approx(values)


@pytest.mark.parametrize("status, members", [("ok", [ENSEMBLE]), ("stalled", [])])
def test_a_member_of_the_ensemble_that_stalled_takes_no_part(status, members):
    reason = "?" * (status != "ok")
    member = of(ENSEMBLE, 1.2, status=status, reason=reason)
    table = shares(of("simulation", 1.0), member, of("skinning", 2.0), of("snug", 1.5))
    assert [name for name, _ in table.loc["snug", "moved"]] == members


def test_means_are_over_sources_recorded_ones_apart_and_the_pooled_share_over_motions():
    energies = {"01_01_a": (10.0, 100.0), "01_01_b": (20.0, 100.0), "kick": (180.0, 300.0)}
    rows = [
        row(f"tshirt/{motion}", method, "energy/total", value)
        for motion, (energy, skinning) in energies.items()
        for method, value in (("simulation", 0.0), ("skinning", skinning), ("snug", energy))
    ]
    (table,) = relative_excess(run_of(rows))
    cells = dict(zip((column.name for column in table.columns), table.rows[0]))
    recorded = (np.arcsinh(10.0) + np.arcsinh(20.0)) / 2.0
    assert cells["recorded"] == pytest.approx(np.sinh(recorded))
    assert cells["others"] == pytest.approx(60.0)
    assert cells["typical"].shown == pytest.approx(np.sinh((recorded + np.arcsinh(60.0)) / 2.0))
    assert cells["pooled"] == pytest.approx(100.0 * (10.0 + 20.0 + 180.0) / 500.0)


def test_a_method_with_less_energy_than_a_finer_simulation_is_below_zero_against_it():
    energies = {"simulation": 1.0, "simulation-dt/4": 1.4, "skinning": 2.4, "snug": 1.2, "pbns": 1.6}
    rows = [row(f"tshirt/{c}", name, "energy/total", x) for name, x in energies.items() for c in "ab"]
    _, table = relative_excess(run_of(rows))
    assert [column.name for column in table.columns[2:]] == ["simulation", "simulation-dt/4"]
    cells = {method: numbers for _, method, *numbers in table.rows}
    assert cells == {
        "snug": pytest.approx([100 * 0.2 / 1.4, -20.0]), "pbns": pytest.approx([100 * 0.6 / 1.4, 20.0])
    }  # fmt: skip


def test_a_garment_that_fell_off_has_no_excess():
    """Its weight lies lower than that of any garment that is worn."""
    rows = of("simulation", 1.0), of("skinning", 2.0), of("pbns", 0.5), of("snug", -1.0)
    table = shares(*rows)
    assert table.loc["pbns", "value"] == pytest.approx(-50.0)
    assert list(table.index[~table["usable"].astype(bool)]) == ["snug"]
    (table,) = relative_excess(run_of(rows))
    assert [row[1] for row in table.rows] == ["pbns"]


@pytest.mark.parametrize(
    ("gravity", "total", "worn"), [(-12.0, 1.4, True), (1.4, -1.0, False), (-12.0, None, False)]
)
def test_the_total_says_what_fell_off_and_gravity_where_there_is_none(gravity, total, worn):
    values = {"simulation": (1.0, 1.0), "skinning": (2.0, 2.0), "snug": (gravity, total)}
    rows = [of(m, x, metric=f"energy/{term}") for m, pair in values.items()
        for term, x in zip(("gravity", "total"), pair) if x is not None]  # fmt: skip
    run = run_of(rows)
    frame = add_excess(run, run.frame, "energy/gravity").query("metric == 'relative_excess/gravity'")
    assert frame.set_index("method")["usable"]["snug"] == worn


def test_a_seed_that_fell_off_is_not_in_the_pooled_share():
    totals = {"simulation": 1.0, "skinning": 2.0, "snug": 1.5}
    rows = [row(f"tshirt/{clip}", m, "energy/total", x) for clip in "ab" for m, x in totals.items()]
    (table,) = relative_excess(run_of([*rows, row("tshirt/a", "snug", "energy/total", -2.0, seed=1)]))
    cells = dict(zip((column.name for column in table.columns), table.rows[0]))
    assert (cells["method"], cells["pooled"]) == ("snug", pytest.approx(50.0))
