"""Compiled loops of L-BFGS; see lbfgs_history."""

from __future__ import annotations

import numpy as np

from reference_sim.kernels.kernel_cache import njit

SUM_MATH = {"reassoc", "contract", "nsz"}  # sums in vector instructions


@njit(cache=True, fastmath=SUM_MATH)
def first_loop(
    pairs: np.ndarray, curvatures: np.ndarray, order: np.ndarray, q: np.ndarray, alphas: np.ndarray
) -> None:
    """Run from the newest pair to the oldest: set alphas (k,); q (3n,) is then ready for the first guess."""
    for k in range(len(order) - 1, -1, -1):
        s, y, total = pairs[order[k], 0], pairs[order[k], 1], 0.0
        for i in range(len(q)):
            total += s[i] * q[i]
        alphas[k] = total / curvatures[order[k]]
        for i in range(len(q)):
            q[i] -= alphas[k] * y[i]


@njit(cache=True, fastmath=SUM_MATH)
def second_loop(
    pairs: np.ndarray, curvatures: np.ndarray, order: np.ndarray, p: np.ndarray, alphas: np.ndarray
) -> None:
    """Run from the oldest pair to the newest: p (3n,) becomes the direction."""
    for k in range(len(order)):
        s, y, total = pairs[order[k], 0], pairs[order[k], 1], 0.0
        for i in range(len(p)):
            total += y[i] * p[i]
        share = alphas[k] - total / curvatures[order[k]]
        for i in range(len(p)):
            p[i] += share * s[i]
