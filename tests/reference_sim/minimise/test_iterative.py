"""Newton's method of large meshes, forced on small ones: against dense numpy and the factorised one."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest
import scipy.linalg

from reference_sim import Cloth, Potential, minimise
from reference_sim.assembly.cholesky import CholmodSolver
from reference_sim.energies import BendHinge, Gravity, Inertia, StretchStVK
from reference_sim.minimise import iterative, make_minimiser, newton
from reference_sim.minimise.factorised import FactorisedHessian
from reference_sim.minimise.iterative import SETTLED, IterativeHessian
from tests.reference_sim.meshes import grid

SHEET, FACES = grid(8, 8, width=0.5, depth=0.5)
SIDES = np.flatnonzero((SHEET[:, 0] == 0) | (SHEET[:, 0] == 0.5))
DT = 1 / 30


@pytest.fixture
def large(monkeypatch):
    """From here on every mesh counts as too large to factorise."""
    return lambda: monkeypatch.setattr(newton, "LARGEST_FACTORISED", 0)


def swinging(cells: int = 8, *, noise: float = 0.02) -> tuple[Potential, np.ndarray]:
    """A step of a crumpled sheet held at two corners."""
    sheet, faces = grid(cells, cells, width=0.5, depth=0.5)
    cloth = Cloth(sheet, faces, pins=[0, cells])
    inertia = Inertia(cloth, DT)
    x0 = sheet + np.random.default_rng(5).normal(0, noise * 8 / cells, sheet.shape) * cloth.free[:, None]
    inertia.x_hat = x0
    return Potential([StretchStVK(cloth), BendHinge(cloth), Gravity(cloth), inertia]), x0


def stretched() -> tuple[Potential, np.ndarray]:
    """Pulled apart, so that there is one minimum only."""
    cloth = Cloth(SHEET, FACES, pins=SIDES)
    return Potential([StretchStVK(cloth), BendHinge(cloth), Gravity(cloth)]), 1.3 * SHEET


def dense(potential: Potential, x: np.ndarray) -> np.ndarray:
    """The Hessian over the free vertices."""
    rows = np.repeat(potential.cloth.free, 3)
    return potential.hessian(x).toarray()[np.ix_(rows, rows)]


@pytest.mark.parametrize("case", [swinging, stretched])
@pytest.mark.parametrize("method", ["newton", "lbfgs"])
def test_it_ends_where_the_factorised_one_does(case, method, large):
    potential, x0 = case()
    expected = minimise(potential, x0, method)
    large()
    result = minimise(potential, x0, method)
    assert (expected.status, result.status) == ("converged", "converged"), result.reason
    assert result.gradient_norm <= 1e-6
    values = np.linalg.eigvalsh(dense(potential, result.positions))
    assert values[0] > 0
    if case is stretched or method == "lbfgs":
        assert result.positions == pytest.approx(expected.positions, abs=1e-6)


def test_it_says_what_was_checked_and_what_was_not(large):
    potential, x0 = swinging()
    assert "Lanczos" not in minimise(potential, x0).reason
    large()
    assert "by Lanczos' method, unproved" in minimise(potential, x0).reason


def test_nothing_of_the_size_of_the_hessian_is_analysed(large, monkeypatch):
    sizes = []
    init = CholmodSolver.__init__

    def noted(self, indptr, *rest):
        sizes.append(len(indptr) - 1)
        init(self, indptr, *rest)

    monkeypatch.setattr(CholmodSolver, "__init__", noted)
    large()
    potential, x0 = swinging()
    assert minimise(potential, x0, "lbfgs").status == "converged"
    assert set(sizes) == {len(x0) - 2}


def hessian_at(potential: Potential, x: np.ndarray, convexity: float) -> tuple[IterativeHessian, np.ndarray]:
    hessian = IterativeHessian(potential, tolerance=1e-6)
    data = hessian.assemble(x, convexity)
    assert hessian.factorise(data, 0.0)
    return hessian, data


def test_a_small_right_hand_side_is_solved_as_dense_numpy_does():
    potential, x0 = swinging()
    hessian, data = hessian_at(potential, x0, 1.0)
    matrix = hessian._pattern.symmetric(data).toarray()
    b = np.random.default_rng(1).standard_normal(len(matrix))
    for size in (1e-4, 1e-12):
        small = b * size**2 * hessian._weight / np.abs(b).max()
        exact = np.linalg.solve(matrix, small)
        off = hessian.solve(small) - exact
        assert hessian.downward is None
        # In the norm of the energy: the residual's bound, and the condition of the preconditioned matrix.
        assert off @ matrix @ off < (30 * size) ** 2 * (exact @ matrix @ exact)
    hessian.factorise(data, 2.0)
    exact = np.linalg.solve(matrix + 2.0 * np.diag(hessian.metric), small)
    assert hessian.solve(small) == pytest.approx(exact, rel=1e-6, abs=1e-9 * np.abs(exact).max())


def test_a_matrix_that_is_indefinite_along_normals_is_not_factorised():
    potential, x0 = swinging()
    hessian = IterativeHessian(potential, tolerance=1e-6)
    data = hessian.assemble(x0, 0.0)
    assert not hessian.factorise(data, 0.0) and hessian.factorise(data, 1e3)


def test_a_solve_of_an_indefinite_matrix_ends_in_negative_curvature():
    """So much of its negative curvature taken out that along normals none is left."""
    potential, x0 = swinging()
    hessian, data = hessian_at(potential, x0, 0.84)
    matrix = hessian._pattern.symmetric(data).toarray()
    assert np.linalg.eigvalsh(matrix)[0] < 0
    g = potential.gradient(x0)[potential.cloth.free].ravel()
    p, v = hessian.solve(-1e-9 * g), hessian.downward
    assert v @ matrix @ v <= 0 and np.isfinite(p).all() and p @ g < 0
    hessian.look_for_negative_curvature()
    v = hessian.downward
    assert v @ matrix @ v < 0
    preconditioner = np.linalg.inv([hessian.precondition(column) for column in np.eye(len(matrix))])
    lowest = scipy.linalg.eigh(matrix, preconditioner)[1][:, 0]
    assert hessian.solve(preconditioner @ lowest) == pytest.approx(lowest, rel=1e-6, abs=1e-9)


def test_the_lowest_curvature_is_that_of_the_dense_eigenvalue_problem():
    potential, x0 = swinging()
    x = minimise(potential, x0).positions
    hessian, _ = hessian_at(potential, x, 0.0)
    hessian.look_for_negative_curvature()
    assert hessian.downward is None and hessian.settled
    scalar = hessian._scalar
    block = scalar._pattern.symmetric(scalar.assemble(x)).toarray()
    matrix, normals = dense(potential, x), scipy.linalg.block_diag(*hessian._normals[:, :, None])
    inverse = np.kron(np.linalg.inv(block), np.eye(3))
    inverse += normals @ np.linalg.inv(normals.T @ matrix @ normals) @ normals.T
    exact = scipy.linalg.eigh(matrix, np.linalg.inv(inverse), eigvals_only=True)[0]
    estimate = float(hessian.evidence.split("curvature ")[1].split()[0])
    assert 0 < exact <= estimate * 1.05 and estimate < (1 + 2 * SETTLED) * exact


def test_a_flat_compressed_sheet_is_a_saddle_and_no_answer(large):
    cloth = Cloth(SHEET, FACES, pins=SIDES)
    potential = Potential([StretchStVK(cloth), BendHinge(cloth), Inertia(cloth, 1.0)])
    x0 = SHEET * [0.9, 1, 1]
    assert np.abs(potential.gradient(x0)[:, 1]).max() == 0
    large()
    result = minimise(potential, x0)
    assert np.ptp(result.positions[:, 1]) > 0.01
    assert result.energy < 0.05 * potential.value(x0)


def test_a_look_that_does_not_settle_is_not_called_converged(large, monkeypatch):
    potential, x0 = swinging()
    large()
    monkeypatch.setattr(iterative, "SETTLED", 0.0)
    monkeypatch.setattr(iterative, "MAX_PRODUCTS", 60)
    result = minimise(potential, x0)
    assert result.status == "stalled" and "unsettled" in result.reason and result.gradient_norm <= 1e-6


def test_what_is_small_enough_is_factorised():
    potential, _ = swinging()
    assert type(make_minimiser(potential).hessian) is FactorisedHessian


def test_lbfgs_alone_takes_less_than_4_kilobytes_a_vertex():
    peaks, counts = [], []
    for cells in (24, 72):
        potential, x0 = swinging(cells, noise=0.001)
        tracemalloc.start()
        minimise(potential, x0, "lbfgs", finish=False, max_iterations=12)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
        counts.append(len(x0))
    assert np.diff(peaks)[0] / np.diff(counts)[0] < 4000
