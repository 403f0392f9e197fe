"""Places of the blocks of elements among the values of a matrix."""

from __future__ import annotations

from dataclasses import dataclass
from math import isqrt

import numpy as np

from reference_sim.kernels.kernel_cache import njit


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
