"""The check of what a minimiser claims: it catches every kind of lie that one could tell."""

from __future__ import annotations

import re

import numpy as np
import pytest

from benchmarks.validation import convergence_check
from benchmarks.validation.convergence_check import check_result, optimality_of, solve_and_check
from benchmarks.validation.extreme_steps import sheet_step
from reference_sim import Result, minimise
from reference_sim.energies import StretchStVK

VERTEX = np.arange(81)[:, None]
POINT = {"start": "point", "pins": "none", "speed": 0.0}


def claiming(positions, status="converged"):
    return Result(positions, status, "so it says", 1, 1, 0.0, 0.0, {})


@pytest.fixture(scope="module")
def solved():
    """An ordinary step: potential, guess, and its true answer."""
    step = sheet_step()
    return *step, minimise(*step, tolerance=1e-9)


def test_the_truth_passes(solved):
    checked = check_result(*solved)
    assert checked.status == "ok" and checked.value <= 1e-6 and "iterations" in checked.reason
    assert set(checked.terms.split("+")) == {"strain", "bending", "gravity", "inertia"}


@pytest.mark.parametrize(
    ("claimed", "status", "words"),
    [
        (lambda guess, x: guess, "converged", "claims convergence at a relative residual"),
        (lambda guess, x: x + 1e-6 * (VERTEX % 7 == 3), "converged", "claims convergence at a relative"),
        (lambda guess, x: np.where(VERTEX == 40, np.nan, x), "converged", "not finite"),
        (lambda guess, x: x + 1e-9 * (VERTEX == 0), "converged", "pinned vertices moved"),
        (lambda guess, x: np.where((VERTEX == 0) | (VERTEX == 8), x, 3 * guess), "stalled", "rose"),
    ],
)
def test_a_minimiser_that_lies_is_caught_by_what_the_suite_runs(
    solved, monkeypatch, claimed, status, words
):
    potential, guess, result = solved
    lie = claiming(claimed(guess, result.positions), status)
    monkeypatch.setattr(convergence_check.sim, "minimise", lambda potential, x0, **options: lie)
    checked = solve_and_check(potential, guess)
    assert checked.status == "failed" and words in checked.reason


def test_a_saddle_called_converged_is_found():
    potential, guess = sheet_step(**POINT, terms="membrane", gravity=0.0)
    checked = check_result(potential, guess, claiming(guess))
    assert checked.status == "failed" and "saddle" in checked.reason and checked.value == 0.0


def test_a_saddle_far_below_the_stiffness_of_the_membrane_is_found():
    """A flat sheet pressed by a hair: the curvature that makes it buckle is far below the membrane's own."""
    potential, guess = sheet_step(
        gravity=0.0, speed=0.0, start="flat", dt=None, bending=2e-5, pins="side"
    )
    flat = np.where(potential.cloth.free[:, None], guess * [0.99999, 1.0, 0.99999], guess)
    truth = optimality_of(potential, flat)
    assert -1e-2 < truth.lowest_curvature < -truth.zero_curvature


def test_an_honest_failure_keeps_its_name_and_says_what_collapsed(solved):
    potential, guess, _ = solved
    checked = check_result(potential, guess, minimise(potential, guess, max_iterations=2))
    assert checked.status == "stalled" and checked.value > 1e-6 and "gave up after 2" in checked.reason
    crushed = 1e-3 * guess
    lost = check_result(potential, crushed, claiming(crushed, "stalled")).reason
    assert re.search(r"; 1\d\d triangles collapsed", lost)
    nameless = solve_and_check(*sheet_step(**POINT))
    assert nameless.status == "diverged" and nameless.value is None and "not finite" in nameless.reason


def test_the_check_uses_no_kernel(solved, monkeypatch):
    """With every kernel of the membrane returning nonsense the examination is the same."""
    potential, _, result = solved
    before = optimality_of(potential, result.positions)
    monkeypatch.setattr(StretchStVK, "value_and_gradient", None)
    monkeypatch.setattr(StretchStVK, "add_hessian", None)
    assert optimality_of(potential, result.positions) == before
