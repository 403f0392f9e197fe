"""Break-even: what a network costs before its first frame, and the solvers that it is compared with."""

from __future__ import annotations

import dataclasses

import pytest

from reports.figures.charts import break_even
from reports.statistics.pareto import Cost, compared_scenes, cost_of, crossing, rivals
from reports.tables.page_one import error_rivals
from tests.reports.report_folder import row as any_row
from tests.reports.report_folder import run_of
from tests.reports.speed_rows import SCENES, all_rows, row


def test_break_even_is_where_the_total_costs_cross():
    network, solver = Cost("snug", 200.0, 0.001), Cost("simulation", 0.0, 0.101)
    frames = crossing(network, solver)
    assert frames == pytest.approx(2000.0)
    assert network.total(frames) == pytest.approx(solver.total(frames))
    assert crossing(solver, network) is None
    assert crossing(Cost("snug", 200.0, 0.2), solver) is None


def test_what_comes_before_the_first_frame_is_data_making_ready_and_training():
    costs = {"cost/data": 5.0, "cost/setup": 20.0, "cost/train": 200.0}
    rows = [row("tshirt/walk", "supervised", metric, value, "s") for metric, value in costs.items()]
    rows.append(row("tshirt/walk", "supervised", "cost/frame", 2.0, "ms"))
    assert cost_of(run_of(rows).frame, "supervised", ("tshirt/walk",)) == Cost("supervised", 225.0, 0.002)


def test_rivals_are_the_fastest_solvers_as_accurate():
    run = run_of(all_rows())
    reasons = rivals(run, run.cells("speed"), list(SCENES))
    assert reasons == {"simulation": "converged", "lbfgs-20": "energy gap", "lbfgs-5": "curvature error"}


def test_garments_are_compared_by_themselves():
    rows = all_rows()
    # Where no truncated solver was timed, nothing says how fast a solver as good would be.
    rows += [dataclasses.replace(r, scene="skirt/stop", garment="skirt") for r in rows if r.method == "snug"]
    rows += [
        dataclasses.replace(r, scene="tunic/stop", garment="tunic") for r in rows if r.scene == SCENES[0]
    ]
    run = run_of(rows)
    assert list(compared_scenes(run, run.cells("speed"))) == ["tshirt", "tunic"]


def test_a_training_whose_data_nobody_can_price_has_no_break_even():
    rows = [r for r in all_rows() if r.metric != "cost/data"]
    run = run_of(rows)
    frame = run.cells("speed")
    assert cost_of(frame, "snug", SCENES) is None and cost_of(frame, "newton-1", SCENES) is not None
    assert list(break_even(run)) == []


def test_a_solver_in_a_whole_motion_takes_no_clip_off_page_one():
    """The energy gap is measured in suite speed alone."""
    whole = [
        any_row("tshirt/kick", method, "cost/frame", time, unit="ms")
        for method, time in (("snug", 0.3), ("newton-4", 50.0), ("simulation", 100.0))
    ]
    run, alone = run_of([*all_rows(), *whole]), run_of(all_rows())
    frame = run.cells("speed", "garments")
    assert compared_scenes(run, frame) == {"tshirt": sorted(SCENES, reverse=True)}
    assert error_rivals(run) == error_rivals(alone)
    assert compared_scenes(run_of(whole), run_of(whole).frame) == {"tshirt": ["tshirt/kick"]}


def test_a_training_without_rivals_has_no_break_even():
    rows = [r for r in all_rows() if r.method in ("snug", "snug+lbfgs-1") and r.metric != "gap/energy"]
    rows = [r for r in rows if r.metric != "curvature/error"]
    assert list(break_even(run_of(rows))) == []
