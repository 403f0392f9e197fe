"""Second derivatives of single elements, by the way that the solver takes."""

from __future__ import annotations

import numpy as np

from reference_sim.energies import Energy
from reference_sim.kernels.lanes import BlockPlaces


def blocks_of(energy: Energy, x: np.ndarray, convexity: float = 0.0) -> np.ndarray:
    """(N, 3k, 3k) [N/m]: what `add_hessian` adds to matrices that lie one after the other, by columns."""
    count, corners = energy.stencils.shape
    a, b = np.divmod(np.arange(corners**2), corners)
    width = 3 * corners
    base = (width**2 * np.arange(count)[:, None] + 3 * width * b + 3 * a).ravel()
    slots = np.arange(count * corners**2).reshape(count, -1)
    blocks = np.zeros((count, width, width))
    energy.add_hessian(
        x, convexity, BlockPlaces(slots, base, np.full(len(base), width), 3), blocks.reshape(-1)
    )
    return blocks.transpose(0, 2, 1)
