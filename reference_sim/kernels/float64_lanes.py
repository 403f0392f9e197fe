"""Layout of the kernels beside the definitions: float64, LANES_FLOAT64 elements at a time.

A kernel copies corners and constants of LANES_FLOAT64 elements into one array u of known size, row after row,
works them out in a loop of fixed length without a branch, which the compiler turns into vector instructions,
and hands the results out one by one. Within one array it knows that nothing overlaps.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import isqrt

import numpy as np

from reference_sim.kernels.kernel_cache import njit

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
def add_blocks(u, row, n, e, corners, slots, base, stride, data):
    """Add the 3 x 3 blocks of element e in lane n of u to the values of a matrix, see `BlockPlaces`.

    Of its corners x corners blocks, u holds those on and below the diagonal, row after row, from `row` on.
    """
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

    Attributes:
        slots: (N, k k) number of each element's block of corners a, b at a k + b; -1 where it is not stored.
        base, stride: by number; entry (i, j) of a block belongs at base + j stride + i.
        size: of a block, 3 or 1.
    """

    slots: np.ndarray
    base: np.ndarray
    stride: np.ndarray
    size: int

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
