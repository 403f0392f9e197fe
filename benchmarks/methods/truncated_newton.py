"""Newton's method alone, cut short: every iteration is a factorisation of the true Hessian, or several."""

from __future__ import annotations

from pathlib import Path

from .simulation import Simulation


def make(*, models: Path, seed: int, iterations: int) -> Simulation:
    """A simulation that stops every step after `iterations` Newton iterations, converged or not."""
    return Simulation(options={"method": "newton", "max_iterations": iterations})
