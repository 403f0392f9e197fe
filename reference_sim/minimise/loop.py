"""The loop that all minimisers share: prepare, then step until something says stop.

A solver is a class with three functions, as in optimistix: `init` prepares the first step, `step` takes one,
`terminate` says whether the point reached is an answer. Each gets the state of the minimisation, a `Descent`,
and returns a `Stop` where there is nothing more to do. The loop counts the iterations, looks at the clock,
shows every point that was kept to the observer, and gives both limits their status.

Two things are outside of it. `compiled.minimiser` is a loop in one compiled call, for an iteration there
costs no more than a call of these functions. And Newton's method counts what it solves for and does not keep:
further full steps of a watchdog, and the step off a saddle.
"""

from __future__ import annotations

from typing import Protocol, TypeVar

from reference_sim.minimise.descent import Descent
from reference_sim.minimise.result import Stop

RunState = TypeVar("RunState", bound=Descent, contravariant=True)


NOT_FINITE = Stop("diverged", "energy or gradient is not finite at the starting point")


class Solver(Protocol[RunState]):
    """One way to minimise a potential; what a minimisation changes is in its `run`.

    Attributes:
        max_iterations: iterations before the loop gives up.
        timeout: seconds before it does, counted from the start of `run`.
    """

    max_iterations: int
    timeout: float

    def init(self, run: RunState) -> Stop | None:
        """Prepare the first step; return a Stop if there cannot be one."""
        ...

    def terminate(self, run: RunState) -> Stop | None:
        """Return a Stop if the point reached is an answer, or no step can lead on from it."""
        ...

    def step(self, run: RunState) -> Stop | None:
        """Take one step; return a Stop if there is none."""
        ...


def iterate(solver: Solver[RunState], run: RunState) -> Stop:  # type: ignore[misc]
    """Minimise from where `run` is; return why that ended. Limits give "max_iterations" and "timeout"."""
    if stop := solver.init(run):
        return stop
    run.show()
    while True:
        # Asked first: on a saddle, terminate takes an iteration and wants the step after it.
        last = run.iterations >= solver.max_iterations
        if stop := solver.terminate(run):
            return stop
        if last:
            return Stop("max_iterations", f"gave up after {run.iterations} iterations")
        if run.late(solver.timeout):
            return Stop("timeout", f"gave up after {solver.timeout:g} s")
        if stop := solver.step(run):
            return stop
        run.iterations += 1
        run.show()
