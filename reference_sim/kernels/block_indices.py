"""Places of the blocks of elements among the values of a matrix."""

from __future__ import annotations

from dataclasses import dataclass

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

    @classmethod
    def one_by_one(cls, count: int, corners: int) -> BlockPlaces:
        """Return the places of `count` elements whose matrices (3k, 3k) lie in a row, by columns."""
        a, b = np.divmod(np.arange(corners**2), corners)
        width = 3 * corners
        base = (width**2 * np.arange(count)[:, None] + 3 * width * b + 3 * a).ravel()
        slots = np.arange(count * corners**2).reshape(count, -1)
        return cls(slots, base, np.full(len(base), width), 3)

    def add(self, elements: np.ndarray, blocks: np.ndarray, data: np.ndarray) -> None:
        """Add the matrices (n, size k, size k) of some elements (n,)."""
        corners = blocks.shape[1] // self.size
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
