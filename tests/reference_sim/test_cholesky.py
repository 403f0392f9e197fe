"""Both Cholesky backends against dense numpy, on matrices that know nothing of cloth."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp

from reference_sim.cholesky import CholmodSolver, SuperLUSolver

SIZE = 60
FACTOR = sp.random(SIZE, SIZE, density=0.05, random_state=1)
LOWER = sp.tril(FACTOR @ FACTOR.T + sp.eye(SIZE), format="csc")
DENSE = (LOWER + sp.tril(LOWER, -1).T).toarray()
DIAGONAL = np.repeat(np.arange(SIZE), np.diff(LOWER.indptr)) == LOWER.indices


@pytest.fixture(params=[CholmodSolver, SuperLUSolver])
def solver(request):
    order = np.random.default_rng(0).permutation(SIZE)
    return request.param(LOWER.indptr.astype(np.int64), LOWER.indices.astype(np.int64), order)


def test_solves_as_dense_numpy_does(solver):
    assert solver.factorise(LOWER.data)
    for b in (np.arange(1.0, SIZE + 1), np.random.default_rng(0).normal(size=(SIZE, 3))):
        before = b.copy()
        x = solver.solve(b)
        assert x.shape == b.shape and (b == before).all()
        # Eigenvalues from 1 to some 10.
        assert x == pytest.approx(np.linalg.solve(DENSE, b), rel=1e-11, abs=1e-12)


@pytest.mark.parametrize("shift", [-1.0, -2.0, -20.0])
def test_a_matrix_that_is_not_positive_definite_is_an_answer_and_makes_no_noise(solver, capfd, shift):
    """A row without entries in the factor has nothing left on the diagonal; all of it is negative at last."""
    assert np.linalg.eigvalsh(DENSE + shift * np.eye(SIZE))[0] < 1e-14
    assert not solver.factorise(LOWER.data + shift * DIAGONAL)
    assert not solver.factorise(0.0 * LOWER.data)
    captured = capfd.readouterr()
    assert captured.out == "" and captured.err == ""
