"""What has not converged has no known answer."""

from __future__ import annotations

from typing import TypeVar

from reference_sim import Result, Trajectory

Solved = TypeVar("Solved", Result, Trajectory)


def converged(solved: Solved, what: str) -> Solved:
    """The result itself. Raises RuntimeError naming `what`, the status and its reason where it is none."""
    if solved.status != "converged":
        raise RuntimeError(f"{what} ended as {solved.status}: {solved.reason}")
    return solved
