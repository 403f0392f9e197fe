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

A factorisation costs ten times as much as solving with it and looking at the energy. So with reuse=True it
serves as the first guess of L-BFGS after its own step, as long as that goes on well.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ..linear_solver import analyse
from ..potential import Potential
from .descent import Descent, fallen, level, mean_weight
from .result import Result
from .secants import Secants, dot
from .verdict import verdict

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
MEMORY = 20  # steps that correct a factorisation used again
WINDOW, RATE = 8, 0.5  # it is given up where so many steps do not bring the gradient down to this share


class Newton:
    """A minimiser bound to one potential: its symbolic analysis is done once and serves every step.

    Args:
        tolerance: largest gradient component at the end, in mean vertex weights.
        max_iterations: iterations before giving up with status max_iterations; every direction solved for is
            one, also one that is taken back.
        timeout: seconds before giving up with status timeout.
        reference_dt: time [s] in the shift M/dt^2 where the potential has no inertia of its own.
        reuse: whether a factorisation serves further quasi-Newton steps, each of them an iteration.
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
        reuse: bool = False,
        observe: Callable[[np.ndarray], object] | None = None,
    ) -> None:
        cloth = potential.cloth
        self.potential, self.reuse, self.observe = potential, reuse, observe
        self.tolerance, self.max_iterations, self.timeout = tolerance, max_iterations, timeout
        self._pattern = potential.pattern(cloth.free)
        self._solver = analyse(self._pattern.indptr, self._pattern.indices, self._pattern.order)
        dt = potential.time_step or reference_dt
        self._static = potential.time_step is None
        self.metric = np.repeat(cloth.masses[cloth.free] / dt**2, 3)
        # Curvature that gains less than the tolerance over the width of the cloth is none.
        self._flat = tolerance * mean_weight(potential) / float(np.sqrt(cloth.areas.sum()))
        self.step_tolerance = STEP_TOLERANCE * float(cloth.edge_lengths.mean())

    def minimise(self, x0: np.ndarray, *, after: Descent | None = None) -> Result:
        """Run from x0 (V, 3) [m]; counts and clock go on from those of `after`."""
        result = Run(self, x0, after).to_the_end()
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


class Run(Descent):
    """State of one minimisation by Newton's method."""

    def __init__(self, newton: Newton, x: np.ndarray, after: Descent | None) -> None:
        super().__init__(newton.potential, x, after)
        self.n = newton
        self.aside = self.iterations  # those that were no Newton steps
        self.secants = Secants(MEMORY)
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
        self.show()
        while True:
            # Wrinkled cloth stays wrinkled for a while: start near the rung that the last step needed.
            rung = self.rung if self.climbed else max(self.rung - 1, 0)
            small = self.gradient_norm() <= self.n.tolerance
            if small:  # then the true Hessian is the judge
                self.potential.forget()
            data = self.assemble(0 if small else rung)
            if not np.isfinite(data).all():
                return self.result("diverged", "the Hessian is not finite")
            tolerance = self.target(data)
            if self.gradient_norm() <= tolerance:
                self.potential.forget()
                found = verdict(self, data if small else self.assemble(0))
                if found is not None:
                    return found
                self.foreseeing, data = False, self.assemble(rung)
            elif self.late(self.n.timeout):
                return self.result("timeout", f"gave up after {self.n.timeout:g} s")
            if self.iterations >= self.n.max_iterations:
                return self.result("max_iterations", f"gave up after {self.iterations} iterations")
            x, g, foreseen = self.x, self.g, self.foreseeing
            if not self.full_steps(data, rung) and not self.cautious_step(rung, foreseen):
                return self.result("stalled", "no convexified Newton direction lowers the energy")
            self.iterations += 1
            self.show()
            if self.n.reuse and not self.foreseeing:
                self.secants.clear()
                self.secants.add((self.x - x)[self.free].ravel(), self.g - g)
                self.stale_steps(tolerance)

    def show(self) -> None:
        if self.n.observe is not None:
            self.n.observe(self.x.copy())

    def stale_steps(self, tolerance: float) -> None:
        """Quasi-Newton steps on the last factorisation, until a new one would serve better."""
        norms = [self.gradient_norm()]
        while norms[-1] > tolerance and self.iterations < self.n.max_iterations:
            if self.late(self.n.timeout) or not self.secant_step(self.secants, self.solve):
                return
            self.iterations += 1
            self.aside += 1
            self.show()
            norms.append(self.gradient_norm())
            if len(norms) > WINDOW and norms[-1] > RATE * min(norms[:-WINDOW]):
                return

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
            data[self.n._pattern.diagonal] += shift * self.n.metric
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
        first, foreseen, first_allowed = rung, self.foreseeing, 1.0
        p, rung = first_p, first_rung = self.direction(data, rung)
        slope = dot(g, p)
        # Every direction is an iteration, also one that is taken back: the loop counts the first.
        bold = self.iterations - self.aside >= CALM
        patience = min(self.patience, self.n.max_iterations - self.iterations - 1) if bold else 0
        for k in range(patience + 1 if slope < 0 else 0):  # none if it is nan
            step = self.spread(p)
            if not np.isfinite(p).all():
                break
            allowed = self.potential.largest_step(self.x, step)
            first_allowed = allowed if k == 0 else first_allowed
            if allowed < 1:
                break
            self.potential.foresee(self.x, step)
            self.x = self.x + step
            self.value, self.g = self.evaluate(self.x)
            if not self.finite:
                break
            flat = k == 0 and level(value, self.value, slope, dot(self.g, p))
            if flat or fallen(value, self.value, slope):
                self.foreseeing = bold and (k > 0 or self.value - value > FORESEEN * 0.5 * slope)
                if not self.foreseeing:
                    self.potential.forget()
                self.rung, self.climbed = rung, rung > first
                self.patience = EXCURSION
                return True
            if k == patience or self.late(self.n.timeout):
                break
            p, rung = self.direction(self.assemble(rung), rung)
            self.iterations += 1
        self.potential.forget()
        self.foreseeing = False
        self.patience = self.patience // 2 if bold else EXCURSION
        self.x, self.value, self.g = start, value, g
        self.rung, self.climbed = first_rung, first_rung > first
        return not foreseen and slope < 0 and self.line_search(first_p, slope, first_allowed) > 0

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

    def cautious_step(self, rung: int, foreseen: bool) -> bool:
        """One step by line search; rungs, then shifts, climb until there is one.

        The rung of the first full step was tried already, unless on stresses foreseen.
        """
        first, shift = rung, 0.0
        rung = rung if foreseen else self.rung + 1
        if rung == len(CONVEXITY):
            rung, shift = rung - 1, 1.0
        while shift <= MAX_SHIFT:
            if self.factorise(self.assemble(rung), shift):
                p = self.solve(-self.g)
                slope = dot(self.g, p)
                if np.isfinite(slope) and slope < 0 and self.line_search(p, slope):
                    self.rung, self.climbed = rung, rung > first
                    return True
            if rung + 1 < len(CONVEXITY):
                rung += 1
            else:
                shift = max(4 * shift, 1.0)
        return False

    def tiny(self, data: np.ndarray) -> np.ndarray:
        """The shift below which curvature counts as none."""
        stiffest = float(np.abs(data[self.n._pattern.diagonal]).max(initial=0.0))
        return max(self.n._flat, 1e-13 * stiffest) / self.n.metric
