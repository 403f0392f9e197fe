"""The fixed sparsity of a Hessian: where each element's block lands in one lower-triangular CSC matrix."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp
from numba import njit

from .energies.energy import Energy


class HessianPattern:
    """Pattern of the sum of `energies` over the vertices that `free` marks, built once per scene.

    The matrix is stored as the lower triangle of 3 x 3 vertex blocks (diagonal blocks whole), in CSC order:
    what a Cholesky factorisation reads.

    Attributes:
        free: (n,) indices of the free vertices, in the order of the matrix.
        indptr, indices: CSC structure of the (3n, 3n) lower matrix.
        adjacency: (n, n) symmetric vertex graph, for the ordering.
    """

    def __init__(self, energies: Sequence[Energy], vertex_count: int, free: np.ndarray) -> None:
        self.free = np.flatnonzero(free)
        number = np.full(vertex_count, -1, dtype=np.int64)
        number[self.free] = np.arange(len(self.free))
        n = len(self.free)
        keys = [np.arange(n) * (n + 1)]
        for energy in energies:
            keys.append(np.unique(_block_keys(number[energy.stencils], n)))
        key = np.unique(np.concatenate(keys))
        key = key[key >= 0]  # -1 stands for a pinned vertex or the upper triangle
        column, row = np.divmod(key, n)
        start = np.searchsorted(column, np.arange(n + 1))
        height = np.diff(start)
        within = np.arange(len(key)) - start[column]
        self._base = 9 * start[column] + 3 * within
        self._stride = 3 * height[column]
        self._slots = [
            np.searchsorted(key, block_key) if len(key) else block_key
            for block_key in (_block_keys(number[e.stencils], n) for e in energies)
        ]
        for slots, energy in zip(self._slots, energies):
            slots[_block_keys(number[energy.stencils], n) < 0] = -1
        self.indptr = np.concatenate([[0], np.cumsum(np.repeat(3 * height, 3))])
        self.indices = _row_indices(start, row)
        off = row != column
        ones = np.ones(off.sum())
        lower = sp.csr_matrix((ones, (row[off], column[off])), shape=(n, n))
        self.adjacency = (lower + lower.T).tocsr()
        self.diagonal = self._diagonal_places(start)

    @property
    def size(self) -> int:
        return 3 * len(self.free)

    def _diagonal_places(self, start: np.ndarray) -> np.ndarray:
        first = start[:-1]  # a diagonal block is the first of its column
        return (self._base[first][:, None] + np.arange(3) * (self._stride[first][:, None] + 1)).ravel()

    def assemble(self, energies: Sequence[Energy], x: np.ndarray) -> np.ndarray:
        """Values (nnz,) of the lower matrix at x (V, 3) [N/m]."""
        data = np.zeros(len(self.indices))
        for energy, slots in zip(energies, self._slots):
            elements, blocks = energy.active_hessian_blocks(x)
            _scatter(elements, blocks, slots, energy.stencils.shape[1], self._base, self._stride, data)
        return data

    def lower(self, data: np.ndarray) -> sp.csc_matrix:
        """The values as a scipy matrix; the upper halves of its diagonal blocks are stored too."""
        return sp.csc_matrix((data, self.indices, self.indptr), shape=(self.size, self.size))

    def symmetric(self, data: np.ndarray) -> sp.csc_matrix:
        """The whole symmetric (3n, 3n) matrix."""
        lower = sp.tril(self.lower(data), format="csc")
        return sp.csc_matrix(lower + sp.tril(lower, -1).T)


def _block_keys(stencils: np.ndarray, n: int) -> np.ndarray:
    """(N, k * k) key column * n + row of each block of each element, -1 where it is not stored."""
    row, column = stencils[:, :, None], stencils[:, None, :]
    key = column * n + row
    key = np.where((row < 0) | (column < 0) | (row < column), -1, key)
    return key.reshape(len(stencils), -1)


def _row_indices(start: np.ndarray, row: np.ndarray) -> np.ndarray:
    indices = np.empty(9 * len(row), dtype=np.int64)
    _fill_rows(start, row, indices)
    return indices


@njit(cache=True)
def _fill_rows(start, row, indices):
    at = 0
    for column in range(start.shape[0] - 1):
        for _ in range(3):
            for p in range(start[column], start[column + 1]):
                for r in range(3):
                    indices[at] = 3 * row[p] + r
                    at += 1


@njit(cache=True)
def _scatter(elements, blocks, slots, k, base, stride, data):
    for n in range(elements.shape[0]):
        e = elements[n]
        for a in range(k):
            for b in range(k):
                slot = slots[e, a * k + b]
                if slot >= 0:
                    for j in range(3):
                        at = base[slot] + j * stride[slot]
                        for i in range(3):
                            data[at + i] += blocks[n, 3 * a + i, 3 * b + j]
