"""L-BFGS: its history, its preconditioner, and Newton's method that finishes what it began."""

from __future__ import annotations

import numpy as np
import pytest

from reference_sim import minimise
from reference_sim.minimise import lbfgs
from reference_sim.minimise.descent import LBFGSHistory
from reference_sim.minimise.minimisers import make_minimiser
from tests.reference_sim.minimise.minima import assert_minimum, hanging


def test_without_a_preconditioner_newton_takes_over_at_once():
    potential, x = hanging()
    minimiser = make_minimiser(potential, "lbfgs")
    minimiser.preconditioner.solver.factorise = lambda data: False
    assert_minimum(potential, x, minimiser.minimise(x))


def test_lbfgs_and_its_finish_share_iterations_and_clock(monkeypatch):
    potential, x0 = hanging()
    monkeypatch.setattr(lbfgs, "PATIENCE", 20)
    result = minimise(potential, x0, "lbfgs", max_iterations=30)
    assert (result.status, result.iterations) == ("max_iterations", 30)
    ticks = iter(range(100_000))
    monkeypatch.setattr("time.perf_counter", lambda: float(next(ticks)))  # a second for every look at it
    monkeypatch.setattr(lbfgs, "PATIENCE", 10)
    monkeypatch.setattr(lbfgs, "SWITCH", 1e-6)
    cut = minimise(potential, x0, "lbfgs", timeout=13)
    assert cut.status == "timeout" and cut.iterations > 10
    assert next(ticks) < 20


@pytest.mark.parametrize("memory", [0, 5, 20])
def test_the_two_loop_recursion_is_the_update_of_a_dense_matrix(memory):
    """H <- (I - rho s y^T) H (I - rho y s^T) + rho s s^T for the pairs remembered, oldest first."""
    generator = np.random.default_rng(1)
    first, history, pairs = generator.uniform(1, 2, 12), LBFGSHistory(memory), []
    for k in range(9):
        s = generator.normal(size=12)
        y = s * generator.uniform(1, 5, 12) * (-1 if k == 6 else 1)  # a negative curvature is left out
        history.add(s, y)
        pairs += [] if k == 6 else [(s, y)]
    assert len(history) == min(memory, 8)
    H = np.diag(1 / first)
    for s, y in pairs[-memory:] if memory else []:
        V = np.eye(12) - np.outer(y, s) / (s @ y)
        H = V.T @ H @ V + np.outer(s, s) / (s @ y)
    g = generator.normal(size=12)
    assert history.direction(g, lambda q: q / first) == pytest.approx(-H @ g, rel=1e-12, abs=1e-12)
    history.clear()
    assert history.direction(g, lambda q: q / first) == pytest.approx(-g / first, rel=1e-15)
