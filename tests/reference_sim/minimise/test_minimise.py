"""Minimisers: what they call converged is checked again here by other means; failure is a status."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from scipy.spatial.distance import pdist

from reference_sim import GRAVITY, Cloth, Potential, Result, minimise
from reference_sim.energies import BendHinge, Gravity, Inertia, StretchSpring, StretchStVK
from reference_sim.minimise import lbfgs
from reference_sim.minimise.descent import LBFGSHistory
from reference_sim.minimise.minimisers import MINIMISERS, make_minimiser
from tests.reference_sim.meshes import grid, random_rotation
from tests.reference_sim.test_potential import dense_sum

TOLERANCE = 1e-6  # relative residual, the default that a result promises
SHEET, FACES = grid(8, 8, width=0.5, depth=0.5)
both = pytest.mark.parametrize("method", MINIMISERS)


def hanging() -> tuple[Potential, np.ndarray]:
    cloth = Cloth(SHEET, FACES, pins=[0, 8])
    return Potential([StretchStVK(cloth), BendHinge(cloth), Gravity(cloth)]), SHEET


def gradient_by_torch(potential: Potential, x: np.ndarray) -> np.ndarray:
    """(V, 3) [N] from the definitions alone."""
    variable = torch.as_tensor(x).clone().requires_grad_(True)
    sum(energy.energy(variable).sum() for energy in potential.energies).backward()
    return variable.grad.numpy()


def assert_minimum(potential: Potential, x0: np.ndarray, result: Result) -> None:
    """Pins still, gradient small and no negative curvature, by another way than the minimiser's own."""
    x, pins = result.positions, potential.cloth.pins
    assert result.status == "converged", result.reason
    assert (x[pins] == x0[pins]).all() and np.isfinite(x).all()
    gradient = gradient_by_torch(potential, x)
    gradient[pins] = 0
    norm = np.abs(gradient).max() / (potential.cloth.masses.mean() * GRAVITY)
    assert norm <= TOLERANCE
    # The two gradients differ by round-off of forces of 1 N in vertices of 1e-3 N.
    assert result.gradient_norm == pytest.approx(norm, abs=1e-9)
    rows = np.repeat(potential.cloth.free, 3)
    values = np.linalg.eigvalsh(dense_sum(potential.energies, x)[np.ix_(rows, rows)])
    assert values[0] > -1e-10 * values[-1]
    assert result.energy == pytest.approx(potential.value(x), rel=1e-12, abs=1e-20)
    assert sum(result.terms.values()) == pytest.approx(result.energy, rel=1e-9, abs=1e-20)


@both
def test_a_sheet_hangs_from_two_corners(method):
    potential, x0 = hanging()
    result = minimise(potential, x0, method)
    assert_minimum(potential, x0, result)
    # The two pins carry the whole weight, minus what the lumped masses of the pins carry themselves.
    carried = gradient_by_torch(potential, result.positions)[potential.cloth.pins]
    assert carried.sum(axis=0) == pytest.approx([0, potential.cloth.masses.sum() * GRAVITY, 0], abs=1e-6)
    assert result.iterations > 0 and result.factorisations > 0


@pytest.mark.parametrize("term", [BendHinge, StretchSpring])
@both
def test_a_state_without_energy_is_diverged_and_raises_nothing(method, term):
    """All vertices at one point: a hinge has no normal there, a spring no direction. Or a start of NaN."""
    cloth, torn = Cloth(SHEET, FACES), np.where(np.arange(81)[:, None] == 5, np.nan, SHEET)
    for start in (np.zeros_like(SHEET), torn):
        result = minimise(Potential([term(cloth), Inertia(cloth, 0.01)]), start, method)
        assert result.status == "diverged" and "not finite" in result.reason


@both
def test_an_unpinned_cloth_finds_its_rest_shape_somewhere(method):
    """Six rigid motions cost nothing: a singular Hessian at the minimum is no saddle."""
    x = SHEET + np.array([0.0, 1.0, 0.0]) * SHEET[:, :1] ** 2
    cloth = Cloth(x, FACES)
    potential = Potential([StretchStVK(cloth), BendHinge(cloth, rest_angles="rest")])
    x0 = (x + np.random.default_rng(2).normal(0, 0.01, x.shape)) @ random_rotation(3).T + 0.4
    result = minimise(potential, x0, method)
    assert_minimum(potential, x0, result)
    # A gradient of 1e-6 weights (4e-9 N) over the softest bending mode (1e-4 N/m): 40 micrometres.
    assert pdist(result.positions) == pytest.approx(pdist(x), abs=8e-5)


def crumpled() -> tuple[Potential, np.ndarray]:
    """A step of a sheet that is far from any minimum: its Hessian is indefinite for a while."""
    cloth = Cloth(SHEET, FACES)
    inertia = Inertia(cloth, 1 / 30)
    x0 = SHEET + np.random.default_rng(5).normal(0, 0.02, SHEET.shape)
    inertia.x_hat = x0
    return Potential([StretchStVK(cloth), BendHinge(cloth), Gravity(cloth), inertia]), x0


@pytest.mark.parametrize("case", [hanging, crumpled])
def test_a_factorisation_used_again_saves_others_and_ends_in_a_minimum(case):
    potential, x0 = case()
    fresh, again = minimise(potential, x0), minimise(potential, x0, reuse=True)
    assert_minimum(potential, x0, again)
    # 16 to 19 of 20 where the sheet hangs: that much is round-off.
    assert again.factorisations < fresh.factorisations and again.iterations > again.factorisations


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


def test_a_triangle_that_collapses_is_named():
    """A vertex 10 um inside an edge that is pinned is pushed across it."""
    x = 0.01 * np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 1e-3, 0]])
    cloth = Cloth(x, np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]]), pins=[0, 1, 2, 3])
    start = x.copy()
    start[2:4, 1] *= 0.6
    start[4, 2] = 1e-5
    result = minimise(Potential([StretchStVK(cloth), BendHinge(cloth)]), start, method="newton")
    assert (
        result.status == "max_iterations" and "face 0, 1e-05 m high at rest, has become" in result.reason
    )
