"""What every minimisation keeps while it goes down: where it is, what it counted, and how it reports."""

from __future__ import annotations

import time

import numpy as np

from ..material import GRAVITY
from ..potential import Potential
from .result import Result


class Descent:
    """State of one minimisation of `potential` from x (V, 3) [m] over the free vertices of its cloth.

    Attributes:
        x: (V, 3), the point kept last; value [J] and g (3n,) [N] belong to it.
        iterations, factorisations: counts. seconds: time by part.
    """

    def __init__(self, potential: Potential, x: np.ndarray) -> None:
        self.potential = potential
        self.x = np.array(x, dtype=np.float64, order="C")
        self.free = potential.cloth.free
        self.weight = mean_weight(potential)
        self.iterations = self.factorisations = 0
        self.seconds = dict.fromkeys(("assemble", "factorise", "solve", "evaluate"), 0.0)
        self.started = time.perf_counter()
        self.value, self.g = self.evaluate(self.x)

    @property
    def finite(self) -> bool:
        """Whether value and gradient are numbers."""
        return bool(np.isfinite(self.value) and np.isfinite(self.g).all())

    def evaluate(self, x: np.ndarray) -> tuple[float, np.ndarray]:
        """Value [J] and gradient over the free vertices, flat (3n,) [N], at x (V, 3)."""
        start = time.perf_counter()
        with np.errstate(all="ignore"):  # a hopeless trial point is judged by its value, not by a warning
            value, gradient = self.potential.value_and_gradient(x)
        self.seconds["evaluate"] += time.perf_counter() - start
        return value, gradient[self.free].ravel()

    def spread(self, p: np.ndarray) -> np.ndarray:
        """A flat direction of the free vertices as (V, 3); pinned vertices stay."""
        step = np.zeros_like(self.x)
        step[self.free] = p.reshape(-1, 3)
        return step

    def gradient_norm(self) -> float:
        """Largest component of the gradient, in mean vertex weights."""
        return float(np.abs(self.g).max(initial=0.0)) / self.weight

    def late(self, timeout: float) -> bool:
        return time.perf_counter() - self.started > timeout

    def result(self, status: str, reason: str) -> Result:
        """The Result at the point kept last."""
        return Result(
            positions=self.x,
            status=status,
            reason=reason,
            iterations=self.iterations,
            factorisations=self.factorisations,
            gradient_norm=self.gradient_norm(),
            energy=self.value,
            terms=self.potential.terms(self.x),
            seconds=self.seconds,
        )


def mean_weight(potential: Potential) -> float:
    """Mean weight of a vertex of the potential's cloth [N], the unit of gradients here."""
    return float(potential.cloth.masses.mean() * GRAVITY)
