"""State of a minimisation: the point reached, counts, clock, line search and report; and the shared loop."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Protocol, TypeVar

import numpy as np

from reference_sim.material import GRAVITY
from reference_sim.minimise.lbfgs_history import LBFGSHistory, dot
from reference_sim.minimise.result import Result, Stop
from reference_sim.potential import Potential

SUFFICIENT_DECREASE = 1e-4
STEP_HALVINGS = 24  # of a step before its direction is given up

Value = TypeVar("Value")
Observer = Callable[[np.ndarray], object]  # is called with positions (V, 3) [m]


class Descent:
    """State of one minimisation over the free vertices of a cloth.

    Args:
        potential: the sum of energies.
        x: (V, 3) [m] start.
        after: an earlier descent, whose counts and clock go on.
        observe: called by `show` with a copy of x.

    Attributes:
        x: (V, 3), the point kept last; value [J] and g (3n,) [N] belong to it.
        iterations, factorisations: counts.
        seconds: time by part.
        started: clock [s] at the beginning.
    """

    def __init__(
        self,
        potential: Potential,
        x: np.ndarray,
        *,
        after: Descent | None = None,
        observe: Observer | None = None,
    ) -> None:
        self.potential, self.observe = potential, observe
        self.x = np.array(x, dtype=np.float64, order="C")
        self.free = potential.cloth.free
        self.weight = mean_weight(potential)
        self.iterations: int = after.iterations if after else 0
        self.factorisations: int = after.factorisations if after else 0
        parts = dict.fromkeys(("assemble", "factorise", "solve", "evaluate"), 0.0)
        self.seconds: dict[str, float] = dict(after.seconds) if after else parts
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

    def show(self) -> None:
        """Show the observer the point kept last."""
        if self.observe is not None:
            self.observe(self.x.copy())

    def timed(self, part: str, function: Callable[..., Value], *arguments: object) -> Value:
        """Return function(*arguments), and add its seconds to those of `part`."""
        start = time.perf_counter()
        value = function(*arguments)
        self.seconds[part] += time.perf_counter() - start
        return value

    def evaluate(self, x: np.ndarray) -> tuple[float, np.ndarray]:
        """Return the value [J] and the gradient over the free vertices, flat (3n,) [N], at x (V, 3) [m]."""
        with np.errstate(all="ignore"):  # a trial point far off is refused by its value, not by a warning
            value, gradient = self.timed("evaluate", self.potential.value_and_gradient, x)
        return value, gradient[self.free].ravel()

    def spread(self, p: np.ndarray) -> np.ndarray:
        """Return a flat direction (3n,) of the free vertices as (V, 3); pinned vertices stay."""
        step = np.zeros_like(self.x)
        step[self.free] = p.reshape(-1, 3)
        return step

    def line_search(self, p: np.ndarray, slope: float, allowed: float | None = None) -> float:
        """Halve the step along p (3n,) until the energy falls enough, and go there.

        Args:
            p: (3n,) [m].
            slope: of the energy along p [J].
            allowed: share of p that no term forbids, where it is known already.

        Returns:
            The share of p that was taken, 0 if none would do.
        """
        step = self.spread(p)
        alpha = self.potential.largest_step(self.x, step) if allowed is None else allowed
        for _ in range(STEP_HALVINGS):
            trial = self.x + alpha * step
            value, gradient = self.evaluate(trial)
            if np.isfinite(value) and np.isfinite(gradient).all():
                gain, end = alpha * slope, alpha * dot(gradient, p)
                enough = sufficient_decrease(self.value, value, gain)
                if enough or approximate_wolfe(self.value, value, gain, end):
                    self.x, self.value, self.g = trial, value, gradient
                    return alpha
            alpha *= 0.5
        return 0.0

    def quasi_newton_step(self, history: LBFGSHistory, solve: Callable[[np.ndarray], np.ndarray]) -> bool:
        """Take one step of L-BFGS and add it to the history; return whether there was one.

        A direction that fails is tried again without history. solve: applies the first guess of the inverse
        Hessian to (3n,).
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
        """Add the counts and the time by part of another minimisation of the same step."""
        self.iterations += other.iterations
        self.factorisations += other.factorisations
        for part, seconds in other.seconds.items():
            self.seconds[part] = self.seconds.get(part, 0.0) + seconds

    def late(self, timeout: float) -> bool:
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
            seconds=self.seconds,
        )


def mean_weight(potential: Potential) -> float:
    """Return the mean weight of a vertex of the cloth [N]; a gradient over it is a relative residual."""
    return float(potential.cloth.masses.mean() * GRAVITY)


def sufficient_decrease(before: float, after: float, slope: float) -> bool:
    """Return whether the energy [J] fell enough on a step whose linear prediction is `slope` (Armijo)."""
    return after <= before + SUFFICIENT_DECREASE * slope


def approximate_wolfe(before: float, after: float, slope: float, end_slope: float) -> bool:
    """Return whether, within round-off of the energy, the slopes at both ends of a step say that it fell.

    Source: Hager and Zhang 2005, approximate Wolfe conditions.
    """
    noise = 1e-13 * abs(before)
    flat = after <= before + noise and -slope < 100 * noise
    return flat and float(end_slope) <= (2 * SUFFICIENT_DECREASE - 1) * slope


RunState = TypeVar("RunState", bound=Descent, contravariant=True)


NOT_FINITE = Stop("diverged", "energy or gradient is not finite at the starting point")


class Solver(Protocol[RunState]):
    """One way to minimise a potential; what a minimisation changes is in its `run`.

    Attributes:
        max_iterations: iterations before the loop gives up.
        timeout: seconds before it does, counted from the start of `run`.
    """

    max_iterations: int
    timeout: float

    def init(self, run: RunState) -> Stop | None:
        """Prepare the first step; return a Stop if there cannot be one."""
        ...

    def terminate(self, run: RunState) -> Stop | None:
        """Return a Stop if the point reached is an answer, or no step can lead on from it."""
        ...

    def step(self, run: RunState) -> Stop | None:
        """Take one step; return a Stop if there is none."""
        ...


def iterate(solver: Solver[RunState], run: RunState) -> Stop:  # type: ignore[misc]
    """Minimise from where `run` is; return why that ended. Limits give "max_iterations" and "timeout"."""
    if stop := solver.init(run):
        return stop
    run.show()
    while True:
        # Asked first: on a saddle, terminate takes an iteration and wants the step after it.
        last = run.iterations >= solver.max_iterations
        if stop := solver.terminate(run):
            return stop
        if last:
            return Stop("max_iterations", f"gave up after {run.iterations} iterations")
        if run.late(solver.timeout):
            return Stop("timeout", f"gave up after {solver.timeout:g} s")
        if stop := solver.step(run):
            return stop
        run.iterations += 1
        run.show()
