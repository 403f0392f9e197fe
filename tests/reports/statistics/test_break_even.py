"""Break-even: what a network costs before its first frame, and the solvers that it is compared with."""

from __future__ import annotations

import pytest

from reports.figures.charts import break_even
from reports.statistics.pareto import Cost, cost_of, crossing, rivals
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


def test_a_training_whose_data_nobody_can_price_has_no_break_even():
    rows = [r for r in all_rows() if r.metric != "cost/data"]
    run = run_of(rows)
    frame = run.cells("speed")
    assert cost_of(frame, "snug", SCENES) is None and cost_of(frame, "newton-1", SCENES) is not None
    assert list(break_even(run)) == []
