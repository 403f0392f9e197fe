"""Layouts of kernels that work on several elements side by side, by vector instructions."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from math import isqrt, prod
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from reference_sim.kernels.fast_kernels import LANES
from reference_sim.kernels.kernel_cache import njit

# A float64 kernel copies corners and constants of LANES_FLOAT64 elements into one array u of known size,
# row after row, works them out in a loop of fixed length without a branch, and hands the results out.
# Within one array the compiler knows that nothing overlaps.
LANES_FLOAT64 = 8

_STEEP = np.tan(np.pi / 8)
# arctan(t) = t + t z p(z) for z = t^2 up to tan(pi/8)^2: through 13 Chebyshev points, at most 5e-17 off.
_P0, _P1, _P2, _P3, _P4, _P5 = (
    -0.33333333333333324206, 0.19999999999997013892, -0.14285714285329708164,
    0.11111111085322108759, -0.09090908059031191027, 0.07692281099937743250,
)  # fmt: skip
_P6, _P7, _P8, _P9, _P10, _P11 = (
    -0.06666205259976526188, 0.05876834004614160666, -0.05217312574061591002,
    0.04499500728984032009, -0.03338782450121195152, 0.01511376509660092467,
)  # fmt: skip


@njit(cache=True, inline="always", error_model="numpy")
def arctan2(y, x):
    """Return the angle without a branch, within 2e-16; (0, 0) gives NaN."""
    along, across = abs(x), abs(y)
    low, high = min(along, across), max(along, across)
    steep = low > _STEEP * high
    t = ((low - high) if steep else low) / ((low + high) if steep else high)
    z = t * t  # at most tan(pi/8)^2
    high = _P6 + z * (_P7 + z * (_P8 + z * (_P9 + z * (_P10 + z * _P11))))
    low = _P0 + z * (_P1 + z * (_P2 + z * (_P3 + z * (_P4 + z * _P5))))
    square = z * z
    a = t + t * z * (low + square * square * square * high)
    a = a + 0.25 * np.pi if steep else a
    a = 0.5 * np.pi - a if across > along else a
    a = np.pi - a if x < 0.0 else a
    return -a if y < 0.0 else a


@njit(cache=True)
def add_blocks(u, n, e, corners, slots, base, stride, data):
    """Add the 3 x 3 blocks of element e in lane n of u to the values of a matrix, see `BlockPlaces`.

    Of its corners x corners blocks, u holds those on and below the diagonal, row after row.
    """
    row = 0
    for a in range(corners):
        for b in range(a + 1):
            slot = slots[e, a * corners + b]
            if slot >= 0:
                at, step = base[slot], stride[slot]
                for j in range(3):
                    for i in range(3):
                        data[at + j * step + i] += u[(row + 3 * i + j) * LANES_FLOAT64 + n]
            slot = slots[e, b * corners + a]
            if slot >= 0 and a != b:
                at, step = base[slot], stride[slot]
                for j in range(3):
                    for i in range(3):
                        data[at + j * step + i] += u[(row + 3 * j + i) * LANES_FLOAT64 + n]
            row += 9


@dataclass(frozen=True)
class BlockPlaces:
    """Places of the blocks of elements with k corners in an array of values.

    slots (N, k k): number of each element's block of corners a, b at a k + b; -1 where it is not stored.
    base, stride: by number; entry (i, j) of a block belongs at base + j stride + i.
    """

    slots: np.ndarray
    base: np.ndarray
    stride: np.ndarray
    size: int  # of a block, 3 or 1

    def add(self, elements: np.ndarray, blocks: np.ndarray, data: np.ndarray) -> None:
        """Add the matrices (n, size k, size k) of some elements (n,)."""
        corners = isqrt(self.slots.shape[1])
        expected = (len(elements), self.size * corners, self.size * corners)
        if blocks.shape != expected:
            raise ValueError(f"matrices of elements have shape {blocks.shape}: expected {expected}")
        _add(elements, blocks, self.slots, corners, self.size, self.base, self.stride, data)


@njit(cache=True)
def _add(elements, blocks, slots, corners, size, base, stride, data):
    for n in range(elements.shape[0]):
        e = elements[n]
        for a in range(corners):
            for b in range(corners):
                slot = slots[e, a * corners + b]
                if slot >= 0:
                    for j in range(size):
                        at = base[slot] + j * stride[slot]
                        for i in range(size):
                            data[at + i] += blocks[n, size * a + i, size * b + j]


# The state of early-stopped L-BFGS is u (3V,), the displacement [m] from a point x_0 that float64 has;
# so round-off is that of a displacement of millimetres and not of a body metres away. Elements come in
# blocks of LANES, the last one filled up with elements of no stiffness; arrays of a block lie one
# quantity after the other.
SCRATCH = 24 * LANES  # numbers that a kernel may use for its own
FAST = {"nnan", "nsz", "reassoc", "contract"}
TINY = np.float32(1e-30)
HALF, ONE, TWO, THREE = np.float32(0.5), np.float32(1.0), np.float32(2.0), np.float32(3.0)


@dataclass(frozen=True)
class Float32Lanes:
    """A term as `CompiledLBFGS` takes it: what the function for "float32_lanes" returns.

    gradient: compiled function (data, u, gradient, scratch) -> energy [J] at u (3V,) [m], which adds to
    gradient (3V,) [N]; u, gradient and scratch (SCRATCH,) are float32. freeze: function of x_0 (V, 3)
    [m], called once a step, that returns `data`. stiffness: compiled function ((*data, places), values),
    which adds a scalar stiffness [N/m] that differs from step to step to the preconditioner, for stencils
    (S, k) at places (B, k k LANES), -1 where nothing is stored.
    """

    gradient: Any
    freeze: Callable[[np.ndarray], tuple[Any, ...]]
    stiffness: Any = None
    stencils: np.ndarray | None = None


def to_blocks(values: np.ndarray) -> np.ndarray:
    """Lay numbers (N, k) of N elements out in blocks (B, k LANES), filled up with zeros."""
    count, width = values.shape
    padded = np.zeros((-(-count // LANES) * LANES, width), values.dtype)
    padded[:count] = values
    blocks = padded.reshape(-1, LANES, width).transpose(0, 2, 1)
    return np.ascontiguousarray(blocks).reshape(-1, width * LANES)


def lay_out(stencils: np.ndarray, *constants: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return 3 times the vertices of stencils (N, k), and constants (N,) or (N, ...), both in blocks."""
    columns = np.concatenate([c.reshape(len(c), prod(c.shape[1:])) for c in constants], axis=1)
    # Unsigned, for a signed index is first asked whether it counts from the end.
    return to_blocks(3 * stencils.astype(np.uint32)), to_blocks(columns.astype(np.float32))


def empty_state(vertices: np.ndarray, quantities: int) -> np.ndarray:
    """Return room for so many float32 quantities of each element of these blocks."""
    return np.zeros((len(vertices), quantities * LANES), np.float32)


@njit(cache=True)
def set_edges(x, vertices, columns, out):
    """Write the edges x_(k+1) - x_0 [m], k < columns, of elements at x (V, 3) into out, in blocks."""
    for b in range(len(vertices)):
        for g in range(LANES):
            first = vertices[b, g] // 3
            for k in range(columns):
                other = vertices[b, (k + 1) * LANES + g] // 3
                for i in range(3):
                    out[b, (3 * k + i) * LANES + g] = np.float32(x[other, i] - x[first, i])


# numba writes a short loop of known length out number by number, and what was stored in single numbers
# cannot be loaded as a vector before all of it has reached the cache. So rows are moved in vector
# registers.
WIDE = ir.IntType(64)
_intrinsic: Any = intrinsic  # to a caller it has not the arguments of the function that types it


@_intrinsic
def copy_lanes(_: Any, source: Any, i: Any, target: Any, j: Any) -> Any:
    """Copy row i of source to row j of target, flat arrays.

    A row has LANES numbers of float32, or LANES_FLOAT64.
    """
    lanes = _lanes(source)

    def build(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        source_row = _place(context, builder, signature.args[:2], args[:2], lanes, lanes)
        target_row = _place(context, builder, signature.args[2:], args[2:], lanes, lanes)
        builder.store(builder.load(source_row, align=4), target_row, align=4)
        return context.get_dummy_value()

    return types.void(source, i, target, j), build


@_intrinsic
def add_lanes(_: Any, source: Any, i: Any, target: Any, j: Any) -> Any:
    """Add row i of source to row j of target, which may also be one of float64."""

    def build(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        numbers = builder.load(
            _place(context, builder, signature.args[:2], args[:2], LANES, LANES), align=4
        )
        place = _place(context, builder, signature.args[2:], args[2:], LANES, LANES)
        if signature.args[2].dtype == types.float64:
            numbers = builder.fpext(numbers, place.type.pointee)
        builder.store(builder.fadd(builder.load(place, align=4), numbers), place, align=4)
        return context.get_dummy_value()

    return types.void(source, i, target, j), build


@_intrinsic
def mix_rows(_: Any, rows: Any, i: Any, j: Any, k: Any, u: Any, v: Any, w: Any) -> Any:
    """Return u rows[i] + v rows[j] + w rows[k], three numbers.

    Rows of three lie in a flat float32 array, with one number more after the last: a row is loaded as
    four.
    """

    def build(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        total = None
        for row, weight, kind in zip(args[1:4], args[4:], signature.args[1:4]):
            place = _place(context, builder, (rows, kind), (args[0], row), 3, 4)
            numbers = builder.load(place, align=4)
            term = builder.fmul(_spread(builder, weight, 4), numbers, flags=("contract",))
            total = term if total is None else builder.fadd(total, term, flags=("contract",))
        parts = [builder.extract_element(total, ir.IntType(32)(n)) for n in range(3)]
        return context.make_tuple(builder, signature.return_type, parts)

    return types.UniTuple(types.float32, 3)(rows, i, j, k, u, v, w), build


@_intrinsic
def bits_at_most(_: Any, rows: Any, i: Any, limit: Any) -> Any:
    """Return an integer with a bit for each number of row i that is not above the limit.

    rows: of LANES numbers in a flat float32 array.
    """

    def build(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        place = _place(context, builder, signature.args[:2], args[:2], LANES, LANES)
        numbers = builder.load(place, align=4)
        within = builder.fcmp_unordered("<=", numbers, _spread(builder, args[2], LANES))
        return builder.zext(builder.bitcast(within, ir.IntType(LANES)), WIDE)

    return types.int64(rows, i, types.float32), build


TILE_ROWS = 3  # with two vectors a row, and what is multiplied, they fill the 16 registers of AVX2


@_intrinsic(prefer_literal=True)
def subtract_product(
    _: Any, C: Any, c: Any, c_stride: Any, P: Any, p: Any, q: Any, p_stride: Any, count: Any, vectors: Any
) -> Any:
    """Subtract a product of two parts of P, flat like C and of one dtype, from a tile of C.

    C[c + a c_stride + b] -= sum over k < count of P[p + k p_stride + a] P[q + k p_stride + b], for a <
    TILE_ROWS and b < vectors (a literal) times LANES, or LANES_FLOAT64.
    """
    lanes, width = _lanes(C), range(vectors.literal_value)

    def build(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        c, c_stride, p, q, p_stride, count = (args[k] for k in (1, 2, 4, 5, 6, 7))
        numbers = context.make_array(P)(context, builder, args[3]).data
        tile = []  # row, number of the vector in it, its place and its register
        for a in range(TILE_ROWS):
            row = builder.add(c, builder.mul(c_stride, WIDE(a)))
            for v in width:
                at = builder.add(row, WIDE(v * lanes))
                place = _place(context, builder, (C, types.intp), (args[0], at), 1, lanes)
                register = cgutils.alloca_once(builder, place.type.pointee)
                builder.store(builder.load(place, align=4), register)
                tile.append((a, v, place, register))
        with cgutils.for_range(builder, count) as loop:
            row = builder.mul(loop.index, p_stride)
            left, right = builder.add(p, row), builder.add(q, row)
            starts = [builder.add(right, WIDE(v * lanes)) for v in width]
            places = [_place(context, builder, (P, types.intp), (args[3], at), 1, lanes) for at in starts]
            loaded = [builder.load(place, align=4) for place in places]
            for a, v, _, register in tile:
                factor = builder.load(builder.gep(numbers, [builder.add(left, WIDE(a))]))
                spread = _spread(builder, builder.fneg(factor), lanes)
                product = builder.fmul(spread, loaded[v], flags=("contract",))
                total = builder.fadd(builder.load(register), product, flags=("contract",))
                builder.store(total, register)
        for _, _, place, register in tile:
            builder.store(builder.load(register), place, align=4)
        return context.get_dummy_value()

    i = types.intp
    return types.void(C, i, i, P, i, i, i, i, vectors), build


@_intrinsic
def add_run(_: Any, source: Any, i: Any, target: Any, j: Any, count: Any) -> Any:
    """Add `count` numbers of source from i on to target from j on, flat arrays of one dtype.

    What lies in the last vector beyond them is read, and in target written as it was.
    """

    def build(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        with _each_vector(context, builder, source, args[4]) as (at, part):
            numbers = part(source, args[0], builder.add(args[1], at))
            end = (args[2], builder.add(args[3], at))
            place = _place(context, builder, (target, types.intp), end, 1, _lanes(source))
            builder.store(builder.fadd(builder.load(place, align=4), numbers), place, align=4)
        return context.get_dummy_value()

    return types.void(source, types.intp, target, types.intp, types.intp), build


@_intrinsic
def dot_rows(_: Any, rows: Any, i: Any, stride: Any, x: Any, j: Any, count: Any) -> Any:
    """Return the products of TILE_ROWS rows, from i on a stride apart, with x from j on, of `count` numbers.

    All are flat arrays of one dtype. Every kernel sums up in the same order.
    """
    lanes = _lanes(rows)

    def build(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        kind = ir.VectorType(context.get_value_type(rows.dtype), lanes)
        totals = [cgutils.alloca_once_value(builder, ir.Constant(kind, None)) for _ in range(TILE_ROWS)]
        with _each_vector(context, builder, rows, args[5]) as (at, part):
            right = part(x, args[3], builder.add(args[4], at))
            start = builder.add(args[1], at)
            for a, total in enumerate(totals):
                left = part(rows, args[0], builder.add(start, builder.mul(args[2], WIDE(a))))
                product = builder.fmul(left, right, flags=("contract",))
                builder.store(builder.fadd(builder.load(total), product, flags=("contract",)), total)
        sums = []
        for total in totals:
            vector, half = builder.load(total), lanes // 2
            while half:
                upper = [half + n if n < half else n for n in range(lanes)]
                upper = ir.Constant(ir.VectorType(ir.IntType(32), lanes), upper)
                vector, half = (
                    builder.fadd(vector, builder.shuffle_vector(vector, vector, upper)),
                    half // 2,
                )
            sums.append(builder.extract_element(vector, ir.IntType(32)(0)))
        return context.make_tuple(builder, signature.return_type, sums)

    i64 = types.intp
    return types.UniTuple(rows.dtype, TILE_ROWS)(rows, i64, i64, x, i64, i64), build


@contextmanager
def _each_vector(context: Any, builder: Any, array: Any, count: Any) -> Iterator[Any]:
    """Loop over vectors of `count` numbers: yields their start, and a function that loads those inside."""
    lanes = _lanes(array)
    with cgutils.for_range_slice(builder, WIDE(0), count, WIDE(lanes), WIDE) as (at, _):
        number = ir.Constant(ir.VectorType(WIDE, lanes), list(range(lanes)))
        inside = builder.icmp_signed("<", number, _spread(builder, builder.sub(count, at), lanes))

        def part(kind: Any, values: Any, start: Any) -> Any:
            place = _place(context, builder, (kind, types.intp), (values, start), 1, lanes)
            zeros = ir.Constant(place.type.pointee, None)
            return builder.select(inside, builder.load(place, align=4), zeros)

        yield at, part


def _lanes(array: Any) -> int:
    return LANES_FLOAT64 if array.dtype == types.float64 else LANES


def _spread(builder: Any, number: Any, lanes: int) -> Any:
    """Return a vector with the same number in all lanes."""
    vector = ir.Constant(ir.VectorType(number.type, lanes), ir.Undefined)
    for lane in range(lanes):
        vector = builder.insert_element(vector, number, ir.IntType(32)(lane))
    return vector


@_intrinsic
def lowest_bit(_: Any, bits: Any) -> Any:
    """Return the place of the lowest bit that is set in an integer other than zero."""

    def build(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.cttz(args[0], ir.Constant(ir.IntType(1), 1))

    return types.int64(types.int64), build


def _place(context: Any, builder: Any, kinds: Any, args: Any, size: int, loaded: int) -> Any:
    """Return where a row of `size` numbers begins, as a vector. kinds, args: of array and row number."""
    array, number = kinds
    start = context.make_array(array)(context, builder, args[0]).data
    place = builder.gep(
        start, [builder.mul(context.cast(builder, args[1], number, types.intp), WIDE(size))]
    )
    return builder.bitcast(place, ir.VectorType(context.get_value_type(array.dtype), loaded).as_pointer())
