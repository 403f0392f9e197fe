"""Hessian of a potential as Newton's method needs it: assembled, shifted, factorised, solved with."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from reference_sim.cholesky import Cholesky
from reference_sim.minimise.descent import Stop, dot, mean_weight
from reference_sim.potential import Potential

if TYPE_CHECKING:
    from reference_sim.minimise.newton import NewtonRun

REFERENCE_DT = 1 / 30  # [s], in shifts by M/dt^2 of a potential without inertia


class FactorisedHessian:
    """The Hessian over the free vertices: one symbolic analysis serves every step.

    Attributes:
        metric: (3n,) M/dt^2 [N/m], the unit of shifts.
        flat: curvature [N/m] below which a direction gains less than the tolerance over a cloth's width.
        static: whether the potential has no inertia, so that rigid motions may have no curvature.
    """

    def __init__(self, potential: Potential, *, tolerance: float) -> None:
        cloth = potential.cloth
        self._pattern = potential.pattern(cloth.free)
        self._analyse()
        self._first = self._pattern, self._solver
        self.static = potential.time_step is None
        self.metric = np.repeat(cloth.masses[cloth.free] / (potential.time_step or REFERENCE_DT) ** 2, 3)
        self.flat = tolerance * mean_weight(potential) / float(np.sqrt(cloth.areas.sum()))

    def _analyse(self) -> None:
        pattern = self._pattern
        self._solver = Cholesky(pattern.indptr, pattern.indices, pattern.order)

    def start_again(self) -> None:
        """Go back to the pattern without what dynamic terms have added."""
        self._pattern, self._solver = self._first

    def assemble(self, x: np.ndarray, convexity: float) -> np.ndarray:
        """Return values (nnz,) at x (V, 3), with that share of the elements' negative curvature taken out.

        Dynamic terms may need a wider pattern, analysed anew.
        """
        changing = self._pattern.hessians(x, convexity)
        pattern = self._pattern.widen(changing)
        if pattern is not self._pattern:
            self._pattern = pattern
            self._analyse()
        return pattern.assemble(x, changing, convexity=convexity)

    def factorise(self, values: np.ndarray, shift: float | np.ndarray, kind: type = np.float64) -> bool:
        """Factorise the values plus shift M/dt^2 as this kind of number; False as `Cholesky.factorise`."""
        if np.any(shift):
            values = values.copy()
            values[self._pattern.diagonal] += shift * self.metric
        return self._solver.factorise(values, kind=kind)

    def solve(self, b: np.ndarray) -> np.ndarray:
        """Solve with the last factorisation: b (3n,)."""
        return self._solver.solve(b)

    def stiffest(self, values: np.ndarray) -> float:
        """Return the largest entry of the diagonal [N/m]."""
        return float(np.abs(values[self._pattern.diagonal]).max(initial=0.0))

    def tiny_shift(self, values: np.ndarray) -> np.ndarray:
        """Return the shift (3n,) in units of M/dt^2 below which curvature counts as none."""
        return max(self.flat, 1e-13 * self.stiffest(values)) / self.metric


POWER, MOST_POWER = (
    8,
    64,
)  # inverse iterations for a direction of negative curvature, at least and at most
FIRST_ESCAPE = 100  # of the step tolerance: first length of the step along it
LAST_SHIFT = 1e12  # in units of M/dt^2


def convergence_check(run: NewtonRun, values: np.ndarray, round_off: float) -> Stop | None:
    """Return "converged", "stalled" on a saddle, or None to go on, where the gradient of `run` is small.

    Asks whether the true Hessian is positive definite (up to round-off, so that rigid motions of an
    unpinned cloth do not count) and its step small. Off a saddle it takes a step, which is an iteration.

    values (nnz,): of its true Hessian. round_off: of the residual [1]; it excuses one above the
    tolerance, and the reason says so.
    """
    tolerance, step_tolerance = run.newton.tolerance, run.newton.step_tolerance
    residual = run.gradient_norm()
    relaxed = max(residual, round_off) > tolerance
    reason = "gradient within tolerance"
    if residual > tolerance:
        reason = f"round-off: residual {residual:.1e} above tolerance {tolerance:.1e}"
    elif relaxed:
        reason = (
            f"round-off: up to {round_off:.1e} in the residual, {residual:.1e}, tolerance {tolerance:.1e}"
        )
    if run.factorise(values, run.hessian.tiny_shift(values)):
        p = run.hessian.solve(-run.g)
        step = float(np.abs(p).max(initial=0.0))
        small = step <= step_tolerance or residual == 0.0
        if not small and run.factorise(values, 0.0):
            return None
        if small and not relaxed:
            run.polish(p)  # round-off is left, and not the tolerance
        # Without curvature no step can be told from another.
        evidence = f"Newton step {step:.1e} m" if small else "a direction without curvature"
        return Stop("converged", f"{reason}, {evidence}", relaxed)
    if escape_saddle(run, values, FIRST_ESCAPE * step_tolerance):
        run.iterations += 1
        return None
    return Stop("stalled", "a saddle: negative curvature, and no step along it lowers the energy")


def escape_saddle(run: NewtonRun, values: np.ndarray, length: float) -> bool:
    """Step along the most negative curvature, `length` [m] first; return whether the energy fell."""
    v = find_lowest_mode(run, values)
    if v is None:
        return False
    v *= -1.0 if dot(v, run.g) > 0 else 1.0
    step = run.spread(length * v)
    scale = run.potential.largest_step(run.x, step)
    for _ in range(30):
        trial = run.x + scale * step
        value, gradient = run.evaluate(trial)
        if np.isfinite(value) and value < run.value - 1e-13 * abs(run.value):
            run.x, run.value, run.g = trial, value, gradient
            return True
        scale *= 0.5
    return False


def find_lowest_mode(run: NewtonRun, values: np.ndarray) -> np.ndarray | None:
    """Return a direction (3n,) of negative curvature, nearly the lowest, by inverse iteration, or None."""
    shift, metric = 1.0, run.hessian.metric
    while not run.factorise(values, shift):
        shift *= 4
        if shift > LAST_SHIFT:
            return None
    v = np.random.default_rng(0).standard_normal(len(run.g))
    for count in range(MOST_POWER):
        above = v / np.abs(v).max()
        v = run.hessian.solve(metric * above)
        if count >= POWER and shift * dot(metric * above, v) > dot(metric * above, above):
            break  # the Rayleigh quotient is below zero
    return v / np.abs(v).max()
