"""Elimination of a sparse symmetric matrix: order, elimination tree, and supernodes of its factor.

Columns of the factor L with the same rows below them are a supernode. Those with few rows are merged with
their parent, at the price of some zeros (Ashcraft and Grimes 1989, "The influence of relaxed supernode
partitions on the multifrontal method").
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import depth_first_order

from reference_sim.kernels.kernel_cache import njit


def nested_dissection(adjacency: sp.csr_matrix) -> np.ndarray:
    """Return a fill-reducing order (n,) of a vertex graph by METIS."""
    if adjacency.shape[0] < 4:
        return np.arange(adjacency.shape[0])
    import pymetis

    graph = pymetis.CSRAdjacency(adj_starts=adjacency.indptr, adjacent=adjacency.indices)
    permutation, _ = pymetis.nested_dissection(adjacency=graph)
    return np.asarray(permutation, dtype=np.int64)


def supernodes(order: np.ndarray, pairs: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return the supernodes of a graph with these pairs (m, 2) of columns, eliminated in this order (n,).

    That is: the order as they are eliminated, a column's descendants right before it; in its numbers the
    first column of each supernode (k + 1,), the parent of each (k,), -1 at a root, the first of its rows
    (k + 1,) among those of all, and these.
    """
    _, _, parents, _ = eliminate(order, pairs)
    order = order[_descendants_first(parents)]
    starts, columns, parents, counts = eliminate(order, pairs)
    first = _merge(parents, counts)
    last = first[1:] - 1
    owner = np.repeat(np.arange(len(last)), np.diff(first))
    above = np.where(parents[last] < 0, -1, owner[parents[last]])
    below = np.append(0, np.cumsum(counts[last]))
    rows = np.empty(below[-1], np.int64)
    find_rows(starts, columns, owner, above, below[:-1].copy(), rows)
    return order, first, above, below, rows


def eliminate(order: np.ndarray, pairs: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return what elimination in this order (n,) does to a graph with these pairs (m, 2) of vertices.

    Vertices are numbered in that order from here on: starts (n + 1,) and columns (m,) of the rows of the
    lower matrix, without its diagonal; parents (n,) in the elimination tree, -1 at a root; counts (n,) of
    numbers below the diagonal in the columns of the factor.
    """
    count = len(order)
    moved = np.sort(np.argsort(order)[pairs], axis=1)
    row, columns = np.divmod(np.sort(moved[:, 1] * count + moved[:, 0]), max(count, 1))
    starts = np.searchsorted(row, np.arange(count + 1))
    parents, counts = np.full(count, -1), np.zeros(count, np.int64)
    _find_parents(starts, columns, parents, counts)
    return starts, columns, parents, counts


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


def _descendants_first(parents: np.ndarray) -> np.ndarray:
    """Return the nodes (n,) of a forest in an order in which descendants come right before a node."""
    count = len(parents)
    up = np.where(parents < 0, count, parents)  # one root for all trees
    tree = sp.csr_matrix((np.ones(count), (up, np.arange(count))), shape=(count + 1, count + 1))
    return depth_first_order(tree, count, return_predecessors=False)[:0:-1]


@njit(cache=True)
def _merge(parents, counts):
    """Return the first column (m + 1,) of each supernode, from the tree and counts (n,) of a postorder."""
    first, zeros, size = np.empty(len(parents) + 1, np.int64), np.zeros(len(parents)), 0
    for j in range(len(parents)):
        first[size], zeros[size] = j, 0.0
        size += 1
        while size > 1:
            last = first[size - 1] - 1  # of the supernode before
            if not first[size - 1] <= parents[last] <= j:
                break
            before, width = last + 1 - first[size - 2], j + 1 - first[size - 2]
            added = before * (j - last + counts[j] - counts[last])
            total = zeros[size - 2] + zeros[size - 1] + added
            limit = 0.8 if width < 16 else 0.1 if width < 48 else 0.05
            if added > 0 and total > limit * width * (0.5 * (width + 1) + counts[j]):
                break
            zeros[size - 2] = total
            size -= 1
    first[size] = len(parents)
    return first[: size + 1]
