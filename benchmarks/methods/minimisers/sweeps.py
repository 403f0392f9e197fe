"""Solvers that sweep over a mesh a given number of times and ask for no convergence."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable

import numpy as np

from reference_sim.minimise.descent import Descent, Result, Stop, iterate
from reference_sim.potential import Potential

RUNAWAY_DISTANCE = 100.0  # [m] from the guess: nowhere


class SweepRun(Descent):
    """State of one minimisation by sweeps; x, value and g stay those of the start until the last one.

    Attributes:
        swept: (V, 3) [m] positions that the sweeps move in place.
        sweep: moves them once.
    """

    swept: np.ndarray
    sweep: Callable[[], object]


class SweepSolver(ABC):
    """Minimiser that takes `max_iterations` sweeps; a subclass says how they begin and what one does."""

    timeout = float("inf")

    def __init__(self, potential: Potential, *, max_iterations: int) -> None:
        self.potential, self.max_iterations = potential, max_iterations

    def minimise(self, x0: np.ndarray) -> Result:
        """Sweep from x0 (V, 3) [m]; the status is "max_iterations" or, where it runs away, "diverged"."""
        run = SweepRun(self.potential, x0)
        return run.result(iterate(self, run))

    def start_again(self) -> None:
        """Do nothing: sweeps learn nothing from step to step."""
        return

    @abstractmethod
    def init(self, run: SweepRun) -> Stop | None:
        """Set `run.swept` and `run.sweep`."""

    def step(self, run: SweepRun) -> Stop | None:
        """Sweep once."""
        run.sweep()
        return None

    def terminate(self, run: SweepRun) -> Stop | None:
        """Stop after the last sweep, or the one that threw a vertex RUNAWAY_DISTANCE from where it began."""
        # Written so that NaN is as far.
        if run.iterations and not (np.abs(run.swept - run.x).max(initial=0.0) < RUNAWAY_DISTANCE):
            return Stop("diverged", f"sweep {run.iterations} threw a vertex far away")
        if run.iterations < self.max_iterations:
            return None
        run.x = run.swept
        run.value, run.g = run.evaluate(run.x)
        return Stop("max_iterations", f"{run.iterations} sweeps done")
