"""Newton's method on the true Hessian, made convex only as far as it has to be.

Each iteration solves H p = -g and takes the full step. Where the Cholesky factorisation of H does not
exist, a share of the elements' negative curvature is taken out, CONVEXITY at one projection level after
another, and only when all of it was not enough (cloth without inertia) H is shifted by sigma M/dt^2.
Taking all of it out always needs several times the iterations once cloth wrinkles.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from reference_sim.cloth import Cloth
from reference_sim.energies.energy import demand_positive
from reference_sim.geometry.topology import corner_heights
from reference_sim.minimise.descent import (
    TOLERANCE,
    Descent,
    LBFGSHistory,
    Result,
    Stop,
    approximate_wolfe,
    dot,
    iterate,
    sufficient_decrease,
)
from reference_sim.minimise.factorised import FactorisedHessian, convergence_check
from reference_sim.potential import Potential

CONVEXITY = (0.0, 0.15, 0.3, 0.6, 1.0)
MAX_SHIFT = 1e12  # beyond it a step is shorter than round-off
STEP_TOLERANCE = 1e-3  # of a mean edge length
# The minimum of stiff cloth lies along a narrow, curved valley of the energy. A full step along it ends
# where stresses computed from the strain are false by orders of magnitude. So the Hessian takes the
# stresses that the step predicted (Magisano, Leonetti and Garcea 2017). Where a full step raises the
# energy, up to WATCHDOG_STEPS further ones go on from there (the watchdog of Chamberlain et al. 1982).
# Only a point below their start is kept; if none comes, they are taken back, and a line search along the
# true Newton direction takes over.
WATCHDOG_AFTER = 20  # iterations: most steps of a garment end sooner
WATCHDOG_STEPS = 40  # full steps in a row before the energy has to be below its start
# Share of the predicted decrease from which on the quadratic model needs no help.
PREDICTED = 0.9
RESIDUAL_ROUND_OFF = 1e-2  # relative residual that round-off may excuse at most
COLLAPSED = 1e-6  # [m] height of a triangle that is taken for a line
REUSE_MEMORY = 20  # steps that correct a factorisation used again
# It is given up where so many steps do not bring the gradient down to this share.
REUSE_WINDOW, REUSE_RATE = 8, 0.5


class Newton:
    """Newton's method for one potential: its symbolic analysis is done once and serves every step.

    Args:
        tolerance: largest relative residual at the end, see `Result.gradient_norm`.
        max_iterations: before giving up; every direction solved for is one, also one that is taken back.
        timeout: seconds before giving up.
        reuse: whether a factorisation serves as the first guess of further L-BFGS steps, each of them an
            iteration, while that goes on well: it costs ten times as much as solving with it.
        start_projected: whether the first iterations take all negative curvature out: one Hessian is then
            assembled where the search for the least projection assembles five.
    """

    def __init__(
        self,
        potential: Potential,
        *,
        tolerance: float = TOLERANCE,
        max_iterations: int = 300,
        timeout: float = float("inf"),
        reuse: bool = False,
        start_projected: bool = False,
    ) -> None:
        demand_positive("Newton", tolerance=tolerance)
        self.potential, self.reuse = potential, reuse
        self.tolerance, self.max_iterations, self.timeout = tolerance, max_iterations, timeout
        self.hessian = FactorisedHessian(potential, tolerance=tolerance)
        self.first_level = len(CONVEXITY) - 1 if start_projected else 0
        self.step_tolerance = STEP_TOLERANCE * float(potential.cloth.edge_lengths.mean())

    def start_again(self) -> None:
        """Forget which vertices dynamic terms have coupled, as before a first step."""
        self.hessian.start_again()

    def minimise(self, x0: np.ndarray, *, after: Descent | None = None) -> Result:
        """Minimise from x0 (V, 3) [m]; counts and clock go on from those of `after`."""
        run = NewtonRun(self, x0, after)
        try:
            result = run.result(iterate(self, run))
        finally:
            self.potential.forget()
        if problem := self.potential.infeasibility(result.positions):
            return replace(result, status="diverged", reason=problem)
        if result.status == "converged":
            return result
        fault = _find_collapse(self.potential.cloth, result.positions)
        return replace(result, reason=result.reason + fault)

    def terminate(self, run: NewtonRun) -> Stop | None:
        """Let the true Hessian decide where the gradient is small; else assemble the next one."""
        spent = run.iterations >= self.max_iterations
        if run.factorisation_serves() and not spent:
            return None
        run.residuals = []
        small = run.gradient_norm() <= self.tolerance
        # Round-off excuses no more than this: no Hessian is needed to say so.
        if spent and run.gradient_norm() > max(self.tolerance, RESIDUAL_ROUND_OFF):
            return None
        if small:
            self.potential.forget()
        projection = run.first_projection()
        run.values = run.assemble(CONVEXITY[0 if small else projection])
        if not np.isfinite(run.values).all():
            return Stop("diverged", "the Hessian is not finite")
        # What round-off of the positions may do to the relative residual.
        farthest = float(np.abs(run.x).max(initial=0.0))
        round_off = 8 * np.finfo(float).eps * self.hessian.stiffest(run.values) * farthest / run.weight
        run.target = max(self.tolerance, min(round_off, RESIDUAL_ROUND_OFF))
        if run.gradient_norm() > run.target:
            return None
        self.potential.forget()
        values = run.values if small else run.assemble(0.0)
        stop = convergence_check(run, values, round_off)
        if stop is None:
            run.predicting, run.values = False, run.assemble(CONVEXITY[projection])
        return stop

    def step(self, run: NewtonRun) -> Stop | None:
        """Go on with the last factorisation while it serves, else with the Hessian that was assembled."""
        if run.residuals:
            if run.quasi_newton_step(run.history, self.hessian.solve):
                run.quasi_newton_steps += 1
                run.residuals.append(run.gradient_norm())
                return None
            run.residuals = []
            if stop := self.terminate(run):  # with a Hessian of this point
                return stop
        x, g, predicted, projection = run.x, run.g, run.predicting, run.first_projection()
        if not (run.full_steps(run.values, projection) or run.line_search_step(projection, predicted)):
            return Stop("stalled", "no convexified Newton direction lowers the energy")
        if self.reuse and run.factorised and not run.predicting:
            run.history.clear()
            run.history.add((run.x - x)[run.free].ravel(), run.g - g)
            run.residuals = [run.gradient_norm()]
        return None


class NewtonRun(Descent):
    """State of one minimisation by Newton's method."""

    def __init__(self, newton: Newton, x: np.ndarray, after: Descent | None) -> None:
        super().__init__(newton.potential, x, after=after)
        self.newton, self.hessian = newton, newton.hessian
        self.factorised = False  # whether the last factorisation exists, to solve with
        # Of factorisations for directions: quasi-Newton steps make up for what float32 rounds.
        self.kind: type = np.float32 if newton.reuse and not newton.hessian.static else np.float64
        self.values = np.empty(0)  # (nnz,) of the Hessian for the next step
        self.target = newton.tolerance  # relative residual that counts as converged at the last Hessian
        self.quasi_newton_steps = self.iterations
        self.history = LBFGSHistory(REUSE_MEMORY)
        self.residuals: list[float] = []  # since the last factorisation, while that is used again
        # Index into CONVEXITY at the last step, and whether that was higher than the step began with.
        self.projection_level, self.raised = newton.first_level, newton.first_level > 0
        self.predicting = False  # whether the Hessian takes stresses that the last step predicted
        self.watchdog_steps = WATCHDOG_STEPS  # of the next one: less after one that came to nothing

    def assemble(self, convexity: float) -> np.ndarray:
        """Return values (nnz,) of the Hessian at the point kept last."""
        with np.errstate(all="ignore"):
            return self.hessian.assemble(self.x, convexity)

    def factorise(self, values: np.ndarray, shift: float | np.ndarray, kind: type = np.float64) -> bool:
        """Factorise, as the Hessian does, and count it; False if not positive definite.

        In float32 only until that fails where float64 does not.
        """
        self.factorised = self.hessian.factorise(values, shift, kind)
        self.factorisations += 1
        if kind is np.float32 and not self.factorised and self.factorise(values, shift):
            self.kind = np.float64
        return self.factorised

    def polish(self, p: np.ndarray) -> None:
        """Take a last step p (3n,) if it makes the gradient smaller."""
        step = self.spread(p)
        if self.potential.largest_step(self.x, step) == 1.0:
            value, g = self.evaluate(self.x + step)
            if np.abs(g).max(initial=0.0) < np.abs(self.g).max(initial=0.0):
                self.x, self.value, self.g = self.x + step, value, g

    def first_projection(self) -> int:
        """Return the level to begin with: wrinkled cloth stays near that of the last step."""
        return self.projection_level if self.raised else max(self.projection_level - 1, 0)

    def factorisation_serves(self) -> bool:
        """Return whether the last factorisation is used again, and better than a new one would be."""
        norms = self.residuals
        if not norms or norms[-1] <= self.target:
            return False
        return len(norms) <= REUSE_WINDOW or norms[-1] <= REUSE_RATE * min(norms[:-REUSE_WINDOW])

    def full_steps(self, values: np.ndarray, projection: int) -> bool:
        """Take full steps until one ends below the start; if none does, go back and take a part of the first.

        Returns whether there was a step.
        """
        start, value, g = self.x, self.value, self.g
        level, predicted, first_reach = projection, self.predicting, 1.0
        p, projection = first_p, first_projection = self.direction(values, projection)
        slope = dot(g, p)
        # Every direction is an iteration, also one that is taken back: the loop counts the first.
        watchdog = self.iterations - self.quasi_newton_steps >= WATCHDOG_AFTER
        limit = (
            min(self.watchdog_steps, self.newton.max_iterations - self.iterations - 1) if watchdog else 0
        )
        for k in range(limit + 1 if slope < 0 else 0):  # none if it is nan
            step = self.spread(p)
            if not np.isfinite(p).all():
                break
            reach = self.potential.largest_step(self.x, step)
            first_reach = reach if k == 0 else first_reach
            if reach < 1:
                break
            self.potential.predict_stress(self.x, step)
            self.x = self.x + step
            self.value, self.g = self.evaluate(self.x)
            if not self.finite:
                break
            flat = k == 0 and approximate_wolfe(value, self.value, slope, dot(self.g, p))
            if flat or sufficient_decrease(value, self.value, slope):
                self.predicting = watchdog and (k > 0 or self.value - value > PREDICTED * 0.5 * slope)
                if not self.predicting:
                    self.potential.forget()
                self.projection_level, self.raised = projection, projection > level
                self.watchdog_steps = WATCHDOG_STEPS
                return True
            if k == limit or self.is_late(self.newton.timeout):
                break
            p, projection = self.direction(self.assemble(CONVEXITY[projection]), projection)
            self.iterations += 1
        self.potential.forget()
        self.predicting = False
        self.watchdog_steps = self.watchdog_steps // 2 if watchdog else WATCHDOG_STEPS
        self.x, self.value, self.g = start, value, g
        self.projection_level, self.raised = first_projection, first_projection > level
        return not predicted and slope < 0 and self.line_search(first_p, slope, first_reach) > 0

    def direction(self, values: np.ndarray, projection: int) -> tuple[np.ndarray, int]:
        """Return -H^-1 g (3n,) with the first projection, then shift, that makes H positive definite.

        values: (nnz,) the Hessian at level `projection`. The level that was taken comes second.
        """
        shift = 0.0
        # A singular Hessian, as of cloth that may move rigidly, needs no projection. Inertia excludes it.
        while not self.factorise(
            values, shift or (self.hessian.tiny_shift(values) if self.hessian.static else 0.0), self.kind
        ):
            if projection + 1 < len(CONVEXITY):
                projection += 1
                values = self.assemble(CONVEXITY[projection])
            elif shift > MAX_SHIFT:
                return np.full_like(self.g, np.nan), projection
            else:
                shift = max(4 * shift, 1.0)
        p = self.hessian.solve(-self.g)
        return p, projection

    def line_search_step(self, projection: int, predicted: bool) -> bool:
        """Take a step by line search, at rising projection levels, then with rising shifts.

        The level of the first full step was tried already, unless with predicted stresses. Returns
        whether there was a step.
        """
        first, shift = projection, 0.0
        projection = projection if predicted else self.projection_level + 1
        if projection == len(CONVEXITY):
            projection, shift = projection - 1, 1.0
        while shift <= MAX_SHIFT:
            if self.factorise(self.assemble(CONVEXITY[projection]), shift):
                p = self.hessian.solve(-self.g)
                slope = dot(self.g, p)
                if np.isfinite(slope) and slope < 0 and self.line_search(p, slope):
                    self.projection_level, self.raised = projection, projection > first
                    return True
            if projection + 1 < len(CONVEXITY):
                projection += 1
            else:
                shift = max(4 * shift, 1.0)
        return False


def _find_collapse(cloth: Cloth, x: np.ndarray) -> str:
    """Name the face that is a line at x (V, 3) [m]: bending has no derivative there. Empty for none."""
    heights = corner_heights(x[cloth.faces])
    face = int(np.argmin(heights))
    if not heights[face] <= COLLAPSED:  # nor is one that is not finite
        return ""
    at_rest = corner_heights(cloth.rest_corners)[face]
    fault = f": face {face}, {at_rest:.2g} m high at rest, has become a line"
    return f"{fault}; use a mesh without slivers"
