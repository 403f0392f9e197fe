"""Convergence of a solve, and order of convergence by slope."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, TypeVar

import numpy as np

if TYPE_CHECKING:
    import reference_sim as sim

Solved = TypeVar("Solved", "sim.Result", "sim.Trajectory")


def demand_converged(solved: Solved, name: str) -> Solved:
    """Return the result itself. Raises RuntimeError with `name`, status and reason unless it converged."""
    if solved.status != "converged":
        raise RuntimeError(f"{name} ended as {solved.status}: {solved.reason}")
    return solved


def fitted_order(errors: Sequence[float], sizes: Sequence[float]) -> float:
    """Return the slope of log error over log size by least squares; nan for errors of zero or not finite.

    >>> round(fitted_order([4e-3, 1e-3, 2.5e-4], [1, 0.5, 0.25]), 6)
    2.0
    """
    if not (np.isfinite(errors).all() and np.min(errors) > 0):
        return float("nan")
    return float(np.polyfit(np.log(sizes), np.log(errors), 1)[0])
