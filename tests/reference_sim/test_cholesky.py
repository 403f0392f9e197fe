"""Both Cholesky backends against dense numpy, on matrices that know nothing of cloth."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp

from reference_sim.cholesky import CholmodSolver, SuperLUSolver

both = pytest.mark.parametrize("backend", [CholmodSolver, SuperLUSolver])


class Problem:
    """A random sparse symmetric matrix, of which the lower triangle is stored."""

    def __init__(self, size: int, seed: int) -> None:
        generator = np.random.default_rng(seed)
        pattern = sp.random(size, size, density=0.1, random_state=seed) + sp.eye(size)
        self.lower = sp.csc_matrix(sp.tril(pattern + pattern.T))
        self.lower.sort_indices()
        self.order = generator.permutation(size)
        self.rows = self.lower.indices
        self.columns = np.repeat(np.arange(size), np.diff(self.lower.indptr))
        self.off = self.rows != self.columns
        self.data = np.where(self.off, generator.normal(size=self.lower.nnz), 0.0)
        self.data[~self.off] = np.abs(self.dense(self.data)).sum(axis=1) + 1.0  # diagonally dominant

    def dense(self, data: np.ndarray) -> np.ndarray:
        """The symmetric matrix that these values mean; what is stored above the diagonal is ignored."""
        size = self.lower.shape[0]
        lower = np.zeros((size, size))
        lower[self.rows, self.columns] = data
        lower = np.tril(lower)
        return lower + np.tril(lower, -1).T

    def solver(self, backend):
        return backend(self.lower.indptr.astype(np.int64), self.rows.astype(np.int64), self.order)

    def indefinite(self) -> np.ndarray:
        """Values with one negative eigenvalue, in the middle of the matrix."""
        data = self.data.copy()
        data[np.flatnonzero(~self.off)[self.lower.shape[0] // 2]] = -1
        assert np.linalg.eigvalsh(self.dense(data))[0] < 0
        return data


@both
def test_solves_as_dense_numpy_does(backend, size=60):
    problem = Problem(size, seed=size)
    solver = problem.solver(backend)
    assert solver.factorise(problem.data)
    generator = np.random.default_rng(0)
    for b in (generator.normal(size=size), generator.normal(size=(size, 3))):
        before = b.copy()
        x = solver.solve(b)
        assert x.shape == b.shape and (b == before).all()
        # Diagonally dominant: condition number below 100 times round-off.
        assert x == pytest.approx(np.linalg.solve(problem.dense(problem.data), b), rel=1e-12, abs=1e-13)


@both
def test_a_matrix_that_is_not_positive_definite_is_an_answer_and_makes_no_noise(backend, capfd):
    problem = Problem(40, seed=7)
    solver = problem.solver(backend)
    assert not solver.factorise(problem.indefinite())
    assert not solver.factorise(-problem.data)
    assert not solver.factorise(0.0 * problem.data)
    semidefinite = problem.data.copy()  # one zero row and column
    semidefinite[(problem.rows == 5) | (problem.columns == 5)] = 0.0
    assert not solver.factorise(semidefinite)
    captured = capfd.readouterr()
    assert captured.out == "" and captured.err == ""
