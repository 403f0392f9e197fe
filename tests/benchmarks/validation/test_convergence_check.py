"""The check of what a minimiser claims: it catches every kind of lie that one could tell."""

from __future__ import annotations

import dataclasses
import re

import numpy as np
import pytest

from benchmarks.validation import convergence_check
from benchmarks.validation.convergence_check import check_result, optimality_of, solve_and_check
from benchmarks.validation.extreme_steps import sheet_step
from reference_sim import Result, minimise
from reference_sim.energies import StretchStVK


def claiming(positions, status="converged"):
    return Result(positions, status, "so it says", 1, 1, 0.0, 0.0, {})


@pytest.fixture(scope="module")
def solved():
    """An ordinary step and its true answer."""
    step = sheet_step()
    return step, minimise(step.potential, step.guess, tolerance=1e-9)


def test_the_truth_passes(solved):
    step, result = solved
    checked = check_result(step, result)
    assert checked.status == "ok" and checked.value <= 1e-6 and "iterations" in checked.reason
    assert set(checked.terms.split("+")) == {"strain", "bending", "gravity", "inertia"}


def test_a_false_claim_of_a_small_gradient_is_found(solved):
    step, result = solved
    near = result.positions + 1e-6 * (np.arange(81)[:, None] % 7 == 3)
    for x in (step.guess, near):
        checked = check_result(step, claiming(x))
        assert checked.status == "failed" and checked.value > 1e-6
        assert "claims convergence at a relative residual" in checked.reason


def test_a_saddle_called_converged_is_found():
    step = sheet_step(start="point", terms="membrane", pins="none", speed=0.0, gravity=0.0)
    checked = check_result(step, claiming(step.guess))
    assert checked.status == "failed" and "saddle" in checked.reason and checked.value == 0.0


def test_a_saddle_far_below_the_stiffness_of_the_membrane_is_found():
    """A flat sheet pressed by a hair: the curvature that makes it buckle is far below the membrane's own."""
    cloth_step = sheet_step(gravity=0.0, speed=0.0, start="flat", dt=None, bending=2e-5, pins="side")
    flat = cloth_step.guess * [0.99999, 1.0, 0.99999]
    flat[cloth_step.pins] = cloth_step.guess[cloth_step.pins]
    truth = optimality_of(cloth_step, flat)
    assert -1e-2 < truth.lowest_curvature < -truth.zero_curvature


@pytest.mark.parametrize("status", ["converged", "stalled"])
def test_nan_is_found_whatever_it_is_called(solved, status):
    step, result = solved
    x = result.positions.copy()
    x[40, 1] = np.nan
    checked = check_result(step, claiming(x, status))
    assert checked.status == "failed" and "not finite" in checked.reason


def test_moved_pins_are_found(solved):
    step, result = solved
    x = result.positions.copy()
    x[step.pins[0]] += 1e-9
    assert check_result(step, claiming(x)).reason == "pinned vertices moved"


def test_a_rise_of_the_energy_is_found(solved):
    step, result = solved
    far = 3 * step.guess
    far[step.pins] = step.guess[step.pins]
    assert "rose" in check_result(step, claiming(far, "stalled")).reason
    # From its minimum on by a hundred thousandth of the energy: less than any picture shows.
    end = dataclasses.replace(step, guess=result.positions)
    slightly = result.positions.copy()
    while step.potential.value(slightly) < (1 + 1e-5) * step.potential.value(result.positions):
        slightly += 1e-6 * (np.arange(81)[:, None] == 44)
    assert "rose" in check_result(end, claiming(slightly)).reason


def test_an_honest_failure_keeps_its_name_and_says_what_collapsed(solved):
    step, _ = solved
    cut = minimise(step.potential, step.guess, max_iterations=2)
    checked = check_result(step, cut)
    assert checked.status == "stalled" and checked.value > 1e-6 and "gave up after 2" in checked.reason
    crushed = dataclasses.replace(step, guess=1e-3 * step.guess)
    lost = check_result(crushed, claiming(crushed.guess, "stalled")).reason
    assert re.search(r"; 1\d\d triangles collapsed", lost)
    nameless = solve_and_check(sheet_step(start="point", pins="none", speed=0.0))
    assert nameless.status == "diverged" and nameless.value is None and "not finite" in nameless.reason


def test_the_check_uses_no_kernel(solved, monkeypatch):
    """With every kernel of the membrane returning nonsense the examination is the same."""
    step, result = solved
    before = optimality_of(step, result.positions)
    monkeypatch.setattr(StretchStVK, "value_and_gradient", None)
    monkeypatch.setattr(StretchStVK, "add_hessian", None)
    assert optimality_of(step, result.positions) == before


def test_a_minimiser_that_lies_is_caught_by_what_the_suite_runs(solved, monkeypatch):
    """The same way that a case goes, with fakes in the place of the solver."""
    step, _ = solved
    point = sheet_step(start="point", terms="membrane", pins="none", speed=0.0, gravity=0.0)

    def standing(potential, x0, **options):
        return claiming(x0)

    def vanishing(potential, x0, **options):
        return claiming(np.full_like(x0, np.nan), "stalled")

    def climbing(potential, x0, **options):
        return claiming(
            x0 + 0.1 * np.sin(np.arange(x0.size)).reshape(x0.shape) * potential.cloth.free[:, None]
        )

    lies = [(point, standing, "saddle"), (step, standing, "claims convergence"),
            (step, vanishing, "not finite"), (step, climbing, "rose")]  # fmt: skip
    for case, solve, message in lies:
        monkeypatch.setattr(convergence_check.sim, "minimise", solve)
        checked = solve_and_check(case)
        assert checked.status == "failed" and message in checked.reason, (solve, checked)
