"""What a minimiser says: where it got to, and the truth about how far that is."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

STATUSES = ("converged", "stalled", "max_iterations", "diverged", "timeout")


@dataclass(frozen=True, eq=False)
class Result:
    """Outcome of one minimisation. Failure is a value here, not an exception.

    Attributes:
        positions: (V, 3) [m], the best found.
        status: one of STATUSES. "converged" means: gradient within tolerance, the unregularised Newton step
            negligible, and no negative curvature left.
        reason: one line in words.
        iterations, factorisations: counts.
        gradient_norm: largest component over free vertices, in mean vertex weights [1].
        energy: value at positions [J].
        terms: energy of each term [J].
        seconds: time by part: assemble, factorise, solve, evaluate.
    """

    positions: np.ndarray
    status: str
    reason: str
    iterations: int
    factorisations: int
    gradient_norm: float
    energy: float
    terms: dict[str, float]
    seconds: dict[str, float] = field(default_factory=dict)
