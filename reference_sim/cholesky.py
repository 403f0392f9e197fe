"""Elimination of sparse symmetric matrices, and LDL^T of scalar ones, to be called in the middle of a step.

The factor is found row by row (Davis 2005, "LDL: a concise sparse Cholesky factorization package"): row k
of L solves a triangular system with the rows above it. Hessians have `supernodal.Cholesky`.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from reference_sim.kernels.kernel_cache import njit


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


def eliminate(order: np.ndarray, pairs: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return what elimination in this order (n,) does to a graph with these pairs (m, 2) of vertices.

    Vertices are numbered in that order from here on: starts (n + 1,) and columns (m,) of the rows of the
    lower matrix, without its diagonal; parents (n,) in the elimination tree, -1 at a root; counts (n,) of
    numbers below the diagonal in the columns of the factor.
    """
    count = len(order)
    moved = np.sort(invert(order)[pairs], axis=1)
    row, columns = np.divmod(np.sort(moved[:, 1] * count + moved[:, 0]), max(count, 1))
    starts = np.searchsorted(row, np.arange(count + 1))
    parents, counts = np.full(count, -1), np.zeros(count, np.int64)
    _find_parents(starts, columns, parents, counts)
    return starts, columns, parents, counts


def invert(order: np.ndarray) -> np.ndarray:
    """Return the place (n,) of each number in an order (n,)."""
    place = np.empty(len(order), np.int64)
    place[order] = np.arange(len(order))
    return place


@njit(cache=True)
def _find_parents(starts, columns, parents, counts):
    """Walk up the elimination tree from each entry, and build it on the way."""
    mark = np.full(len(parents), -1)
    for k in range(len(parents)):
        mark[k] = k
        for p in range(starts[k], starts[k + 1]):
            i = columns[p]
            while mark[i] != k:
                mark[i] = k
                if parents[i] < 0:
                    parents[i] = k
                counts[i] += 1
                i = parents[i]


@njit(cache=True)
def find_rows(starts, columns, node, parents, places, rows):
    """Write the rows of the factor's columns into `rows` from places (m,) on, in ascending order.

    node (n,): which of m groups of columns one belongs to, of which the rows below the group are written.
    parents (m,): of groups.
    """
    mark = np.full(len(parents), -1)
    for k in range(len(starts) - 1):
        mark[node[k]] = k
        for p in range(starts[k], starts[k + 1]):
            i = node[columns[p]]
            while mark[i] != k:
                mark[i] = k
                rows[places[i]] = k
                places[i] += 1
                i = parents[i]


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
        self._place = invert(self.order)
        self.row_starts, columns, parents, counts = eliminate(self.order, pair)
        self._keys = np.repeat(np.arange(count), np.diff(self.row_starts)) * count + columns
        self.starts = np.append(0, np.cumsum(counts))
        rows = np.empty(self.starts[-1], np.int64)
        find_rows(self.row_starts, columns, np.arange(count), parents, self.starts[:-1].copy(), rows)
        by_columns = sp.csc_matrix((np.ones(len(rows)), rows, self.starts), shape=(count, count))
        by_rows = by_columns.tocsr()  # ascending: a column after those that it depends on
        self.factor_rows = by_rows.indptr.astype(np.int64)
        # A signed index is first asked whether it counts from the end: a quarter of a factorisation's
        # time.
        self.row_columns, self.factor_columns, self.rows = (
            numbers.astype(np.uint32) for numbers in (columns, by_rows.indices, rows)
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
