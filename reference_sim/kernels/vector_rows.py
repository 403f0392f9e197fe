"""Rows of numbers that a kernel moves in vector registers where the compiler on its own would not.

numba vectorises long loops. A short loop of known length it writes out number by number, and what was stored
in single numbers cannot be loaded as a vector before all of it has reached the cache: that costs a kernel
more than its arithmetic.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from reference_sim.kernels.fast_kernels import TRAINING_LANES as L

WIDE = ir.IntType(64)
WIDTH = 16  # numbers of a row that `bits_at_most` compares
_intrinsic: Any = intrinsic  # to a caller it has not the arguments of the function that types it


@_intrinsic
def copy_lanes(_: Any, source: Any, i: Any, target: Any, j: Any) -> Any:
    """Copy row i of source to row j of target: rows of TRAINING_LANES numbers in flat float32 arrays."""

    def built(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        source_row = _place(context, builder, signature.args[:2], args[:2], L, L)
        target_row = _place(context, builder, signature.args[2:], args[2:], L, L)
        builder.store(builder.load(source_row, align=4), target_row, align=4)
        return context.get_dummy_value()

    return types.void(source, i, target, j), built


@_intrinsic
def add_lanes(_: Any, source: Any, i: Any, target: Any, j: Any) -> Any:
    """Add row i of source to row j of target, which may also be one of float64."""

    def built(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        numbers = builder.load(_place(context, builder, signature.args[:2], args[:2], L, L), align=4)
        place = _place(context, builder, signature.args[2:], args[2:], L, L)
        if signature.args[2].dtype == types.float64:
            numbers = builder.fpext(numbers, place.type.pointee)
        builder.store(builder.fadd(builder.load(place, align=4), numbers), place, align=4)
        return context.get_dummy_value()

    return types.void(source, i, target, j), built


@_intrinsic
def mixed_rows(_: Any, rows: Any, i: Any, j: Any, k: Any, u: Any, v: Any, w: Any) -> Any:
    """Return u rows[i] + v rows[j] + w rows[k], three numbers.

    Rows of three lie in a flat float32 array, with one number more after the last: a row is loaded as four.
    """

    def built(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        four, total = ir.VectorType(ir.FloatType(), 4), None
        for row, weight, kind in zip(args[1:4], args[4:], signature.args[1:4]):
            place = _place(context, builder, (rows, kind), (args[0], row), 3, 4)
            numbers = builder.load(place, align=4)
            spread = ir.Constant(four, ir.Undefined)
            for lane in range(4):
                spread = builder.insert_element(spread, weight, ir.IntType(32)(lane))
            term = builder.fmul(spread, numbers, flags=("contract",))
            total = term if total is None else builder.fadd(total, term, flags=("contract",))
        parts = [builder.extract_element(total, ir.IntType(32)(n)) for n in range(3)]
        return context.make_tuple(builder, signature.return_type, parts)

    return types.UniTuple(types.float32, 3)(rows, i, j, k, u, v, w), built


@_intrinsic
def bits_at_most(_: Any, rows: Any, i: Any, limit: Any) -> Any:
    """Return an integer with a bit for each number of row i that is not above the limit.

    rows: of WIDTH numbers in a flat float32 array.
    """

    def built(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        place = _place(context, builder, signature.args[:2], args[:2], WIDTH, WIDTH)
        numbers = builder.load(place, align=4)
        limits = ir.Constant(numbers.type, ir.Undefined)
        for lane in range(WIDTH):
            limits = builder.insert_element(limits, args[2], ir.IntType(32)(lane))
        within = builder.fcmp_unordered("<=", numbers, limits)
        return builder.zext(builder.bitcast(within, ir.IntType(WIDTH)), WIDE)

    return types.int64(rows, i, types.float32), built


@_intrinsic
def lowest_bit(_: Any, bits: Any) -> Any:
    """Return the place of the lowest bit that is set in an integer other than zero."""

    def built(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.cttz(args[0], ir.Constant(ir.IntType(1), 1))

    return types.int64(types.int64), built


def _place(context: Any, builder: Any, kinds: Any, args: Any, size: int, loaded: int) -> Any:
    """Return where a row of `size` numbers begins, as a vector. kinds, args: of array and row number."""
    array, number = kinds
    start = context.make_array(array)(context, builder, args[0]).data
    place = builder.gep(start, [builder.mul(context.cast(builder, args[1], number, types.intp), WIDE(size))])
    return builder.bitcast(place, ir.VectorType(context.get_value_type(array.dtype), loaded).as_pointer())
