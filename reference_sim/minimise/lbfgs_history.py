"""History of L-BFGS: the last steps and gradient changes, from which it estimates the curvature."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from reference_sim.kernels.kernel_cache import njit

LEAST_CURVATURE = 1e-10  # of |s| |y|: pairs of negative curvature would make the estimate indefinite


def dot(a: np.ndarray, b: np.ndarray) -> float:
    """Return a . b of two (n,), not by BLAS: its threads cost more than the sum and change its last digit."""
    return float(np.einsum("i,i", a, b))


class LBFGSHistory:
    """Last `memory` pairs of a step s (3n,) [m] and the change y (3n,) [N] of the gradient along it."""

    def __init__(self, memory: int) -> None:
        self._memory = memory
        self._pairs = np.empty((0, 2, 0))  # (memory, 2, 3n) s and y, from the first pair on
        self._curvatures = np.empty(memory)  # s . y
        self._count = 0  # of pairs added; the last lies at (count - 1) % memory

    def __len__(self) -> int:
        return min(self._count, self._memory)

    def clear(self) -> None:
        """Forget all pairs."""
        self._count = 0

    def add(self, s: np.ndarray, y: np.ndarray) -> None:
        """Remember a pair, if its curvature is positive."""
        curvature = dot(s, y)
        if self._memory and curvature > LEAST_CURVATURE * np.sqrt(dot(s, s) * dot(y, y)):
            if self._pairs.shape[2] != len(s):
                self._pairs = np.empty((self._memory, 2, len(s)))
            place = self._count % self._memory
            self._pairs[place, 0], self._pairs[place, 1], self._curvatures[place] = s, y, curvature
            self._count += 1

    def direction(self, g: np.ndarray, solve: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
        """Return -H g (3n,) by the two-loop recursion (Nocedal and Wright 2006, algorithm 7.4).

        Args:
            g: (3n,) gradient [N].
            solve: applies the first guess of the inverse Hessian, which the pairs correct.
        """
        q, alphas = -g, np.empty(len(self))
        order = np.arange(self._count - len(self), self._count) % max(self._memory, 1)  # oldest first
        first_loop(self._pairs, self._curvatures, order, q, alphas)
        p = solve(q)
        second_loop(self._pairs, self._curvatures, order, p, alphas)
        return p


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
