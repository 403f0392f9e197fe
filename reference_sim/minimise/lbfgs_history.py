"""The last steps and gradient changes, from which L-BFGS estimates the curvature."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

import numpy as np

LEAST_CURVATURE = 1e-10  # of |s| |y|: pairs of negative curvature would make the estimate indefinite


def dot(a: np.ndarray, b: np.ndarray) -> float:
    """a . b of two (n,). Not by BLAS, whose threads cost more than such a sum, and change its last digit."""
    return float(np.einsum("i,i", a, b))


class LBFGSHistory:
    """The last `memory` pairs of a step s (3n,) [m] and the change y (3n,) [N] of the gradient along it."""

    def __init__(self, memory: int) -> None:
        self._pairs: deque[tuple[np.ndarray, np.ndarray, float]] = deque(maxlen=memory)

    def __len__(self) -> int:
        return len(self._pairs)

    def clear(self) -> None:
        self._pairs.clear()

    def add(self, s: np.ndarray, y: np.ndarray) -> None:
        """Remember a pair, if its curvature is positive."""
        curvature = dot(s, y)
        if curvature > LEAST_CURVATURE * np.sqrt(dot(s, s) * dot(y, y)):
            self._pairs.append((s, y, 1.0 / curvature))

    def direction(self, g: np.ndarray, solve: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
        """-H g (3n,) by the two-loop recursion (Nocedal and Wright 2006, algorithm 7.4).

        solve applies the first guess of the inverse Hessian, which the pairs correct.
        """
        q = -g
        alphas = []
        for s, y, rho in reversed(self._pairs):
            alpha = rho * dot(s, q)
            alphas.append(alpha)
            q = q - alpha * y
        p = solve(q)
        for (s, y, rho), alpha in zip(self._pairs, reversed(alphas)):
            p += (alpha - rho * dot(y, p)) * s
        return p
