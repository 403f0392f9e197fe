"""Extended position-based dynamics (Macklin et al. 2016) with constraints whose energies are ours, exactly.

Each element is a constraint C(x) (a vector for the membrane) with energy C . K C / 2:

    strain      C = (G00, G11, G01),  K = A [[l + 2 mu, l, 0], [l, l + 2 mu, 0], [0, 0, 4 mu]], l = lambda
    bending     C = theta - theta_0,  K = k
    collision   C = depth^(3/2),      K = 2 k a_s

so the sum over elements is StVK, hinges and the cubic penalty, to the last digit; the weight is in the
predicted positions x_hat + dt^2 g, where a step starts. A sweep solves one constraint after the other:

    (grad C M^-1 grad C^T + K^-1/dt^2) dlam = -C - K^-1/dt^2 lam,    x += M^-1 grad C^T dlam

What it does not do is find the potential's minimum: the positions keep the gradients of C from where each
dlam was found, and the second derivatives of C are left out. Its fixed point obeys lam = -dt^2 K C, but the
momentum equation only as far as grad C did not turn on the way from the prediction. It minimises the
potential where C is linear in x; elsewhere its limit for many sweeps is another configuration.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from benchmarks.methods.minimisers.kernels import sweep_constraints
from benchmarks.methods.minimisers.sweeps import SweepRun, SweepSolver
from benchmarks.methods.solvers.simulation import Simulation
from reference_sim.kernels.fast_kernels import step_terms
from reference_sim.kernels.kernel_cache import kernel_argument, with_types_resolved
from reference_sim.minimise.descent import Stop
from reference_sim.potential import Potential


class XPBD(SweepSolver):
    """Extended position-based dynamics for one potential, of which it finds no minimum in general.

    Args:
        potential: the sum of energies.
        max_iterations: sweeps over all constraints.

    Raises:
        ValueError: the potential has a term without a sweep, or no inertia.
    """

    def __init__(self, potential: Potential, *, max_iterations: int) -> None:
        super().__init__(potential, max_iterations=max_iterations)
        self._terms = terms = step_terms(potential, "constraint", "XPBD")
        self._kernels = [kernel_argument(constraints.kernel) for constraints in terms.kernels]
        masses, dt = terms.inertia.masses, terms.inertia.dt
        self._inverse = np.where(potential.cloth.free, dt**2 / masses, 0.0)

    def init(self, run: SweepRun) -> Stop | None:
        """Begin at the predicted positions; of the guess only the pinned vertices are read."""
        x = self._terms.inertia.x_hat.copy()
        x[:, 1] -= self._inverse * self._terms.weights
        pins = self.potential.cloth.pins
        x[pins] = run.x[pins]
        frozen = (constraints.freeze() for constraints in self._terms.kernels)
        terms = tuple(zip(self._kernels, frozen))
        run.swept, run.sweep = x, with_types_resolved(sweep_constraints, x, self._inverse, terms)
        return None


def make(*, models: Path, seed: int, iterations: int) -> Simulation:
    """Make a simulation whose every step is `iterations` sweeps of XPBD."""
    return Simulation(options={"method": XPBD, "max_iterations": iterations})
