"""Result of a minimisation: the point reached, and how far that is from a minimum."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

STATUSES = ("converged", "stalled", "max_iterations", "diverged", "timeout")
TOLERANCE = 1e-6  # of the relative residual, by default
_SEVERITY = {"converged": 0, "max_iterations": 1, "stalled": 1, "timeout": 2, "diverged": 3}


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
        positions: (V, 3) [m], the best found.
        status: one of STATUSES. "converged" means: gradient within tolerance, no negative curvature beyond
            round-off left, of which a factorisation of the Hessian plus a tiny shift is the proof, and a
            negligible Newton step of that matrix. A longer step is accepted where the Hessian without the
            shift has no factorisation, as for cloth that may move rigidly: its length means nothing there.
        reason: one line in words.
        relaxed: whether "converged" holds within round-off alone: the residual, or the round-off in it, is
            above the tolerance; the reason says which.
        iterations, factorisations: counts.
        gradient_norm: the relative residual [1], by which every minimisation here is stopped: the largest
            component of dPhi/dx over the free vertices, divided by the mean weight of a vertex.
        energy: value at positions [J].
        terms: energy of each term [J].
        seconds: time by part: assemble, factorise, solve, evaluate; descend is a whole compiled descent,
            evaluations and solves with the preconditioner included.
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
    relaxed: bool = False


def severity(status: str) -> int:
    """Return how bad the status of a minimisation is: 0 is good."""
    return _SEVERITY[status]


def check_tolerance(tolerance: float) -> None:
    """Raise ValueError for a tolerance that is no finite number above zero."""
    if not 0.0 < tolerance < float("inf"):
        raise ValueError(f"tolerance = {tolerance}: give a finite number above 0, in mean vertex weights")
