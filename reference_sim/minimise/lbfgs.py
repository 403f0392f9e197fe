"""Limited-memory BFGS on top of a factored scalar stiffness, finished by Newton's method.

The first guess of the inverse Hessian is the inverse of an n x n matrix that x, y and z share: mass over
dt^2, (mu + lambda/2) times the cotangent Laplacian, and the curvature of the contacts (Liu, Bouaziz and
Kavan 2017). It is factorised once per minimisation and costs three triangular solves an iteration, so the
first hundredth of the gap comes several times sooner than with Newton; the last digits do not. So Newton
takes over where the relative residual is SWITCH, and its factorisations serve several steps each.
"""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from reference_sim.cholesky import Cholesky
from reference_sim.energies.energy import demand_positive
from reference_sim.kernels.fast_kernels import terms_without_kernel, warn_slow_path
from reference_sim.minimise.descent import (
    TOLERANCE,
    Descent,
    LBFGSHistory,
    Result,
    Stop,
    iterate,
)
from reference_sim.minimise.newton import Newton
from reference_sim.potential import Potential

if TYPE_CHECKING:
    from reference_sim.minimise.compiled_lbfgs import CompiledLBFGS

# What comes before Newton needs no more than float32. So it is compiled_lbfgs.CompiledLBFGS, where that
# has kernels for all terms, and goes on to COMPILED_SWITCH.
SWITCH, COMPILED_SWITCH = 1.0, 0.1  # relative residuals at which Newton takes over
PATIENCE = 100  # iterations after which it does in any case


class LBFGS:
    """Preconditioned L-BFGS for one potential, finished by Newton's method.

    tolerance, max_iterations, timeout: as in Newton, for both together.

    Args:
        memory: number of remembered steps; 0 is preconditioned gradient descent.
        finish: whether Newton takes over, at SWITCH or COMPILED_SWITCH, or after PATIENCE iterations.
            Without it nothing looks at the curvature, and no result is "converged".
    """

    def __init__(
        self,
        potential: Potential,
        *,
        tolerance: float = TOLERANCE,
        max_iterations: int = 500,
        memory: int = 10,
        finish: bool = True,
        timeout: float = float("inf"),
    ) -> None:
        self.potential, self.memory = potential, memory
        self.tolerance, self.timeout = tolerance, timeout
        demand_positive("LBFGS", tolerance=tolerance)
        self.max_iterations = min(PATIENCE, max_iterations) if finish else max_iterations
        fast = finish and memory > 0 and potential.time_step is not None
        if fast and (slow := terms_without_kernel(potential, "float32_lanes")):
            instead = "every step begins in float64 by numpy (docs/extend.md, An energy)"
            warn_slow_path("LBFGS", "float32 kernel", slow, instead)
            fast = False
        self.switch = max(COMPILED_SWITCH if fast else SWITCH, tolerance) if finish else tolerance
        self._compiled: CompiledLBFGS | None = None
        if fast:  # its kernels are loaded only where they serve
            from reference_sim.minimise.compiled_lbfgs import CompiledLBFGS

            self._compiled = CompiledLBFGS(
                potential, max_iterations=self.max_iterations, tolerance=self.switch
            )
        self._newton: Newton | None = None
        if finish:
            self._newton = Newton(
                potential, tolerance=tolerance, max_iterations=max_iterations, timeout=timeout, reuse=True,
                start_projected=True,
            )  # fmt: skip

    @cached_property
    def preconditioner(self) -> ScalarPreconditioner:
        """Scalar stiffness of the potential, analysed when first needed."""
        return ScalarPreconditioner(self.potential)

    def start_again(self) -> None:
        """Forget what earlier minimisations have taught, as before a first step."""
        if self._newton is not None:
            self._newton.start_again()

    def minimise(self, x0: np.ndarray) -> Result:
        """Minimise from x0 (V, 3) [m]; pinned vertices stay where x0 has them."""
        failure: Descent | None = None
        if self._newton is not None and self._compiled is not None:
            trial = Descent(self.potential, x0)
            if self._run_in_float32(self._compiled, trial):
                return self._newton.minimise(trial.x, after=trial)
            failure = trial
        run = LBFGSRun(self, x0)
        if failure is not None:
            run.started = failure.started
        stop = iterate(self, run)
        if failure is not None:
            run.add_costs(failure)
        if self._newton is None or stop.status in ("diverged", "timeout"):
            return run.result(stop)
        return self._newton.minimise(run.x, after=run)

    def terminate(self, run: LBFGSRun) -> Stop | None:
        """Stop where Newton's method is to take over."""
        if run.gradient_norm() > self.switch:
            return None
        return Stop("max_iterations", "gradient within tolerance; curvature not checked")

    def step(self, run: LBFGSRun) -> Stop | None:
        """Take one quasi-Newton step by line search."""
        if run.quasi_newton_step(run.history, run.solve):
            return None
        return Stop("stalled", "no step along the quasi-Newton direction lowers the energy")

    def _run_in_float32(self, compiled: CompiledLBFGS, run: Descent) -> bool:
        """Run the float32 part; return whether Newton may go on from its end.

        It may not if start or end is not finite, if the energy rose, or if the end is already within a
        tolerance below the switch: the rounding of float32 would remain in the answer.
        """
        if not run.finite:
            return False
        compiled.start_again()  # a frame has the same bits whatever went before
        result = compiled.minimise(run.x)
        start, run.x = run.value, result.positions
        run.value, run.g = run.evaluate(run.x)
        run.add_costs(result)
        falls = run.finite and run.value <= start
        loose = self.tolerance >= self.switch
        return falls and (loose or run.gradient_norm() > self.tolerance)


class LBFGSRun(Descent):
    """State of one minimisation by L-BFGS: history, and preconditioner factorised once."""

    def __init__(self, solver: LBFGS, x: np.ndarray) -> None:
        super().__init__(solver.potential, x)
        self.preconditioner = solver.preconditioner
        self.history = LBFGSHistory(solver.memory)

    def begin(self) -> Stop | None:
        """Factorise the preconditioner at the start, once for all steps."""
        if stop := super().begin():
            return stop
        self.factorisations += 1
        if self.preconditioner.solver.factorise(self.preconditioner.assemble(self.x)):
            return None
        return Stop("stalled", "the preconditioner is not positive definite")

    def solve(self, q: np.ndarray) -> np.ndarray:
        """Return the inverse of the preconditioner times q (3n,)."""
        return self.preconditioner.solver.solve(q.reshape(-1, 3)).ravel()


# In units of M/dt^2 at 30 steps a second. Cloth that nothing holds needs it against its rigid motions
# alone; 1 in its place slows the soft bending modes down ten times.
FLOOR = 1e-4


class ScalarPreconditioner:
    """Scalar stiffness of a potential over the free vertices; one symbolic analysis for all steps."""

    def __init__(self, potential: Potential) -> None:
        free = potential.cloth.free
        self._pattern = potential.pattern(free, block=1)
        self.solver = Cholesky(self._pattern.indptr, self._pattern.indices, self._pattern.order)
        self._floor = FLOOR * potential.cloth.masses[free] * 30**2

    def assemble(self, x: np.ndarray) -> np.ndarray:
        """Return values (nnz,) [N/m] at x (V, 3) [m]."""
        values = self._pattern.assemble(x)
        values[self._pattern.diagonal] += self._floor
        return values
