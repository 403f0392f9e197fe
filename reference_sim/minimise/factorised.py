"""Hessian of a potential as Newton's method needs it: assembled, shifted, factorised, solved with."""

from __future__ import annotations

import numpy as np

from reference_sim.assembly.cholesky import analyse
from reference_sim.minimise.descent import Descent, Observer, mean_weight
from reference_sim.potential import Potential

REFERENCE_DT = 1 / 30  # [s], in shifts by M/dt^2 of a potential without inertia


class FactorisedHessian:
    """The Hessian over the free vertices: one symbolic analysis serves every step.

    Args:
        tolerance: of the relative residual, below which curvature is compared.

    Attributes:
        metric: (3n,) M/dt^2 [N/m], the unit of shifts.
        flat: curvature [N/m] below which a direction gains less than the tolerance over the cloth's
            width.
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
        self._solver = analyse(pattern.indptr, pattern.indices, pattern.order)

    def start_again(self) -> None:
        """Go back to the pattern without what dynamic terms have added."""
        self._pattern, self._solver = self._first

    def assemble(self, x: np.ndarray, convexity: float) -> np.ndarray:
        """Return values (nnz,) at x (V, 3), with that share of the elements' negative curvature taken out.

        Dynamic terms may need a wider pattern, analysed anew.
        """
        changing = self._pattern.changing(x, convexity)
        pattern = self._pattern.covering(changing)
        if pattern is not self._pattern:
            self._pattern = pattern
            self._analyse()
        return pattern.assemble(x, changing, convexity=convexity)

    def factorise(self, values: np.ndarray, shift: float | np.ndarray) -> bool:
        """Factorise the values plus shift M/dt^2; False if that is not positive definite."""
        return self._solver.factorise(self._shifted(values, shift))

    def _shifted(self, values: np.ndarray, shift: float | np.ndarray) -> np.ndarray:
        if not np.any(shift):
            return values
        values = values.copy()
        values[self._pattern.diagonal] += shift * self.metric
        return values

    def solve(self, b: np.ndarray) -> np.ndarray:
        """Solve with the last factorisation: b (3n,)."""
        return self._solver.solve(b)

    def stiffest(self, values: np.ndarray) -> float:
        """Return the largest entry of the diagonal [N/m]."""
        return float(np.abs(values[self._pattern.diagonal]).max(initial=0.0))

    def tiny_shift(self, values: np.ndarray) -> np.ndarray:
        """Return the shift (3n,) in units of M/dt^2 below which curvature counts as none."""
        return max(self.flat, 1e-13 * self.stiffest(values)) / self.metric


class FactorisedDescent(Descent):
    """Descent that factorises a Hessian, counts that and takes its time."""

    def __init__(
        self,
        potential: Potential,
        x: np.ndarray,
        hessian: FactorisedHessian,
        *,
        after: Descent | None = None,
        observe: Observer | None = None,
    ) -> None:
        super().__init__(potential, x, after=after, observe=observe)
        self.hessian = hessian
        self.factorised = False  # whether the last factorisation exists, to solve with

    def assemble(self, convexity: float) -> np.ndarray:
        """Return values (nnz,) of the Hessian at the point kept last."""
        with np.errstate(all="ignore"):
            return self.timed("assemble", self.hessian.assemble, self.x, convexity)

    def factorise(self, values: np.ndarray, shift: float | np.ndarray) -> bool:
        """Factorise, as the Hessian does; False if not positive definite."""
        self.factorised = self.timed("factorise", self.hessian.factorise, values, shift)
        self.factorisations += 1
        return self.factorised

    def solve(self, b: np.ndarray) -> np.ndarray:
        """Solve with the last factorisation, as the Hessian does."""
        return self.timed("solve", self.hessian.solve, b)
