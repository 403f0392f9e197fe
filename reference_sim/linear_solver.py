"""Sparse Cholesky in three calls: analyse once, factorise often, solve. Not positive definite is an answer.

The package is CHOLMOD through cvxopt (GPLv3) with METIS nested dissection; where cvxopt is missing, SuperLU
from scipy does the same job several times slower.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from .hessian_pattern import HessianPattern


class LinearSolver(Protocol):
    """Factorisations on one fixed pattern."""

    def factorise(self, data: np.ndarray) -> bool:
        """Factorise the lower matrix with these values (nnz,); False if it is not positive definite."""
        ...

    def solve(self, b: np.ndarray) -> np.ndarray:
        """Solve with the last successful factorisation: b (3n,) [N] -> (3n,) [m]."""
        ...


def analyse(pattern: HessianPattern) -> LinearSolver:
    """Symbolic analysis of a pattern, with the best package that is installed."""
    try:
        return CholmodSolver(pattern)
    except ImportError:
        return SuperLUSolver(pattern)


class CholmodSolver:
    """Supernodal CHOLMOD through cvxopt."""

    def __init__(self, pattern: HessianPattern) -> None:
        from cvxopt import cholmod, matrix, spmatrix

        self._cholmod, self._matrix = cholmod, matrix
        columns = np.repeat(np.arange(pattern.size), np.diff(pattern.indptr))
        self._A = spmatrix(
            matrix(np.ones(len(columns))), matrix(pattern.indices), matrix(columns), (pattern.size, pattern.size)
        )
        order = nested_dissection(pattern.adjacency)
        scalar = (3 * order[:, None] + np.arange(3)).ravel()
        self._symbolic = cholmod.symbolic(self._A, p=matrix(scalar.tolist()), uplo="L")

    def factorise(self, data: np.ndarray) -> bool:
        self._A.V = self._matrix(data)
        try:
            self._cholmod.numeric(self._A, self._symbolic)
        except ArithmeticError:
            return False
        return True

    def solve(self, b: np.ndarray) -> np.ndarray:
        x = self._matrix(b)
        self._cholmod.solve(self._symbolic, x)
        return np.array(x).ravel()


class SuperLUSolver:
    """scipy's SuperLU kept symmetric: no pivoting, and a negative pivot means not positive definite."""

    def __init__(self, pattern: HessianPattern) -> None:
        self._pattern = pattern
        order = nested_dissection(pattern.adjacency)
        self._order = (3 * order[:, None] + np.arange(3)).ravel()
        self._lu: spla.SuperLU | None = None

    def factorise(self, data: np.ndarray) -> bool:
        A = self._pattern.symmetric(data)[self._order][:, self._order]
        try:
            lu = spla.splu(
                sp.csc_matrix(A),
                permc_spec="NATURAL",
                diag_pivot_thresh=0.0,
                options={"SymmetricMode": True},
            )
        except RuntimeError:  # exactly singular
            return False
        unpivoted = np.array_equal(lu.perm_r, np.arange(len(lu.perm_r)))
        if not unpivoted or not (lu.U.diagonal() > 0).all():
            return False
        self._lu = lu
        return True

    def solve(self, b: np.ndarray) -> np.ndarray:
        assert self._lu is not None, "factorise() first"
        x = np.empty_like(b)
        x[self._order] = self._lu.solve(b[self._order])
        return x


def nested_dissection(adjacency: sp.csr_matrix) -> np.ndarray:
    """Fill-reducing order (n,) of a vertex graph by METIS, or by reverse Cuthill-McKee without pymetis."""
    if adjacency.shape[0] < 4:
        return np.arange(adjacency.shape[0])
    try:
        import pymetis
    except ImportError:
        return sp.csgraph.reverse_cuthill_mckee(adjacency, symmetric_mode=True).astype(np.int64)
    graph = pymetis.CSRAdjacency(adj_starts=adjacency.indptr, adjacent=adjacency.indices)
    permutation, _ = pymetis.nested_dissection(adjacency=graph)
    return np.asarray(permutation, dtype=np.int64)
