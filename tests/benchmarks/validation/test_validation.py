"""Known answers: every case passes, and a number is judged as it should be."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from benchmarks.validation.case import Case, cases_of, known_answer
from benchmarks.validation.clamped_strip import exact_elastica
from benchmarks.validation.equilibrium import fitted_order
from benchmarks.validation.registry import CASES, KNOWN_ANSWERS
from benchmarks.validation.time_steps import VISCOSITY, Viscosity, halving_order
from reference_sim import Cloth, Material, Potential
from reference_sim.energies import Step
from tests.benchmarks.plan.planned import planned


@pytest.mark.parametrize(
    "case",
    [
        pytest.param(case, id=case.name, marks=[] if case.smoke else [pytest.mark.slow])
        for case in KNOWN_ANSWERS
    ],
)
def test_a_known_answer_is_found(case):
    row = case.run()
    assert row.status == "ok", row.reason
    assert (row.suite, row.scene, row.method, row.metric) == ("validation", case.name, "simulation", "check")


def test_every_case_has_a_name_of_its_own_and_a_reason():
    names = [case.name for case in CASES]
    assert len(set(names)) == len(set(CASES)) == len(names)
    assert all(case.reason for case in KNOWN_ANSWERS)


def test_study_smoke_runs_the_quick_ones_unless_one_is_named():
    assert planned("full:validation").cases == KNOWN_ANSWERS
    smoke = tuple(case for case in KNOWN_ANSWERS if case.smoke and not case.long)
    assert planned("smoke:validation").cases == smoke
    (case,) = planned("smoke:validation", "--scenes", "slit_annulus_inner").cases
    assert case.name == "slit_annulus_inner"


def given(number: object) -> object:
    return number


@pytest.mark.parametrize(
    ("number", "expected", "tolerance", "status"),
    [
        (1.0, 1.0, 0.0, "ok"),
        (1.2, 1.0, 0.1, "failed"),
        ((1.2, 1.15), None, 0.1, "ok"),
        ((1.2, 1.0), None, 0.1, "failed"),
        (7.0, None, None, "ok"),
        (7.0, 3.0, None, "ok"),
        (7.0, None, 0.1, "failed"),
        (math.nan, None, None, "failed"),
        ("text", 1.0, 0.1, "failed"),
    ],
)
def test_how_a_number_is_judged(number, expected, tolerance, status):
    case = Case(
        name="planted", description="", reason="planted", module=__name__, function="given",
        options={"number": number}, expected=expected, tolerance=tolerance,
    )  # fmt: skip
    row = case.run()
    assert row.status == status and (status == "ok" or row.reason)
    assert row.tolerance == tolerance
    if isinstance(number, tuple):
        assert (row.value, row.expected) == number


@known_answer(["planted_sum", "planted_exact"], tolerance=0.5, reason="planted")
@known_answer({"planted_option": {"sign": -1.0}}, smoke=False, expected=3.0, reason="planted")
def two_at_once(sign: float = 1.0) -> dict[str, object]:
    """Return the planted numbers of several cases.

    Not described by this.
    """
    return {"planted_sum": (sign, 1.2), "planted_exact": 2.0, "planted_option": 2.0 + sign}


def test_a_declaration_stands_on_its_function():
    cases = {case.name: case for case in cases_of(__name__)}
    assert list(cases) == ["planted_option", "planted_sum", "planted_exact"]
    assert [case.smoke for case in cases.values()] == [False, True, True]
    assert cases["planted_sum"].description == "planted numbers of several cases"
    assert cases["planted_option"].description == "planted numbers of several cases: sign = -1.0"
    rows = {name: case.run() for name, case in cases.items()}
    found = {name: (row.value, row.expected, row.status) for name, row in rows.items()}
    assert found["planted_sum"] == (1.0, 1.2, "ok") and found["planted_option"] == (1.0, 3.0, "ok")
    assert found["planted_exact"] == (2.0, None, "failed")  # a tolerance, but nothing to compare with


def test_order_is_the_slope():
    assert fitted_order([4e-3, 1e-3, 2.5e-4], [1, 0.5, 0.25]) == pytest.approx(2)
    assert all(math.isnan(fitted_order([1.0, error], [1, 0.5])) for error in (0.0, math.inf))


@pytest.mark.parametrize("order", [0.5, 1, 2])
def test_order_by_halving_needs_no_exact_answer(order):
    limit, error = np.random.default_rng(0).normal(size=(2, 5, 3))
    estimate = halving_order(lambda n: limit + error / n**order, (10, 20, 40, 80))
    assert estimate == pytest.approx(order)


def test_viscous_edges_resist_what_stretches_and_not_what_moves_alike():
    rest = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    term = Viscosity(Cloth(rest, np.array([[0, 1, 2]]), Material()))
    term.prepare(Step(previous=rest, velocity=0 * rest, guess=rest, dt=0.1))
    assert np.abs(term.value_and_gradient(rest + np.array([1.0, 2.0, 3.0]))[1]).max() == 0.0
    apart = rest.copy()
    apart[1, 0] += 0.2  # at 2 m/s from both other vertices
    value, gradient = term.value_and_gradient(apart)
    assert gradient[:, 0] == pytest.approx([-2 * VISCOSITY, 4 * VISCOSITY, -2 * VISCOSITY])
    assert value == pytest.approx(2 * VISCOSITY * 0.2**2 / 2 / 0.1)
    hessian = Potential([term]).hessian(apart).toarray()
    assert (hessian @ (apart - rest).ravel()).reshape(3, 3) == pytest.approx(gradient)


@pytest.mark.parametrize("gamma", [0.5, 8.0, 40.0])
def test_the_elastica_is_that_of_shooting(gamma):
    """Another method than the collocation of the code."""

    def at_end(curvature):
        def slope(s, y):
            return [y[1], -gamma * (1 - s) * np.cos(y[0]), np.cos(y[0]), np.sin(y[0])]

        return solve_ivp(slope, (0, 1), [0, curvature, 0, 0], rtol=1e-10, atol=1e-12).y[:, -1]

    end = at_end(brentq(lambda curvature: at_end(curvature)[1], 0.0, gamma / 2))
    assert exact_elastica(gamma, 0.0)[1][:, -1] == pytest.approx(end[2:], rel=1e-5)
