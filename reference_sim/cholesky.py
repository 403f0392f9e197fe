"""Sparse Cholesky in three calls: analyse once, factorise often, solve. Not positive definite is an answer.

The package is CHOLMOD through cvxopt (GPLv3) with METIS nested dissection; where cvxopt is missing, SuperLU
from scipy does the same job several times slower.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla


def analyse(indptr: np.ndarray, indices: np.ndarray, order: np.ndarray) -> CholmodSolver | SuperLUSolver:
    """Analyse a lower-triangular CSC pattern, with the best package that is installed.

    Args:
        indptr: (n + 1,) starts of the columns.
        indices: (nnz,) rows; entries above the diagonal may be stored and are ignored.
        order: (n,) fill-reducing order of rows and columns.

    >>> import scipy.sparse as sp
    >>> matrix = sp.csc_matrix([[4.0, 0.0], [1.0, 3.0]])  # its lower triangle
    >>> solver = analyse(matrix.indptr, matrix.indices, np.arange(2))
    >>> solver.factorise(matrix.data)
    True
    >>> solver.solve(np.array([5.0, 4.0]))
    array([1., 1.])
    """
    try:
        return CholmodSolver(indptr, indices, order)
    except ImportError:
        return SuperLUSolver(indptr, indices, order)


class CholmodSolver:
    """Supernodal CHOLMOD through cvxopt."""

    def __init__(self, indptr: np.ndarray, indices: np.ndarray, order: np.ndarray) -> None:
        from cvxopt import cholmod, matrix, spmatrix

        self._cholmod, self._matrix = cholmod, matrix
        size = len(indptr) - 1
        columns = np.repeat(np.arange(size), np.diff(indptr))
        self._A = spmatrix(matrix(np.ones(len(columns))), matrix(indices), matrix(columns), (size, size))
        self._symbolic = cholmod.symbolic(self._A, p=matrix(order.tolist()), uplo="L")

    def factorise(self, values: np.ndarray) -> bool:
        """Factorise the matrix with these values (nnz,); False if not positive definite."""
        self._A.V = self._matrix(values)
        try:
            self._cholmod.numeric(self._A, self._symbolic)
        except ArithmeticError:
            return False
        return True

    def solve(self, b: np.ndarray) -> np.ndarray:
        """Solve with the last factorisation: b (n,) or (n, k), same shape back."""
        x = self._matrix(b)
        self._cholmod.solve(self._symbolic, x)
        return np.array(x).reshape(b.shape)


class SuperLUSolver:
    """SuperLU of scipy kept symmetric: no pivoting, and a negative pivot means not positive definite."""

    def __init__(self, indptr: np.ndarray, indices: np.ndarray, order: np.ndarray) -> None:
        self._indptr, self._indices, self._order = indptr, indices, order
        self._lu: spla.SuperLU | None = None

    def factorise(self, values: np.ndarray) -> bool:
        """Factorise the matrix with these values (nnz,); False if not positive definite."""
        size = len(self._order)
        lower = sp.tril(
            sp.csc_matrix((values, self._indices, self._indptr), shape=(size, size)), format="csc"
        )
        A = sp.csc_matrix(lower + sp.tril(lower, -1).T)[self._order][:, self._order]
        try:
            lu = spla.splu(
                sp.csc_matrix(A), permc_spec="NATURAL", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
            )
        except RuntimeError:  # exactly singular
            return False
        unpivoted = np.array_equal(lu.perm_r, np.arange(len(lu.perm_r)))
        if not unpivoted or not (lu.U.diagonal() > 0).all():
            return False
        self._lu = lu
        return True

    def solve(self, b: np.ndarray) -> np.ndarray:
        """Solve with the last factorisation: b (n,) or (n, k), same shape back."""
        assert self._lu is not None, "factorise() first"
        x = np.empty_like(b)
        x[self._order] = self._lu.solve(b[self._order])
        return x


def nested_dissection(adjacency: sp.csr_matrix) -> np.ndarray:
    """Return a fill-reducing order (n,) of a vertex graph by METIS."""
    if adjacency.shape[0] < 4:
        return np.arange(adjacency.shape[0])
    import pymetis

    graph = pymetis.CSRAdjacency(adj_starts=adjacency.indptr, adjacent=adjacency.indices)
    permutation, _ = pymetis.nested_dissection(adjacency=graph)
    return np.asarray(permutation, dtype=np.int64)
