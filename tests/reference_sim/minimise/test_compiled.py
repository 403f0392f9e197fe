"""The compiled solver beside what it approximates: energies, factor, iterations, whole roll-outs."""

from __future__ import annotations

import numpy as np
import pytest

from reference_sim.minimise import lbfgs
from reference_sim.minimise.compiled_lbfgs import CompiledLBFGS, evaluate
from reference_sim.minimise.lbfgs import LBFGS
from reference_sim.minimise.newton import Newton
from tests.reference_sim.pressed_sheet import pressed


@pytest.mark.parametrize("size", [0.0, 1e-3, 2e-2])
def test_each_energy_and_its_gradient_is_that_of_its_definition(size):
    potential, x0 = pressed()
    u = np.random.default_rng(1).normal(0, size, x0.shape).astype(np.float32).astype(float)
    solver, gradient = CompiledLBFGS(potential, max_iterations=1), np.empty(u.size, np.float32)
    energies, shift = np.zeros_like(solver._energies), u.astype(np.float32).ravel()
    target = (solver._terms.inertia.x_hat - x0).astype(np.float32).ravel()
    evaluate(shift, target, solver._vertices, solver.freeze(x0), gradient, solver._scratch, energies)
    value, whole = potential.terms(x0 + u), potential.gradient(x0 + u)
    value["gravity"] = float(potential.cloth.masses * 9.81 @ u[:, 1])  # from x0 on
    assert value["collision"] > 0
    order = ("inertia", "gravity", "strain", "bending", "collision")
    for name, term in zip(order, energies):
        assert term == pytest.approx(value[name], rel=2e-5, abs=1e-9), name
    whole[potential.cloth.pins] = 0.0
    assert np.abs(gradient.reshape(u.shape) - whole).max() < 3e-6 * np.abs(whole).max()


@pytest.mark.parametrize("iterations", [1, 10])
def test_iterations_are_those_of_the_exact_solver(iterations):
    potential, guess = pressed()
    exact = LBFGS(potential, max_iterations=iterations, finish=False).minimise(guess)
    descent = CompiledLBFGS(potential, max_iterations=iterations).minimise(guess)
    assert descent.iterations == iterations == exact.iterations and descent.status == "max_iterations"
    start = potential.value(guess)
    # Its preconditioner is factorised in float32: directions have four digits.
    assert start - potential.value(descent.positions) == pytest.approx(start - exact.energy, rel=4e-3)
    assert (
        np.abs(descent.positions - exact.positions).max() < 0.02 * np.abs(exact.positions - guess).max()
    )
    assert np.array_equal(descent.positions[potential.cloth.pins], guess[potential.cloth.pins])
    assert descent.terms == pytest.approx(potential.terms(descent.positions), rel=1e-4, abs=1e-8)


def test_what_begins_in_float32_ends_in_a_minimum_of_float64(monkeypatch):
    potential, guess = pressed()
    descent = LBFGS(potential).minimise(guess)
    monkeypatch.setattr(lbfgs, "terms_without_kernel", lambda *_: ["strain"])
    monkeypatch.setattr(lbfgs, "warn_slow_path", lambda *_: None)
    in_float64 = LBFGS(potential).minimise(guess)
    assert descent.status == in_float64.status == "converged"
    assert descent.iterations > in_float64.iterations  # more of them, and cheap ones
    gradient = potential.value_and_gradient(descent.positions)[1][potential.cloth.free]
    assert np.abs(gradient).max() < 1e-6 * 9.81 * potential.cloth.masses.mean()
    restart = Newton(potential).minimise(descent.positions)
    assert restart.status == "converged"
    assert np.abs(restart.positions - descent.positions).max() < 1e-13  # both end at round-off


def test_a_minimiser_that_served_gives_the_bits_of_a_new_one():
    potential, guess = pressed()
    torn = np.random.default_rng(0).normal(0, 0.1, guess.shape) * potential.cloth.free[:, None]
    for make in (LBFGS, lambda potential: CompiledLBFGS(potential, max_iterations=3)):
        served, new = make(potential), make(potential).minimise(guess).positions
        served.minimise(guess + torn)  # which allows its first direction a hundredth only
        served.start_again()
        assert np.array_equal(served.minimise(guess).positions, new)
