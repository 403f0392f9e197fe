"""Supernodal Cholesky factorisations against dense numpy, on matrices that know nothing of cloth."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp

from reference_sim.cholesky import Cholesky
from reference_sim.elimination import nested_dissection


def random_matrix(vertices, block, neighbours, seed):
    """Return a lower CSC matrix of vertex blocks, its whole one, dense, with eigenvalues from 1 on."""
    rng = np.random.default_rng(seed)
    pairs = rng.integers(vertices, size=(neighbours * vertices, 2))
    factor = np.zeros((vertices * block,) * 2)
    for i, j in pairs:
        part = rng.normal(size=(block, block))
        factor[block * i : block * (i + 1), block * j : block * (j + 1)] = part
    dense = factor @ factor.T + np.eye(len(factor))
    stored = np.kron(
        np.abs(dense).reshape(vertices, block, vertices, block).sum((1, 3)) > 0, np.ones((block,) * 2)
    )
    lower = stored * np.kron(np.tril(np.ones((vertices,) * 2)), np.ones((block,) * 2)) > 0
    matrix = sp.csc_matrix(lower, dtype=float)
    rows, columns = matrix.indices, np.repeat(np.arange(len(dense)), np.diff(matrix.indptr))
    matrix.data = dense[rows, columns]
    return matrix, dense


def solver(matrix, block, seed=0):
    vertices = matrix.shape[0] // block
    order = np.random.default_rng(seed).permutation(vertices)
    order = (block * order[:, None] + np.arange(block)).ravel()
    return Cholesky(matrix.indptr.astype(np.int64), matrix.indices.astype(np.int64), order)


@pytest.mark.parametrize("block", [1, 3])
@pytest.mark.parametrize("vertices, neighbours", [(1, 1), (2, 1), (5, 1), (20, 1), (41, 2), (60, 1)])
def test_solves_as_dense_numpy_does(block, vertices, neighbours):
    matrix, dense = random_matrix(vertices, block, neighbours, seed=vertices)
    cholesky = solver(matrix, block)
    rng = np.random.default_rng(0)
    for scale in (1.0, 2.0):  # again, with other values
        assert cholesky.factorise(scale * matrix.data)
        for b in (rng.normal(size=len(dense)), rng.normal(size=(len(dense), 3))):
            before = b.copy()
            x = cholesky.solve(b)
            assert x.shape == b.shape and (b == before).all()
            assert x == pytest.approx(np.linalg.solve(scale * dense, b), rel=1e-10, abs=1e-12)
        assert cholesky.factorise(scale * matrix.data, kind=np.float32)
        assert cholesky.solve(b) == pytest.approx(np.linalg.solve(scale * dense, b), rel=1e-3, abs=1e-4)


def test_wide_supernodes_and_merged_ones_leave_the_answer_alone():
    """A grid has panels of more rows than are subtracted at once, and supernodes worth merging."""
    side = 24
    lines = sp.diags([-np.ones(side - 1), 4.0 * np.ones(side), -np.ones(side - 1)], [-1, 0, 1])
    grid = sp.kronsum(lines, lines) - 3.0 * sp.eye(side**2)
    diagonals = sp.diags(np.ones(side**2 - side - 1), -side - 1)
    matrix = sp.tril(grid - 0.1 * (diagonals + diagonals.T), format="csc")
    whole = (matrix + sp.tril(matrix, -1).T).tocsc()
    order = nested_dissection((sp.tril(whole, -1) + sp.triu(whole, 1)).tocsr())
    cholesky = Cholesky(matrix.indptr.astype(np.int64), matrix.indices.astype(np.int64), order)
    widths = cholesky.layout.fronts["width"]
    assert widths.max() > 24 and len(widths) < side**2 / 4
    assert cholesky.factorise(matrix.data)
    b = np.random.default_rng(0).normal(size=side**2)
    assert whole @ cholesky.solve(b) == pytest.approx(b, abs=1e-12)


@pytest.mark.parametrize("block", [1, 3])
@pytest.mark.parametrize("shift", [-1.5, -2.0, -20.0])
def test_a_matrix_that_is_not_positive_definite_is_an_answer_and_makes_no_noise(block, shift, capfd):
    """A row without entries in the factor has nothing left on the diagonal; all of it is negative at last."""
    matrix, dense = random_matrix(30, block, 1, seed=0)
    cholesky = solver(matrix, block)
    diagonal = np.repeat(np.arange(len(dense)), np.diff(matrix.indptr)) == matrix.indices
    assert np.linalg.eigvalsh(dense + shift * np.eye(len(dense)))[0] < 0
    for kind in (np.float64, np.float32):
        assert not cholesky.factorise(matrix.data + shift * diagonal, kind=kind)
        assert not cholesky.factorise(0.0 * matrix.data, kind=kind)
        assert not cholesky.factorise(np.nan * matrix.data, kind=kind)
        assert cholesky.factorise(matrix.data, kind=kind)  # and nothing of it is left
    captured = capfd.readouterr()
    assert captured.out == "" and captured.err == ""


def test_float32_refuses_what_has_too_few_digits_for_it():
    _, dense = random_matrix(30, 3, 2, seed=0)
    stiff = dense @ dense @ dense
    shift = 1e-7 * np.abs(stiff).max()
    full = sp.csc_matrix(np.tril(stiff - (np.linalg.eigvalsh(stiff)[0] - shift) * np.eye(len(dense))))
    cholesky = solver(full, 1)
    assert not cholesky.factorise(full.data, kind=np.float32)
    assert cholesky.factorise(full.data)
