"""Common part of all minimisers: result, reason to stop, L-BFGS history, line search, loop."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from reference_sim.kernels.kernel_cache import njit
from reference_sim.material import GRAVITY
from reference_sim.potential import Potential

# Least share of |s| |y|: pairs of negative curvature would make the estimate indefinite.
LEAST_CURVATURE = 1e-10


@njit(cache=True, fastmath={"reassoc", "contract", "nsz"})  # sums in vector instructions
def dot(a, b):
    """Return a . b of two (n,), not by BLAS, whose threads change the last digit."""
    total = np.float32(0.0)  # float64 in their sum, if they are
    for i in range(len(a)):
        total += a[i] * b[i]
    return total


@njit(cache=True, fastmath={"contract"})
def add_scaled(a, scale, b):
    """Add scale times b to a (n,)."""
    for i in range(len(a)):
        a[i] += scale * b[i]


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
            self._pairs[place, 0], self._pairs[place, 1] = s, y
            self._curvatures[place] = curvature
            self._count += 1

    def direction(self, g: np.ndarray, solve: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
        """Return -H g (3n,) for a gradient g (3n,) [N] by the two-loop recursion.

        solve: applies the first guess of the inverse Hessian, which the pairs correct. Source: Nocedal
        and Wright 2006, algorithm 7.4.
        """
        q, alphas = -g, np.empty(len(self))
        order = np.arange(self._count - len(self), self._count) % max(self._memory, 1)  # oldest first
        first_loop(self._pairs, self._curvatures, order, q, alphas)
        p = solve(q)
        second_loop(self._pairs, self._curvatures, order, p, alphas)
        return p


@njit(cache=True)
def first_loop(pairs, curvatures, order, q, alphas):
    """Run from the newest pair to the oldest: set alphas (k,); q (3n,) is then ready for the first guess."""
    for k in range(len(order) - 1, -1, -1):
        alphas[k] = dot(pairs[order[k], 0], q) / curvatures[order[k]]
        add_scaled(q, -alphas[k], pairs[order[k], 1])


@njit(cache=True)
def second_loop(pairs, curvatures, order, p, alphas):
    """Run from the oldest pair to the newest: p (3n,) becomes the direction."""
    for k in range(len(order)):
        share = alphas[k] - dot(pairs[order[k], 1], p) / curvatures[order[k]]
        add_scaled(p, share, pairs[order[k], 0])


STATUSES = {"converged": 0, "max_iterations": 1, "stalled": 1, "timeout": 2, "diverged": 3}  # how bad
TOLERANCE = 1e-6  # of the relative residual, by default


@dataclass(frozen=True)
class Stop:
    """Why a minimisation ended; see `Result` for the values."""

    status: str
    reason: str
    relaxed: bool = False


@dataclass(frozen=True, eq=False)
class Result:
    """Outcome of one minimisation. Failure is a value here, not an exception.

    Attributes:
        status: one of STATUSES. "converged" means: gradient within tolerance, no negative curvature
            beyond round-off left, of which a factorisation of the Hessian plus a tiny shift is the proof,
            and a negligible Newton step of that matrix. A longer step is accepted where the Hessian
            without the shift has no factorisation, as for cloth that may move rigidly: its length means
            nothing there.
        relaxed: whether "converged" holds within round-off alone: the residual, or the round-off in it,
            is above the tolerance; the reason says which.
        gradient_norm: the relative residual [1], by which every minimisation here is stopped: the largest
            component of dPhi/dx over the free vertices, divided by the mean weight of a vertex.
    """

    positions: np.ndarray  # (V, 3) [m], the best found
    status: str
    reason: str  # one line in words
    iterations: int
    factorisations: int
    gradient_norm: float
    energy: float  # [J] at positions
    terms: dict[str, float]  # [J] of each
    relaxed: bool = False


SUFFICIENT_DECREASE = 1e-4
STEP_HALVINGS = 24  # of a step before its direction is given up


class Descent:
    """State of one minimisation over the free vertices of a cloth.

    x (V, 3) [m] is the start, then the point kept last; value [J] and g (3n,) [N] belong to it. after: an
    earlier descent, whose counts and clock go on.
    """

    def __init__(self, potential: Potential, x: np.ndarray, *, after: Descent | None = None) -> None:
        self.potential = potential
        self.x = np.array(x, dtype=np.float64, order="C")
        self.free = potential.cloth.free
        self.weight = mean_weight(potential)
        self.iterations: int = after.iterations if after else 0
        self.factorisations: int = after.factorisations if after else 0
        self.started: float = after.started if after else time.perf_counter()
        self.value: float
        self.g: np.ndarray
        if after is not None and after.x is x:
            self.value, self.g = after.value, after.g
        else:
            self.value, self.g = self.evaluate(self.x)

    @property
    def finite(self) -> bool:
        """True if value and gradient are numbers."""
        return bool(np.isfinite(self.value) and np.isfinite(self.g).all())

    def begin(self) -> Stop | None:
        """Prepare the first step. Returns why there is none, where the start has no energy."""
        unknown = Stop("diverged", "energy or gradient is not finite at the starting point")
        return None if self.finite else unknown

    def evaluate(self, x: np.ndarray) -> tuple[float, np.ndarray]:
        """Return the value [J] and the gradient over the free vertices, flat (3n,) [N], at x (V, 3) [m]."""
        with np.errstate(all="ignore"):  # a trial point far off is refused by its value, not by a warning
            value, gradient = self.potential.value_and_gradient(x)
        return value, gradient[self.free].ravel()

    def spread(self, p: np.ndarray) -> np.ndarray:
        """Return a flat direction (3n,) of the free vertices as (V, 3); pinned vertices stay."""
        step = np.zeros_like(self.x)
        step[self.free] = p.reshape(-1, 3)
        return step

    def line_search(self, p: np.ndarray, slope: float, reach: float | None = None) -> float:
        """Halve the step along p (3n,) until the energy falls enough, and go there.

        slope: of the energy along p [J]. reach: share of p that no term forbids, where it is known
        already.
        Returns the share of p that was taken, 0 if none would do.
        """
        step = self.spread(p)
        alpha = self.potential.largest_step(self.x, step) if reach is None else reach
        for _ in range(STEP_HALVINGS):
            trial = self.x + alpha * step
            value, gradient = self.evaluate(trial)
            if np.isfinite(value) and np.isfinite(gradient).all():
                gain, end = alpha * slope, alpha * dot(gradient, p)
                falls = sufficient_decrease(self.value, value, gain)
                if falls or approximate_wolfe(self.value, value, gain, end):
                    self.x, self.value, self.g = trial, value, gradient
                    return alpha
            alpha *= 0.5
        return 0.0

    def quasi_newton_step(self, history: LBFGSHistory, solve: Callable[[np.ndarray], np.ndarray]) -> bool:
        """Take one step of L-BFGS and add it to the history; return whether there was one.

        A direction that fails is tried again without history. solve: applies the first guess of the
        inverse Hessian to (3n,).
        """
        while True:
            p, g = history.direction(self.g, solve), self.g
            slope = dot(g, p)
            if np.isfinite(slope) and slope < 0 and (alpha := self.line_search(p, slope)):
                history.add(alpha * p, self.g - g)
                return True
            if not history:
                return False
            history.clear()

    def gradient_norm(self) -> float:
        """Return the relative residual [1]; see `Result.gradient_norm`."""
        return float(np.abs(self.g).max(initial=0.0)) / self.weight

    def add_costs(self, other: Descent | Result) -> None:
        """Add the counts of another minimisation of the same step."""
        self.iterations += other.iterations
        self.factorisations += other.factorisations

    def is_late(self, timeout: float) -> bool:
        """Return whether more than `timeout` seconds have passed since the start."""
        return time.perf_counter() - self.started > timeout

    def result(self, stop: Stop) -> Result:
        """Return the Result at the point kept last."""
        return Result(
            positions=self.x,
            status=stop.status,
            reason=stop.reason,
            relaxed=stop.relaxed,
            iterations=self.iterations,
            factorisations=self.factorisations,
            gradient_norm=self.gradient_norm(),
            energy=self.value,
            terms=self.potential.terms(self.x),
        )


def mean_weight(potential: Potential) -> float:
    """Return the mean weight of a vertex of the cloth [N]; a gradient over it is a relative residual."""
    return float(potential.cloth.masses.mean() * GRAVITY)


def sufficient_decrease(start: float, end: float, slope: float) -> bool:
    """Return whether the energy [J] fell enough on a step whose linear prediction is `slope` (Armijo)."""
    return end <= start + SUFFICIENT_DECREASE * slope


def approximate_wolfe(start: float, end: float, slope: float, end_slope: float) -> bool:
    """Return whether, within round-off of the energy, the slopes at both ends of a step say that it fell.

    Source: Hager and Zhang 2005, approximate Wolfe conditions.
    """
    noise = 1e-13 * abs(start)
    flat = end <= start + noise and -slope < 100 * noise
    return flat and float(end_slope) <= (2 * SUFFICIENT_DECREASE - 1) * slope


def iterate(solver: Any, run: Descent) -> Stop:
    """Minimise from where `run` is; return why that ended.

    solver: has limits max_iterations and timeout [s], and two functions of the run that return a Stop to
    end: terminate asks whether the point is an answer or no step can lead on from it, step takes one.
    """
    if stop := run.begin():
        return stop
    while True:
        # Asked first: on a saddle, terminate takes an iteration and wants the step after it.
        last = run.iterations >= solver.max_iterations
        if stop := solver.terminate(run):
            return stop
        if last:
            return Stop("max_iterations", f"gave up after {run.iterations} iterations")
        if run.is_late(solver.timeout):
            return Stop("timeout", f"gave up after {solver.timeout:g} s")
        if stop := solver.step(run):
            return stop
        run.iterations += 1
