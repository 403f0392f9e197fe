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

from snug.lanes import LANES

WIDE = ir.IntType(64)


@intrinsic  # type: ignore[untyped-decorator]
def copy_lanes(_: Any, source: Any, i: Any, target: Any, j: Any) -> Any:
    """Row j of target becomes row i of source: rows of LANES numbers in flat float32 arrays."""

    def built(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        numbers = builder.load(_row(context, builder, signature, args, 0, LANES), align=4)
        builder.store(numbers, _row(context, builder, signature, args, 2, LANES), align=4)
        return context.get_dummy_value()

    return types.void(source, i, target, j), built


@intrinsic  # type: ignore[untyped-decorator]
def add_lanes(_: Any, source: Any, i: Any, target: Any, j: Any) -> Any:
    """Row i of source is added to row j of target, which may also be one of float64."""

    def built(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        numbers = builder.load(_row(context, builder, signature, args, 0, LANES), align=4)
        place = _row(context, builder, signature, args, 2, LANES)
        if signature.args[2].dtype == types.float64:
            numbers = builder.fpext(numbers, place.type.pointee)
        builder.store(builder.fadd(builder.load(place, align=4), numbers), place, align=4)
        return context.get_dummy_value()

    return types.void(source, i, target, j), built


@intrinsic  # type: ignore[untyped-decorator]
def add_product_of_lanes(_: Any, source: Any, i: Any, factors: Any, k: Any, target: Any, j: Any) -> Any:
    """Row i of source times row k of factors is added to row j of target."""

    def built(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        a, b = (builder.load(_row(context, builder, signature, args, at, LANES), align=4) for at in (0, 2))
        place = _row(context, builder, signature, args, 4, LANES)
        term = builder.fmul(a, b, flags=("contract",))
        total = builder.fadd(builder.load(place, align=4), term, flags=("contract",))
        builder.store(total, place, align=4)
        return context.get_dummy_value()

    return types.void(source, i, factors, k, target, j), built


@intrinsic  # type: ignore[untyped-decorator]
def mixed_rows(_: Any, rows: Any, i: Any, j: Any, k: Any, u: Any, v: Any, w: Any) -> Any:
    """u rows[i] + v rows[j] + w rows[k], three numbers: rows of three in a flat float32 array, and one number
    more after the last, for a row is loaded as four.
    """

    def built(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        total = None
        for n in (1, 2, 3):
            pair = [args[0], args[n]]
            place = _row(context, builder, signature, pair, 0, 3, loaded=4, kind=signature.args[n])
            spread = ir.Constant(place.type.pointee, ir.Undefined)
            for lane in range(4):
                spread = builder.insert_element(spread, args[3 + n], ir.IntType(32)(lane))
            term = builder.fmul(spread, builder.load(place, align=4), flags=("contract",))
            total = term if total is None else builder.fadd(total, term, flags=("contract",))
        parts = [builder.extract_element(total, ir.IntType(32)(n)) for n in range(3)]
        return context.make_tuple(builder, signature.return_type, parts)

    return types.UniTuple(types.float32, 3)(rows, i, j, k, u, v, w), built


def _row(
    context: Any,
    builder: Any,
    signature: Any,
    args: Any,
    at: int,
    size: int,
    *,
    loaded: int = 0,
    kind: Any = None,
) -> Any:
    """Where a row begins, as a pointer to a vector: of the array args[at], the row numbered args[at + 1]."""
    array = signature.args[at]
    start = context.make_array(array)(context, builder, args[at]).data
    number = context.cast(builder, args[at + 1], kind or signature.args[at + 1], types.intp)
    place = builder.gep(start, [builder.mul(number, WIDE(size))])
    vector = ir.VectorType(context.get_value_type(array.dtype), loaded or size)
    return builder.bitcast(place, vector.as_pointer())
