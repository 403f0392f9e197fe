"""Sparse Cholesky factorisations: by a package, and a compiled one to be called in the middle of a step.

The package is CHOLMOD through cvxopt (GPLv3) with METIS nested dissection; where cvxopt is missing, SuperLU
from scipy, several times slower. The compiled one is LDL^T row by row (Davis 2005, "LDL: a concise sparse
Cholesky factorization package"): row k of L solves a triangular system with the rows above it.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from reference_sim.kernels.kernel_cache import njit


def analyse(indptr: np.ndarray, indices: np.ndarray, order: np.ndarray) -> CholmodSolver | SuperLUSolver:
    """Analyse a lower-triangular CSC pattern, with the best package that is installed.

    Entries above the diagonal are ignored. order (n,): fill-reducing, of rows and columns.
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
        A = symmetrise(values, self._indices, self._indptr)[self._order][:, self._order]
        try:
            lu = spla.splu(
                A, permc_spec="NATURAL", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
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


def symmetrise(values: np.ndarray, indices: np.ndarray, indptr: np.ndarray) -> sp.csc_matrix:
    """Return the whole symmetric (n, n) matrix of a lower one, whose diagonal blocks are stored whole."""
    lower = sp.tril(sp.csc_matrix((values, indices, indptr)), format="csc")
    return sp.csc_matrix(lower + sp.tril(lower, -1).T)


def nested_dissection(adjacency: sp.csr_matrix) -> np.ndarray:
    """Return a fill-reducing order (n,) of a vertex graph by METIS."""
    if adjacency.shape[0] < 4:
        return np.arange(adjacency.shape[0])
    import pymetis

    graph = pymetis.CSRAdjacency(adj_starts=adjacency.indptr, adjacent=adjacency.indices)
    permutation, _ = pymetis.nested_dissection(adjacency=graph)
    return np.asarray(permutation, dtype=np.int64)


RIGHT_SIDES = 4  # numbers a row of right sides: x, y, z and one to fill the lane


class ScalarPattern:
    """Pattern of a symmetric n x n matrix that elements with stencils (E, k) add up to; -1 is pinned.

    Row i of the factor is row order[i] of the matrix. row_starts (n + 1,), row_columns: entries left of
    its diagonal. factor_rows, factor_columns: those of L, by rows; starts, rows: those by columns.
    """

    def __init__(self, count: int, stencils: list[np.ndarray]) -> None:
        self.count = count
        pairs = [np.zeros((0, 2), np.int64)]
        for stencil in stencils:
            k = stencil.shape[1]
            ends = stencil[:, [(a, b) for a in range(k) for b in range(a)]].reshape(-1, 2)
            pairs.append(ends[(ends >= 0).all(axis=1) & (ends[:, 0] != ends[:, 1])])
        ends = np.sort(np.concatenate(pairs), axis=1)
        pair = np.stack(np.divmod(np.unique(ends[:, 0] * count + ends[:, 1]), count), axis=1)
        ones = np.ones(len(pair))
        lower = sp.csr_matrix((ones, (pair[:, 1], pair[:, 0])), shape=(count, count))
        self.order = np.asarray(nested_dissection((lower + lower.T).tocsr()), np.int64)
        self._place = np.empty(count, np.int64)
        self._place[self.order] = np.arange(count)
        moved = np.sort(self._place[pair], axis=1)
        rows = np.lexsort((moved[:, 0], moved[:, 1]))
        self._keys = moved[rows, 1] * count + moved[rows, 0]
        self.row_columns = np.ascontiguousarray(moved[rows, 0])
        self.row_starts = np.searchsorted(moved[rows, 1], np.arange(count + 1))
        self.factor_rows, self.factor_columns = _find_rows(self.row_starts, self.row_columns)
        by_rows = (np.ones(len(self.factor_columns)), self.factor_columns, self.factor_rows)
        by_columns = sp.csr_matrix(by_rows, shape=(count, count)).tocsc()
        self.starts, self.rows = by_columns.indptr.astype(np.int64), by_columns.indices
        # A signed index is first asked whether it counts from the end: a quarter of a factorisation's
        # time.
        self.row_columns, self.factor_columns, self.rows = (
            columns.astype(np.uint32) for columns in (self.row_columns, self.factor_columns, self.rows)
        )

    def places(self, stencils: np.ndarray) -> np.ndarray:
        """Return where (E, k, k) the entries of the elements' matrices are added.

        It is -1 for those above the diagonal, of pinned vertices, and of an element that has a vertex
        twice.
        """
        i = np.append(self._place, -1)[stencils]
        row, column = np.broadcast_arrays(i[:, :, None], i[:, None, :])
        key = row * self.count + column
        place = np.searchsorted(self._keys, np.where(row > column, key, 0))
        place = np.where(row > column, place, len(self._keys) + row)
        k = np.arange(stencils.shape[1])
        upper_of_same = (row == column) & (k[:, None] != k[None, :])
        return np.where((row < column) | (row < 0) | (column < 0) | upper_of_same, -1, place)


def _find_rows(starts: np.ndarray, columns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the rows of L, found in two passes: first their lengths."""
    count = len(starts) - 1
    lengths = np.zeros(count + 1, np.int64)
    _row_patterns(starts, columns, lengths, np.empty(0, np.int64))
    factor_rows = np.cumsum(lengths)
    factor_columns = np.empty(factor_rows[-1], np.int64)
    _row_patterns(starts, columns, factor_rows.copy(), factor_columns)
    # Ascending: a column after those that it depends on.
    rows = np.repeat(np.arange(count), np.diff(factor_rows))
    return factor_rows, factor_columns[np.lexsort((factor_columns, rows))]


@njit(cache=True)
def _row_patterns(starts, columns, row, out):
    """Walk up the elimination tree from each entry: row[k + 1] counts, or out is filled from row[k] on."""
    count = len(starts) - 1
    parent, mark = np.full(count, -1), np.full(count, -1)
    for k in range(count):
        mark[k], place = k, row[k]
        for p in range(starts[k], starts[k + 1]):
            i = columns[p]
            while mark[i] != k:
                mark[i] = k
                if parent[i] < 0:
                    parent[i] = k
                if len(out):
                    out[place] = i
                    place += 1
                else:
                    row[k + 1] += 1
                i = parent[i]


@njit(cache=True, error_model="numpy")
def factorise(
    values, row_starts, row_columns, factor_rows, factor_columns, starts, rows, L, D, y, filled
):
    """Write L (by columns) and D (n,) of the matrix with these values; False if a pivot is not positive.

    y (n,) zeros and filled (n,): room to work in.
    """
    count, off = len(D), len(row_columns)
    for k in range(count):
        filled[k] = starts[k]
        for p in range(row_starts[k], row_starts[k + 1]):
            y[row_columns[p]] = values[p]
        pivot = values[off + k]
        for q in range(factor_rows[k], factor_rows[k + 1]):
            i = factor_columns[q]
            value = y[i]
            y[i] = 0.0
            end = filled[i]
            for p in range(starts[i], end):
                y[rows[p]] -= L[p] * value
            share = value / D[i]
            pivot -= share * value
            L[end] = share
            filled[i] = end + 1
        if not pivot > 0.0:
            y[:] = 0.0
            return False
        D[k] = pivot
    return True


@njit(cache=True, error_model="numpy", fastmath={"contract"})
def solve(starts, rows, L, D, b):
    """Replace b (n, RIGHT_SIDES), in the factor's order, by the solution."""
    count = len(D)
    for j in range(count):
        b0, b1, b2, b3 = b[j, 0], b[j, 1], b[j, 2], b[j, 3]
        for p in range(starts[j], starts[j + 1]):
            i, share = rows[p], L[p]
            b[i, 0] -= share * b0
            b[i, 1] -= share * b1
            b[i, 2] -= share * b2
            b[i, 3] -= share * b3
    for j in range(count - 1, -1, -1):
        inverse = 1.0 / D[j]
        b0, b1, b2, b3 = b[j, 0] * inverse, b[j, 1] * inverse, b[j, 2] * inverse, b[j, 3] * inverse
        for p in range(starts[j], starts[j + 1]):
            i, share = rows[p], L[p]
            b0 -= share * b[i, 0]
            b1 -= share * b[i, 1]
            b2 -= share * b[i, 2]
            b3 -= share * b[i, 3]
        b[j, 0], b[j, 1], b[j, 2], b[j, 3] = b0, b1, b2, b3
