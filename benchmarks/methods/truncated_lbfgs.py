"""L-BFGS with a factored scalar preconditioner, cut short: the strong baseline of fast approximation.

The preconditioner (mass over dt^2, a cotangent Laplacian, contacts) is factorised once a step; an iteration
then costs one evaluation of the energies and three triangular solves. Without memory it is preconditioned
gradient descent, in the manner of projective dynamics: one constant matrix, a line search, nothing learned
from one iteration to the next.
"""

from __future__ import annotations

from pathlib import Path

from .simulation import Simulation

MEMORY = 10  # remembered steps


def make(
    *, models: Path, seed: int, iterations: int, memory: int = MEMORY, tolerance: float = 1e-6
) -> Simulation:
    """A simulation that stops every step after `iterations` of L-BFGS with that many remembered steps."""
    return Simulation(
        options={
            "method": "lbfgs",
            "max_iterations": iterations,
            "memory": memory,
            "tolerance": tolerance,
            "finish": False,
        }
    )
