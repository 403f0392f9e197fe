"""Supernodal Cholesky factorisation P A P^T = L L^T of sparse matrices of vertex blocks, by fronts.

Columns of L with the same rows below them are a supernode, whose numbers form one dense panel. Each
supernode has a front (Duff and Reid 1983, "The multifrontal solution of indefinite sparse symmetric linear
equations"): its panel, and what the panel subtracts from the rows below it, which is added to the front
of the parent in the elimination tree. Supernodes with few rows are merged with their parent, at the price
of some zeros (Ashcraft and Grimes 1989, "The influence of relaxed supernode partitions").
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import depth_first_order

from reference_sim.cholesky import eliminate, find_rows, invert
from reference_sim.kernels.kernel_cache import njit
from reference_sim.kernels.lanes import LANES, LANES_FLOAT64, TILE_ROWS, add_run, subtract_product

# Supernodes up to so many columns are merged while less than that share of the numbers are zeros.
RELAXED = (16.0, 0.8), (48.0, 0.1), (np.inf, 0.05)
BLOCK = 24  # rows of a panel that are subtracted from at once
# A pivot below this share of the diagonal has lost too many digits in float32.
LEAST_FLOAT32 = 1e-4

# Of each supernode: columns, rows below, stride and start of its panel and of what it subtracts, parent,
# first and last of its runs, and start of its unknowns. A run (first, end, place) of rows below is one in
# the parent's front, too.
FIELDS = (
    "width", "rank", "stride", "panel", "update_stride", "update", "parent", "run", "run_end", "start",
)  # fmt: skip
FRONT = np.dtype([(name, np.int64) for name in FIELDS])


class Cholesky:
    """Factorisation of symmetric matrices of one pattern, in float64, or in float32 where that serves.

    Args:
        indptr, indices: CSC structure of the lower n x n matrix; entries above the diagonal are ignored.
        order: (n,) fill-reducing, which keeps the numbers of a vertex together.
        block: numbers of a vertex.

    Example: a matrix of one number a vertex, whose eigenvalues are 3 and 1.

        >>> import numpy as np
        >>> from reference_sim.supernodal import Cholesky
        >>> cholesky = Cholesky(np.array([0, 2, 3]), np.array([0, 1, 1]), np.array([1, 0]))
        >>> cholesky.factorise(np.array([2.0, 1.0, 2.0]))
        True
        >>> cholesky.solve(np.array([3.0, 3.0])).round(12)
        array([1., 1.])
        >>> cholesky.factorise(np.array([2.0, 3.0, 2.0]))  # eigenvalues 5 and -1
        False
    """

    def __init__(
        self, indptr: np.ndarray, indices: np.ndarray, order: np.ndarray, block: int = 1
    ) -> None:
        column = np.repeat(np.arange(len(order)), np.diff(indptr))
        # The first number of each block, that of the block of every number, and row and column therein.
        heads = np.flatnonzero((column % block == 0) & (indices % block == 0))
        head = (
            indptr[column - column % block] + (np.arange(len(column)) - indptr[column]) // block * block
        )
        head = np.searchsorted(heads, head)
        i, j = indices % block, column % block
        blocks = np.stack([indices[heads], column[heads]], axis=1) // block
        nodes = _Nodes(order[::block] // block, blocks[blocks[:, 0] > blocks[:, 1]], block)
        self._nodes = nodes
        ends = nodes.place[blocks]
        low, high = ends.min(axis=1), ends.max(axis=1)
        owner, turned = nodes.owner[low], (ends[:, 0] < ends[:, 1])[head]
        front = nodes.fronts[owner]
        start = front["panel"] + block * (low - nodes.first[owner]) * front["stride"]
        start, stride = (start + nodes.local(owner, high))[head], front["stride"][head]
        place = start + np.where(turned, i * stride + j, j * stride + i)
        self._places = np.where(indices >= column, place, -1)
        self._room: dict[type, tuple[np.ndarray, ...]] = {}  # by kind of number
        self._kind: type = np.float64

    def factorise(self, values: np.ndarray, *, kind: type = np.float64) -> bool:
        """Factorise the matrix with these values (nnz,).

        Returns False if it is not positive definite; in np.float32 also if it is so nearly singular that
        seven digits do not suffice.
        """
        if kind not in self._room:
            self._room[kind] = tuple(np.zeros(size, kind) for size in self._nodes.sizes)
        self._kind = kind
        least = kind(LEAST_FLOAT32 if kind is np.float32 else 0.0)
        nodes = self._nodes
        return _factorise(
            values, self._places, nodes.fronts, nodes.runs, nodes.fillers, *self._room[kind], least
        )

    def solve(self, b: np.ndarray) -> np.ndarray:
        """Solve with the last factorisation, also one that failed: b (n,) or (n, k), same shape back."""
        L, _, work = self._room[self._kind]
        x = np.zeros((len(b) + 1, *b.shape[1:]))  # one more for columns that fill a panel up
        x[:-1] = b
        for column in x.T if b.ndim > 1 else (x,):
            _solve(self._nodes.fronts, self._nodes.unknowns, L, work, column)
        return x[:-1]


class _Nodes:
    """Supernodes of a graph with these pairs (m, 2) of vertices, eliminated in this order (n,).

    Attributes:
        order, place: (n,) vertices as they are eliminated, a vertex's descendants before it, and back.
        owner: (n,) supernode of each, in that order. first: (m + 1,) first vertex of each supernode.
        fronts: (m,) of FRONT, the layout of panels; and runs (k, 3). sizes: of panels, updates and room.
        unknowns: (l,) of all fronts; columns that fill one up to TILE_ROWS have number n, which is always 0.
        fillers: places of the diagonal of these.
    """

    def __init__(self, order: np.ndarray, pairs: np.ndarray, block: int) -> None:
        count = len(order)
        _, _, parents, _ = eliminate(order, pairs)
        self.order = order = order[_descendants_first(parents)]
        self.place = invert(order)
        starts, columns, parents, counts = eliminate(order, pairs)
        self.first = first = _merge(parents, counts, block)
        last, spans = first[1:] - 1, np.diff(first)
        self.owner = np.repeat(np.arange(len(spans)), spans)
        above = np.where(parents[last] < 0, -1, self.owner[parents[last]])
        ranks = counts[last]
        below = np.append(0, np.cumsum(ranks))
        rows = np.empty(below[-1], np.int64)
        find_rows(starts, columns, self.owner, above, below[:-1].copy(), rows)
        # The vertices of each front in their order: those of the supernode, and its rows.
        self._begin = np.append(0, np.cumsum(spans + ranks))
        node = np.repeat(np.arange(len(spans)), spans + ranks)
        within = np.arange(len(node)) - self._begin[node]
        own = within < spans[node]
        vertices = np.empty(len(node), np.int64)
        vertices[own], vertices[~own] = np.arange(count), rows
        self._keys, self._spans, self._block = node * count + vertices, spans, block
        self._widths = widths = -(-block * spans // TILE_ROWS) * TILE_ROWS
        heights = block * ranks
        strides, update_strides = _pad(widths + heights), _pad(heights)
        panels, begin = (np.append(0, np.cumsum(k)) for k in (widths * strides, widths + heights))
        updates, room = _two_stacks(above, (heights + TILE_ROWS) * update_strides)
        self.runs, run_ends = self._runs(above, below, rows)
        self.fronts = np.zeros(len(spans), FRONT)
        fields = (
            widths, heights, strides, panels[:-1], update_strides, updates, above,
            np.append(0, run_ends)[:-1], run_ends, begin[:-1],
        )  # fmt: skip
        for name, numbers in zip(FIELDS, fields):
            self.fronts[name] = numbers
        self.unknowns = np.full(begin[-1], block * count)
        local = begin[node] + self.local(node, vertices)
        self.unknowns[local[:, None] + np.arange(block)] = block * order[vertices][:, None] + np.arange(
            block
        )
        filler = np.flatnonzero(self.unknowns == block * count)
        of = np.searchsorted(begin, filler, side="right") - 1
        self.fillers = panels[of] + (filler - begin[of]) * (strides[of] + 1)
        sizes = panels[-1], room, (widths + heights).max(initial=0)
        self.sizes = tuple(size + 2 * LANES for size in sizes)  # a vector may reach beyond the end

    def local(self, node: np.ndarray, vertices: np.ndarray) -> np.ndarray:
        """Return the number (m,) in the front of these supernodes (m,) of the first unknown of vertices."""
        k = np.searchsorted(self._keys, node * len(self.order) + vertices) - self._begin[node]
        beyond = self._widths[node] - self._block * self._spans[node]
        return self._block * k + np.where(k < self._spans[node], 0, beyond)

    def _runs(
        self, above: np.ndarray, below: np.ndarray, rows: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the runs (k, 3) of all supernodes, and their end for each supernode."""
        node = np.repeat(np.arange(len(above)), np.diff(below))
        target = self.local(above[node], rows)
        begins = np.ones(len(rows), bool)
        begins[1:] = (np.diff(target) != self._block) | (np.diff(node) != 0)
        head = np.flatnonzero(begins)
        length = np.diff(np.append(head, len(rows)))
        first = self._block * (head - below[node[head]])
        runs = np.stack([first, first + self._block * length, target[head]], axis=1)
        return runs, np.searchsorted(node[head], np.arange(len(above)), side="right")


def _pad(numbers: np.ndarray) -> np.ndarray:
    """Return strides of rows of so many numbers, of which a vector may begin at any."""
    return -(-numbers // LANES) * LANES + LANES


def _descendants_first(parents: np.ndarray) -> np.ndarray:
    """Return the nodes (n,) of a forest in an order in which descendants come right before a node."""
    count = len(parents)
    up = np.where(parents < 0, count, parents)  # one root for all trees
    tree = sp.csr_matrix((np.ones(count), (up, np.arange(count))), shape=(count + 1, count + 1))
    return depth_first_order(tree, count, return_predecessors=False)[:0:-1]


def _two_stacks(parents: np.ndarray, sizes: np.ndarray) -> tuple[np.ndarray, int]:
    """Return where (m,) nodes of a forest, in such an order, keep so much until their parent has taken it.

    A node keeps it on one of two stacks, its parent on the other. The room for both comes second.
    """
    sides, places = np.zeros((2, len(parents)), np.int64)
    for node in np.flatnonzero(parents >= 0)[::-1]:
        sides[node] = 1 - sides[parents[node]]
    waiting: list[int] = []
    tops, rooms = np.zeros((2, 2), np.int64)
    for node, side in enumerate(sides):
        places[node] = tops[side]
        tops[side] += sizes[node]
        rooms[side] = max(rooms[side], tops[side])
        while waiting and parents[waiting[-1]] == node:
            tops[1 - side] -= sizes[waiting.pop()]
        waiting.append(node)
    return places + rooms[0] * sides, rooms.sum()


@njit(cache=True)
def _merge(parents, counts, block):
    """Return the first vertex (m + 1,) of each supernode, from the tree and counts (n,) of a postorder."""
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
            limit = 0.0
            for columns, share in RELAXED:
                if block * width < columns:
                    limit = share
                    break
            if added > 0 and total > limit * width * (0.5 * (width + 1) + counts[j]):
                break
            zeros[size - 2] = total
            size -= 1
    first[size] = len(parents)
    return first[: size + 1]


@njit(cache=True)
def _clear(x):
    for i in range(len(x)):
        x[i] = 0.0


@njit(cache=True)
def _subtract(C, c, c_stride, P, p, p_stride, count, rows, columns):
    """Subtract P^T P from the upper triangle of C: of P `count` rows, of C `rows`, of both `columns`."""
    lanes = LANES_FLOAT64 if C.itemsize == 8 else LANES
    for i in range(0, columns, 2 * lanes):
        for a in range(0, min(rows, i + 2 * lanes), TILE_ROWS):
            if columns - i > lanes:
                subtract_product(C, c + a * c_stride + i, c_stride, P, p + a, p + i, p_stride, count, 2)
            else:
                subtract_product(C, c + a * c_stride + i, c_stride, P, p + a, p + i, p_stride, count, 1)


@njit(cache=True)
def _add_update(front, parent, runs, L, updates):
    """Add what a front subtracts to that of its parent."""
    for p in range(front.run, front.run_end):
        for a in range(runs[p, 0], runs[p, 1]):
            row, source = runs[p, 2] + a - runs[p, 0], front.update + a * front.update_stride
            for q in range(p, front.run_end):
                first = max(runs[q, 0], a)
                column, length = runs[q, 2] + first - runs[q, 0], runs[q, 1] - first
                if row < parent.width:
                    add_run(
                        updates, source + first, L, parent.panel + row * parent.stride + column, length
                    )
                else:
                    target = parent.update + (row - parent.width) * parent.update_stride
                    add_run(updates, source + first, updates, target + column - parent.width, length)


@njit(cache=True, error_model="numpy")
def _factorise(values, places, fronts, runs, fillers, L, updates, work, least):
    """Write the rows of the panels of L^T, with inverses on the diagonal; False at a pivot that is too small.

    least: the smallest pivot, as a share of the matrix's diagonal. work: room.
    """
    _clear(L)
    for i in range(len(values)):
        if places[i] >= 0:
            L[places[i]] += values[i]
    for i in fillers:
        L[i] = 1.0
    waiting, count = np.empty(len(fronts), np.int64), 0  # fronts before that of their parent
    for s in range(len(fronts)):
        front = fronts[s]
        width, rank, stride, update = front.width, front.rank, front.stride, front.update
        _clear(updates[update : update + rank * front.update_stride])
        for j in range(width):
            work[j] = least * L[front.panel + j * (stride + 1)]
        while count and fronts[waiting[count - 1]].parent == s:
            count -= 1
            _add_update(fronts[waiting[count]], front, runs, L, updates)
        for begin in range(0, width, BLOCK):
            end, column = min(begin + BLOCK, width), front.panel + begin
            at = column + begin * stride
            _subtract(L, at, stride, L, column, stride, begin, end - begin, width + rank - begin)
            for j in range(begin, end, TILE_ROWS):
                row, length = front.panel + j * (stride + 1), width + rank - j
                _subtract(L, row, stride, L, at + j - begin, stride, j - begin, TILE_ROWS, length)
                if not _eliminate(L, row, stride, length, work, j):
                    return False
        below = front.panel + width
        _subtract(updates, update, front.update_stride, L, below, stride, width, rank, rank)
        waiting[count] = s
        count += 1
    return True


@njit(cache=True, error_model="numpy")
def _eliminate(L, start, stride, length, least, j):
    """Eliminate TILE_ROWS rows of a panel, from their diagonal on; False at a pivot that is too small."""
    for a in range(TILE_ROWS):
        row = L[start + a * stride + a : start + a * stride + length]
        if not row[0] > least[j + a]:
            return False
        inverse = L.dtype.type(1.0 / np.sqrt(row[0]))
        for i in range(len(row)):
            row[i] *= inverse
        for b in range(a + 1, TILE_ROWS):
            source = row[b - a :]
            target = L[start + b * stride + b : start + b * stride + length]
            share = source[0]
            for i in range(len(source)):
                target[i] -= share * source[i]
        row[0] = inverse
    return True


@njit(cache=True, fastmath={"contract", "reassoc", "nsz"})
def _solve(fronts, unknowns, L, work, b):
    """Replace b (n + 1,) by the solution; its last number stays 0."""
    count = len(fronts)
    for step in range(2 * count):
        front = fronts[min(step, 2 * count - 1 - step)]
        width, stride, changed = front.width, front.stride, front.width + front.rank
        numbers = unknowns[front.start : front.start + changed]
        x = work[: len(numbers)]
        for i in range(len(numbers)):
            x[i] = b[numbers[i]]
        if step < count:
            for j in range(0, width, TILE_ROWS):
                _solve_down(L, front.panel + j * (stride + 1), stride, x[j:])
        else:
            changed = width
            for j in range(width - TILE_ROWS, -1, -TILE_ROWS):
                _solve_up(L, front.panel + j * (stride + 1), stride, x[j:])
        for i in range(changed):
            b[numbers[i]] = x[i]


@njit(cache=True, fastmath={"contract", "reassoc", "nsz"})
def _solve_down(L, start, stride, b):
    """Solve for the first TILE_ROWS numbers of b with rows of L^T from `start` on; subtract from the rest."""
    second, third = start + stride, start + 2 * stride
    x = b[0] * L[start]
    y = (b[1] - L[start + 1] * x) * L[second + 1]
    z = (b[2] - L[start + 2] * x - L[second + 2] * y) * L[third + 2]
    b[0], b[1], b[2] = x, y, z
    rest, end = b[3:], len(b)
    u, v, w = L[start + 3 : start + end], L[second + 3 : second + end], L[third + 3 : third + end]
    for i in range(len(rest)):
        rest[i] -= u[i] * x + v[i] * y + w[i] * z


@njit(cache=True, fastmath={"contract", "reassoc", "nsz"})
def _solve_up(L, start, stride, b):
    """Solve for the first TILE_ROWS numbers of b where the rest is solved for."""
    second, third = start + stride, start + 2 * stride
    rest, end = b[3:], len(b)
    u, v, w = L[start + 3 : start + end], L[second + 3 : second + end], L[third + 3 : third + end]
    x = y = z = L.dtype.type(0.0)
    for i in range(len(rest)):
        x += u[i] * rest[i]
        y += v[i] * rest[i]
        z += w[i] * rest[i]
    z = (b[2] - z) * L[third + 2]
    y = (b[1] - y - L[second + 2] * z) * L[second + 1]
    x = (b[0] - x - L[start + 1] * y - L[start + 2] * z) * L[start]
    b[0], b[1], b[2] = x, y, z
