"""Newton's method on the true Hessian, made convex only as far as it has to be.

Each iteration solves H p = -g and takes the full step. Where the Cholesky factorisation of H does not exist,
a share of the elements' negative curvature is taken out, by the ladder CONVEXITY, and only when all of it was
not enough (cloth without inertia) H is shifted by sigma M/dt^2. Taking all of it out always, as is common,
needs several times the iterations once cloth wrinkles; shifts alone need a third more factorisations
(measured on a T-shirt walking, running and jumping).

Stiff cloth moves along a narrow, curved valley: a full step along its floor ends high on its wall, where
stresses computed from the strain are false by orders of magnitude. So the Hessian takes the stresses that the
step predicted (Magisano, Leonetti and Garcea 2017), and where a full step raises the energy, up to EXCURSION
further ones go on from there (the watchdog of Chamberlain et al. 1982). Only a point below the start of the
excursion is kept; if none comes, the step is taken back, and the line search along the true Newton direction
does what it can. Without this, sheets 1e4 times as stiff as cotton took more than 300 iterations.

The Newton decrement -g.p bounds what is left to gain; near round-off of the energy the line search
therefore judges by slopes (Hager and Zhang 2005, approximate Wolfe conditions).
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ..energies.inertia import Inertia
from ..linear_solver import analyse
from ..potential import Potential
from .descent import Descent, mean_weight
from .result import Result

SUFFICIENT_DECREASE = 1e-4
CONVEXITY = (0.0, 0.15, 0.3, 0.6, 1.0)
# In units of M/dt^2. A static cloth that nothing holds needs a shift against its rigid motions alone; begun
# at 1 instead, that shift slows the soft bending modes down ten times.
FIRST_SHIFT = 1e-4
MAX_SHIFT = 1e12  # beyond it a step is shorter than round-off
STEP_TOLERANCE = 1e-3  # of a mean edge length
CALM = 20  # iterations before the first excursion: most steps of a garment are done by then, and sooner so
EXCURSION = 40  # full steps in a row before the energy has to be below its start
FORESEEN = 0.9  # share of the predicted decrease from which on the quadratic model needs no help
ROUND_OFF = 1e-2  # [vertex weights] what round-off may at most excuse in the gradient


class Newton:
    """A minimiser bound to one potential: its symbolic analysis is done once and serves every step.

    Args:
        tolerance: largest gradient component at the end, in mean vertex weights.
        max_iterations: iterations before giving up with status max_iterations; every direction solved for is
            one, also one that is taken back.
        timeout: seconds before giving up with status timeout.
        reference_dt: time [s] in the shift M/dt^2 where the potential has no inertia of its own.
        observe: called with every point (V, 3) [m] that was kept, the start included.
    """

    def __init__(
        self,
        potential: Potential,
        *,
        tolerance: float = 1e-6,
        max_iterations: int = 300,
        timeout: float = float("inf"),
        reference_dt: float = 1 / 30,
        observe: Callable[[np.ndarray], object] | None = None,
    ) -> None:
        cloth = potential.cloth
        self.potential, self.observe = potential, observe
        self.tolerance, self.max_iterations, self.timeout = tolerance, max_iterations, timeout
        self._pattern = potential.pattern(cloth.free)
        self._solver = analyse(self._pattern.indptr, self._pattern.indices, self._pattern.order)
        dt = next((e.dt for e in potential.energies if isinstance(e, Inertia)), reference_dt)
        self._static = not any(isinstance(e, Inertia) for e in potential.energies)
        self._metric = np.repeat(cloth.masses[cloth.free] / dt**2, 3)
        # Curvature that gains less than the tolerance over the width of the cloth is none.
        self._flat = tolerance * mean_weight(potential) / float(np.sqrt(cloth.areas.sum()))
        self._step_tolerance = STEP_TOLERANCE * float(cloth.edge_lengths.mean())

    def minimise(self, x0: np.ndarray) -> Result:
        """Run from x0 (V, 3) [m]."""
        result = _Run(self, x0).to_the_end()
        objection = self.potential.objection(result.positions)
        return replace(result, status="diverged", reason=objection) if objection else result

    def assemble(self, x: np.ndarray, convexity: float) -> np.ndarray:
        """Values of the Hessian at x (V, 3), made convex by that share.

        Dynamic terms may need a wider pattern, analysed anew.
        """
        changing = self._pattern.changing(x, convexity)
        pattern = self._pattern.covering(changing)
        if pattern is not self._pattern:
            self._pattern = pattern
            self._solver = analyse(pattern.indptr, pattern.indices, pattern.order)
        return pattern.assemble(x, changing, convexity=convexity)


class _Run(Descent):
    """State of one minimisation by Newton's method."""

    def __init__(self, newton: Newton, x: np.ndarray) -> None:
        super().__init__(newton.potential, x)
        self.n = newton
        self.rung, self.climbed = 0, False  # of CONVEXITY at the last step; whether it had to climb there
        self.foreseeing = False  # whether the Hessian takes stresses that the last step predicted
        self.patience = EXCURSION  # for the next excursion: less after one that came to nothing

    def to_the_end(self) -> Result:
        if not self.finite:
            return self.result("diverged", "energy or gradient is not finite at the starting point")
        try:
            return self.iterate()
        finally:
            self.potential.forget()

    def iterate(self) -> Result:
        while True:
            if self.n.observe is not None:
                self.n.observe(self.x.copy())
            # Wrinkled cloth stays wrinkled for a while: start near the rung that the last step needed.
            rung = self.rung if self.climbed else max(self.rung - 1, 0)
            data = self.assemble(rung)
            if not np.isfinite(data).all():
                return self.result("diverged", "the Hessian is not finite")
            if self.gradient_norm() <= self.target(data):
                self.potential.forget()
                verdict = self.verdict(self.assemble(0) if rung or self.foreseeing else data)
                if verdict is not None:
                    return verdict
                self.foreseeing, data = False, self.assemble(rung)
            elif self.late(self.n.timeout):
                return self.result("timeout", f"gave up after {self.n.timeout:g} s")
            if self.iterations >= self.n.max_iterations:
                return self.result("max_iterations", f"gave up after {self.iterations} iterations")
            if not (self.full_steps(data, rung) or self.cautious_step(self.assemble(rung), rung)):
                return self.result("stalled", "no convexified Newton direction lowers the energy")
            self.iterations += 1

    def target(self, data: np.ndarray) -> float:
        """The tolerance, but never below what round-off of the positions does to the gradient."""
        stiffest = float(np.abs(data[self.n._pattern.diagonal]).max(initial=0.0))
        round_off = 8 * np.finfo(float).eps * stiffest * float(np.abs(self.x).max(initial=0.0))
        return max(self.n.tolerance, min(round_off / self.weight, ROUND_OFF))

    def assemble(self, rung: int) -> np.ndarray:
        start = time.perf_counter()
        with np.errstate(all="ignore"):
            data = self.n.assemble(self.x, CONVEXITY[rung])
        self.seconds["assemble"] += time.perf_counter() - start
        return data

    def factorise(self, data: np.ndarray, shift: float | np.ndarray) -> bool:
        start = time.perf_counter()
        if np.any(shift):
            data = data.copy()
            data[self.n._pattern.diagonal] += shift * self.n._metric
        done = self.n._solver.factorise(data)
        self.factorisations += 1
        self.seconds["factorise"] += time.perf_counter() - start
        return done

    def solve(self, b: np.ndarray) -> np.ndarray:
        start = time.perf_counter()
        x = self.n._solver.solve(b)
        self.seconds["solve"] += time.perf_counter() - start
        return x

    def full_steps(self, data: np.ndarray, rung: int) -> bool:
        """Full steps until one ends below the start; if none does, back to it, and a part of the first."""
        start, value, g = self.x, self.value, self.g
        first, foreseen = rung, self.foreseeing
        p, rung = first_p, first_rung = self.direction(data, rung)
        slope = float(g @ p)
        # Every direction is an iteration, also one that is taken back: the loop counts the first.
        bold = self.iterations >= CALM
        patience = min(self.patience, self.n.max_iterations - self.iterations - 1) if bold else 0
        for k in range(patience + 1 if slope < 0 else 0):  # none if it is nan
            step = self.spread(p)
            if not np.isfinite(p).all() or self.potential.largest_step(self.x, step) < 1:
                break
            self.potential.foresee(self.x, step)
            self.x = self.x + step
            self.value, self.g = self.evaluate(self.x)
            if not self.finite:
                break
            if fallen(value, self.value, slope) or (k == 0 and level(value, self.value, slope, self.g @ p)):
                self.foreseeing = bold and (k > 0 or self.value - value > FORESEEN * 0.5 * slope)
                if not self.foreseeing:
                    self.potential.forget()
                self.rung, self.climbed = rung, rung > first
                self.patience = EXCURSION
                return True
            if k < patience:
                p, rung = self.direction(self.assemble(rung), rung)
                self.iterations += 1
        self.potential.forget()
        self.foreseeing = False
        self.patience = self.patience // 2 if bold else EXCURSION
        self.x, self.value, self.g = start, value, g
        self.rung, self.climbed = first_rung, first_rung > first
        return not foreseen and slope < 0 and self.line_search(first_p, slope)

    def direction(self, data: np.ndarray, rung: int) -> tuple[np.ndarray, int]:
        """-H^-1 g on the first rung, then shift, on which H is positive definite, and that rung."""
        shift = 0.0
        # A singular Hessian, as of a cloth that may move rigidly, is no reason to climb. Inertia excludes it.
        while not self.factorise(data, shift or (self.tiny(data) if self.n._static else 0.0)):
            if rung + 1 < len(CONVEXITY):
                rung += 1
                data = self.assemble(rung)
            elif shift > MAX_SHIFT:
                return np.full_like(self.g, np.nan), rung
            else:
                shift = max(4 * shift, 1.0)
        p = self.solve(-self.g)
        return p, rung

    def cautious_step(self, data: np.ndarray, rung: int) -> bool:
        """One step by line search; rungs, then shifts, climb until there is one."""
        first, shift = rung, 0.0
        while shift <= MAX_SHIFT:
            if self.factorise(data, shift):
                p = self.solve(-self.g)
                slope = float(self.g @ p)
                if np.isfinite(slope) and slope < 0 and self.line_search(p, slope):
                    self.rung, self.climbed = rung, rung > first
                    return True
            if rung + 1 < len(CONVEXITY):
                rung += 1
                data = self.assemble(rung)
            else:
                shift = max(4 * shift, 1.0)
        return False

    def line_search(self, p: np.ndarray, slope: float) -> bool:
        """Backtrack until the energy falls enough; True once a step was taken."""
        step = self.spread(p)
        alpha = self.potential.largest_step(self.x, step)
        for _ in range(24):
            trial = self.x + alpha * step
            value, gradient = self.evaluate(trial)
            if np.isfinite(value) and np.isfinite(gradient).all():
                gain = alpha * slope
                if fallen(self.value, value, gain) or level(self.value, value, gain, alpha * (gradient @ p)):
                    self.x, self.value, self.g = trial, value, gradient
                    return True
            alpha *= 0.5
        return False

    def verdict(self, data: np.ndarray) -> Result | None:
        """Converged, stuck on a saddle, or None: go on.

        The gradient is small. What is left to ask is whether the true Hessian is positive definite (up to
        round-off, so that rigid motions of an unpinned cloth do not count) and its step negligible.
        """
        tiny = self.tiny(data)
        if self.factorise(data, tiny):
            step = float(np.abs(self.solve(-self.g)).max(initial=0.0))
            if step <= self.n._step_tolerance or self.gradient_norm() == 0.0:
                return self.result("converged", f"gradient within tolerance, Newton step {step:.1e} m")
            if not self.factorise(data, 0.0):  # no step along such a direction can be told from another
                return self.result("converged", "gradient within tolerance, a direction without curvature")
            return None
        if self.escape_saddle(data):
            self.iterations += 1
            return None
        return self.result("stalled", "a saddle: negative curvature, and no step along it lowers the energy")

    def tiny(self, data: np.ndarray) -> np.ndarray:
        """The shift below which curvature counts as none."""
        stiffest = float(np.abs(data[self.n._pattern.diagonal]).max(initial=0.0))
        return max(self.n._flat, 1e-13 * stiffest) / self.n._metric

    def escape_saddle(self, data: np.ndarray) -> bool:
        """Step along the most negative curvature direction, found by inverse iteration."""
        shift = 1.0
        while not self.factorise(data, shift):
            shift *= 4
            if shift > MAX_SHIFT:
                return False
        v = np.random.default_rng(0).standard_normal(len(self.g))
        for _ in range(8):
            v = self.solve(self.n._metric * v)
            v /= np.abs(v).max()
        v *= -1.0 if float(v @ self.g) > 0 else 1.0
        step = self.spread(100 * self.n._step_tolerance * v)
        scale = self.potential.largest_step(self.x, step)
        for _ in range(30):
            trial = self.x + scale * step
            value, gradient = self.evaluate(trial)
            if np.isfinite(value) and value < self.value - 1e-13 * abs(self.value):
                self.x, self.value, self.g = trial, value, gradient
                return True
            scale *= 0.5
        return False


def fallen(before: float, after: float, slope: float) -> bool:
    """Whether the energy fell enough on a step whose linear prediction is `slope` (Armijo)."""
    return after <= before + SUFFICIENT_DECREASE * slope


def level(before: float, after: float, slope: float, end_slope: float) -> bool:
    """Whether, within round-off of the energy, the slopes at both ends say that it fell."""
    noise = 1e-13 * abs(before)
    flat = after <= before + noise and -slope < 100 * noise
    return flat and float(end_slope) <= (2 * SUFFICIENT_DECREASE - 1) * slope
