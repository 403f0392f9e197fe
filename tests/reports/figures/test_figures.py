"""Styles of methods, figures of the report, and curves of the plane of run time and error."""

from __future__ import annotations

from reports.figures import plotting
from reports.figures.charts import curves_of
from reports.statistics.pareto import Point
from tests.reports.report_folder import row, run_of


def test_methods_keep_their_order_and_their_look():
    names = ["zebra", "newton-8", "snug", "newton-2", "simulation", "newton-4", "skinning"]
    run = run_of([row(method=name) for name in names])
    known = ["simulation", "skinning", "snug", "zebra", "newton-2", "newton-4", "newton-8"]
    assert run.ordered(names) == known
    assert plotting.style(run, "newton-2").label == "Newton, 2 iterations"
    assert plotting.style(run, "newton-2").colour == plotting.style(run, "newton-4").colour


# method: run time, error
POINTS = {
    "snug": (0.2, 0.02), "skinning": (0.1, 0.6), "lbfgs-5": (8.0, 0.016), "lbfgs-20": (13.0, 0.0018),
    "newton-1": (10.0, 0.26), "newton-4": (24.0, 0.0008), "snug+lbfgs-1": (7.0, 0.015),
    "snug+lbfgs-4": (7.5, 0.014), "simulation-perturbed-1e-4": (40.0, 1e-9),
}  # fmt: skip


def curves(*methods: str):
    run = run_of([row(method=name) for name in methods])
    return curves_of(run, [Point(name, *POINTS[name]) for name in methods])


def test_solvers_stopped_early_are_one_curve_and_variants_of_the_reference_stand_alone_or_not_at_all():
    *alone, solvers, started = curves(*POINTS)
    assert [curve.look.label for curve in alone] == ["SNUG", "Skinning alone"]
    assert [p.method for p in solvers.points] == ["lbfgs-5", "lbfgs-20", "newton-4"]
    assert [p.method for p in solvers.aside] == ["newton-1"]
    assert [p.method for p in started.points] == ["snug+lbfgs-1", "snug+lbfgs-4"]
    assert started.look.colour == alone[0].look.colour != solvers.look.colour
    assert started.look.label == "SNUG + solver"
    assert len(curves("simulation-perturbed-1e-4")) == 1
