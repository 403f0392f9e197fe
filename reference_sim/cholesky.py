"""Sparse Cholesky factorisation P A P^T = L L^T, by fronts.

The numbers of a supernode (reference_sim.elimination) form one dense panel. Each supernode has a front (Duff
and Reid 1983, "The multifrontal solution of indefinite sparse symmetric linear equations"): its panel, and
what that subtracts from the rows below it, which is added to the front of the parent in the elimination
tree.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from reference_sim.elimination import supernodes
from reference_sim.kernels.kernel_cache import njit
from reference_sim.kernels.lanes import (
    LANES,
    LANES_FLOAT64,
    TILE_ROWS,
    add_run,
    dot_rows,
    subtract_product,
)

BLOCK = 24  # rows of a panel that are subtracted from at once
# A pivot below this share of the diagonal has lost too many digits in float32.
LEAST_FLOAT32 = 1e-4

# Of each supernode: columns, rows below, stride and start of its panel and of what it subtracts, parent,
# first and last of its runs, and start of its unknowns.
FIELDS = "width rank stride panel update_stride update parent run run_end start"
FRONT = np.dtype([(name, np.int64) for name in FIELDS.split()])
# Places of a matrix's values, -1 where they are ignored; fronts (m,); runs (first, end, place) of rows
# below, which are one in the parent's front, too; places of the diagonal of columns that fill a panel up to
# TILE_ROWS; numbers of all fronts' unknowns, n for those columns.
Layout = namedtuple("Layout", "places fronts runs fillers unknowns")
Room = namedtuple("Room", "L updates work")


class Cholesky:
    """Factorisation of symmetric matrices of one pattern, in float64, or in float32 where that serves.

    Args:
        indptr, indices: CSC structure of the lower n x n matrix; entries above the diagonal are ignored.
        order: (n,) fill-reducing.

    Example: eigenvalues are 3 and 1.

        >>> import numpy as np
        >>> from reference_sim.cholesky import Cholesky
        >>> cholesky = Cholesky(np.array([0, 2, 3]), np.array([0, 1, 1]), np.array([1, 0]))
        >>> cholesky.factorise(np.array([2.0, 1.0, 2.0]))
        True
        >>> cholesky.solve(np.array([3.0, 3.0])).round(12)
        array([1., 1.])
        >>> cholesky.factorise(np.array([2.0, 3.0, 2.0]))  # eigenvalues 5 and -1
        False
    """

    def __init__(self, indptr: np.ndarray, indices: np.ndarray, order: np.ndarray) -> None:
        count = len(order)
        entries = np.stack([indices, np.repeat(np.arange(count), np.diff(indptr))], axis=1)
        stored = entries[:, 0] >= entries[:, 1]
        order, first, above, below, rows = supernodes(order, entries[entries[:, 0] > entries[:, 1]])
        spans, ranks = np.diff(first), np.diff(below)
        # Columns and rows of each front; columns without a number fill it up.
        widths = -(-spans // TILE_ROWS) * TILE_ROWS
        begin = np.append(0, np.cumsum(widths + ranks))
        front = np.repeat(np.arange(len(spans)), widths + ranks)
        within = np.arange(len(front)) - begin[front]
        numbers = np.full(len(front), -1)
        numbers[within < spans[front]] = np.arange(count)
        numbers[within >= widths[front]] = rows
        named = np.flatnonzero(numbers >= 0)
        keys = front[named] * count + numbers[named]

        def local(fronts: np.ndarray, numbers: np.ndarray) -> np.ndarray:
            """Return the places (k,) of numbers (k,) in fronts (k,)."""
            return within[named[np.searchsorted(keys, fronts * count + numbers)]]

        strides, update_strides = _pad(widths + ranks), _pad(ranks)
        panels = np.append(0, np.cumsum(widths * strides))
        updates, room = _two_stacks(above, (ranks + TILE_ROWS) * update_strides)
        node = np.repeat(np.arange(len(spans)), ranks)
        target = local(above[node], rows)
        head = np.ones(len(rows), bool)
        head[1:] = (np.diff(target) != 1) | (np.diff(node) != 0)
        head = np.flatnonzero(head)
        start = head - below[node[head]]
        runs = np.stack([start, start + np.diff(np.append(head, len(rows))), target[head]], axis=1)
        run_ends = np.searchsorted(node[head], np.arange(len(spans)), side="right")
        fields = [
            widths, ranks, strides, panels[:-1], update_strides, updates, above,
            np.append(0, run_ends)[:-1], run_ends, begin[:-1],
        ]  # fmt: skip
        fronts = np.rec.fromarrays(fields, dtype=FRONT)
        low, high = np.sort(np.argsort(order)[entries[stored]], axis=1).T
        places = np.full(len(indices), -1)
        s = np.repeat(np.arange(len(spans)), spans)[low]
        places[stored] = panels[s] + (low - first[s]) * strides[s] + local(s, high)
        filler = np.flatnonzero(numbers < 0)
        fillers = panels[front[filler]] + within[filler] * (strides[front[filler]] + 1)
        # A signed index is first asked whether it counts from the end.
        unknowns = np.append(order, count)[numbers].astype(np.uint32)
        self.layout = Layout(places, fronts, runs, fillers, unknowns)
        sizes = panels[-1], room, (widths + ranks).max(initial=0)
        self._sizes = tuple(size + 2 * LANES for size in sizes)  # a vector may reach beyond the end
        self._rooms: dict[type, Room] = {}
        self._kind: type = np.float64

    def room(self, kind: type) -> Room:
        """Return the room for the factor in this kind of number."""
        if kind not in self._rooms:
            self._rooms[kind] = Room(*(np.zeros(size, kind) for size in self._sizes))
        return self._rooms[kind]

    def factorise(self, values: np.ndarray, *, kind: type = np.float64) -> bool:
        """Factorise the matrix with these values (nnz,).

        Returns False if it is not positive definite, in np.float32 also if its seven digits do not
        suffice.
        """
        self._kind = kind
        least = kind(LEAST_FLOAT32 if kind is np.float32 else 0.0)
        return factorise(values, self.layout, self.room(kind), least)

    def solve(self, b: np.ndarray) -> np.ndarray:
        """Solve with the last factorisation: b (n,) or (n, k), same shape back."""
        x = np.zeros((b[0].size, len(b) + 1), self._kind)
        x[:, :-1] = b.reshape(len(b), -1).T
        solve(self.layout, self.room(self._kind), x)
        return x[:, :-1].T.reshape(b.shape).astype(np.float64)


def _pad(numbers: np.ndarray) -> np.ndarray:
    """Return strides of rows of so many numbers, of which a vector may begin at any."""
    return -(-(numbers + LANES) // 8) * 8


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
def _subtract(C, c, c_stride, P, p, p_stride, count, rows, columns):
    """Subtract P^T P from the upper triangle of C: of P `count` rows, of C `rows`, of both `columns`."""
    lanes = LANES_FLOAT64 if C.itemsize == 8 else LANES
    for i in range(0, columns, 2 * lanes):
        for a in range(0, min(rows, i + 2 * lanes), TILE_ROWS):
            if columns - i > lanes:
                subtract_product(C, c + a * c_stride + i, c_stride, P, p + a, p + i, p_stride, count, 2)
            else:
                subtract_product(C, c + a * c_stride + i, c_stride, P, p + a, p + i, p_stride, count, 1)


@njit(cache=True, inline="always")
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
def factorise(values, layout, room, least):
    """Write the rows of the panels of L^T, with inverses on the diagonal; False at a pivot that is too small.

    least: the smallest pivot, as a share of the matrix's diagonal.
    """
    fronts, L, updates, work = layout.fronts, room.L, room.updates, room.work
    L.fill(0.0)
    for i in range(len(values)):
        if layout.places[i] >= 0:
            L[layout.places[i]] += values[i]
    for i in layout.fillers:
        L[i] = 1.0
    waiting, count = np.empty(len(fronts), np.int64), 0  # fronts before that of their parent
    for s in range(len(fronts)):
        front = fronts[s]
        width, rank, stride, update = front.width, front.rank, front.stride, front.update
        updates[update : update + rank * front.update_stride].fill(0.0)
        for j in range(width):
            work[j] = least * L[front.panel + j * (stride + 1)]
        while count and fronts[waiting[count - 1]].parent == s:
            count -= 1
            _add_update(fronts[waiting[count]], front, layout.runs, L, updates)
        for begin in range(0, width, BLOCK):
            end, column = min(begin + BLOCK, width), front.panel + begin
            at = column + begin * stride
            _subtract(L, at, stride, L, column, stride, begin, end - begin, width + rank - begin)
            for j in range(begin, end, TILE_ROWS):
                row, length = front.panel + j * (stride + 1), width + rank - j
                _subtract(
                    L, row, stride, L, at + j - begin, stride, j - begin, min(TILE_ROWS, length), length
                )
                if not _eliminate(L, row, stride, length, work, j):
                    return False
        below = front.panel + width
        _subtract(updates, update, front.update_stride, L, below, stride, width, rank, rank)
        waiting[count] = s
        count += 1
    return True


@njit(cache=True, inline="always", error_model="numpy")
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


@njit(cache=True)
def solve(layout, room, b):
    """Replace b (k, n + 1), whose last numbers are 0, by the solutions."""
    fronts, L, count = layout.fronts, room.L, len(layout.fronts)
    for step in range(2 * count):
        front = fronts[min(step, 2 * count - 1 - step)]
        width, stride, changed = front.width, front.stride, front.width + front.rank
        numbers = layout.unknowns[front.start : front.start + changed]
        x = room.work[: len(numbers)]
        if step >= count:
            changed = width
        for side in range(len(b)):
            for i in range(len(numbers)):
                x[i] = b[side, numbers[i]]
            if step < count:
                for j in range(0, width, TILE_ROWS):
                    _solve_down(L, front.panel + j * (stride + 1), stride, x[j:])
            else:
                for j in range(width - TILE_ROWS, -1, -TILE_ROWS):
                    _solve_up(L, front.panel + j * (stride + 1), stride, x[j:])
            for i in range(changed):
                b[side, numbers[i]] = x[i]


@njit(cache=True, inline="always")
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


@njit(cache=True, inline="always")
def _solve_up(L, start, stride, b):
    """Solve for the first TILE_ROWS numbers of b where the rest is solved for."""
    second, third = start + stride, start + 2 * stride
    x, y, z = dot_rows(L, start + 3, stride, b, 3, len(b) - 3)
    z = (b[2] - z) * L[third + 2]
    y = (b[1] - y - L[second + 2] * z) * L[second + 1]
    x = (b[0] - x - L[start + 1] * y - L[start + 2] * z) * L[start]
    b[0], b[1], b[2] = x, y, z
