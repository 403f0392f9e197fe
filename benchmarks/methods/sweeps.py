"""Vertex block descent and XPBD: solvers that sweep over a mesh a given number of times.

One sweep of vertex block descent (Chen et al. 2024) visits the free vertices one after the other. Each
takes a Newton step of its own three coordinates, all others held still:

    x_i <- x_i - H_ii^-1 g_i,    g_i, H_ii: gradient and 3 x 3 block of the whole step's potential

with H_ii made positive definite as in the simulator (compressive stress and the hinge's second derivative
left out), so its stationary points are Newton's. There is no line search, as in the paper, and no guess or
Chebyshev acceleration.

Extended position-based dynamics (Macklin et al. 2016) has constraints whose energies are ours, exactly.
Each element is a constraint C(x) (a vector for the membrane) with energy C . K C / 2:

    strain      C = (G00, G11, G01),  K = A [[l + 2 mu, l, 0], [l, l + 2 mu, 0], [0, 0, 4 mu]], l = lambda
    bending     C = theta - theta_0,  K = k
    collision   C = depth^(3/2),      K = 2 k a_s

The weight is in the predicted positions x_hat + dt^2 g, where a step starts. A sweep solves one
constraint after the other:

    (grad C M^-1 grad C^T + K^-1/dt^2) dlam = -C - K^-1/dt^2 lam,    x += M^-1 grad C^T dlam

It minimises the potential where C is linear in x. Elsewhere its limit for many sweeps is another
configuration: it obeys lam = -dt^2 K C, but the momentum equation only as far as grad C did not turn on
the way from the prediction.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable

import numpy as np

from reference_sim.kernels.fast_kernels import SCRATCH_SHAPE, step_terms
from reference_sim.kernels.kernel_cache import call_each, kernel_argument, njit, resolve_types
from reference_sim.minimise.descent import Descent, Result, Stop
from reference_sim.potential import Potential

RUNAWAY_DISTANCE = 100.0  # [m] from the guess: nowhere


class SweepSolver(ABC):
    """Minimiser that takes `max_iterations` sweeps; a subclass says how they begin and what one does."""

    def __init__(self, potential: Potential, *, max_iterations: int) -> None:
        self.potential, self.max_iterations = potential, max_iterations

    def minimise(self, x0: np.ndarray) -> Result:
        """Sweep from x0 (V, 3) [m]; the status is "max_iterations" or, where it runs away, "diverged"."""
        run = Descent(self.potential, x0)
        x, sweep = self.begin(run.x)
        for run.iterations in range(1, self.max_iterations + 1):
            sweep()
            # Written so that NaN is as far.
            if not (np.abs(x - run.x).max(initial=0.0) < RUNAWAY_DISTANCE):
                reason = f"sweep {run.iterations} threw a vertex far away"
                return run.result(Stop("diverged", reason))
        run.x = x
        run.value, run.g = run.evaluate(x)
        return run.result(Stop("max_iterations", f"{run.iterations} sweeps done"))

    def start_again(self) -> None:
        """Do nothing: sweeps learn nothing from step to step."""
        return

    @abstractmethod
    def begin(self, guess: np.ndarray) -> tuple[np.ndarray, Callable[[], object]]:
        """Return where the sweeps begin (V, 3) [m], and the function that moves it in place once."""


@njit(cache=True, error_model="numpy")
def sweep_vertices(x, free, inertia, terms):
    """Take a Newton step of one free vertex after the other; x (V, 3) [m] is moved in place.

    inertia: m / dt^2 (V,) [N/m], x_hat (V, 3) [m] and weights (V,) [N]. terms: (kernel, data) of each.
    """
    g, H = np.empty(3), np.empty((3, 3))
    scratch, out = np.empty(SCRATCH_SHAPE), np.empty(len(terms))
    for v in free:
        block(x, v, inertia, terms, g, H, scratch, out)
        _newton(x, v, g, H)


@njit(cache=True, error_model="numpy", forceinline=True)
def block(x, v, inertia, terms, g, H, scratch, out):
    """Write the gradient g (3,) and the convex block H (3, 3) of vertex v.

    scratch and out (terms,) are room for the kernels.
    """
    mass, x_hat, weight = inertia
    for i in range(3):
        g[i] = mass[v] * (x[v, i] - x_hat[v, i])
        for j in range(3):
            H[i, j] = mass[v] if i == j else 0.0
    g[1] += weight[v]
    call_each(terms, out, x, v, g, H, scratch)


@njit(cache=True, inline="always", error_model="numpy")
def _newton(x, v, g, H):
    """Subtract H^-1 g, by the adjugate, from x_v; H is positive definite, by its masses."""
    c0 = H[1, 1] * H[2, 2] - H[1, 2] * H[2, 1]
    c1 = H[1, 2] * H[2, 0] - H[1, 0] * H[2, 2]
    c2 = H[1, 0] * H[2, 1] - H[1, 1] * H[2, 0]
    scale = 1.0 / (H[0, 0] * c0 + H[0, 1] * c1 + H[0, 2] * c2)
    d0 = H[0, 2] * H[2, 1] - H[0, 1] * H[2, 2]
    d1 = H[0, 0] * H[2, 2] - H[0, 2] * H[2, 0]
    d2 = H[0, 1] * H[2, 0] - H[0, 0] * H[2, 1]
    f0 = H[0, 1] * H[1, 2] - H[0, 2] * H[1, 1]
    f1 = H[0, 2] * H[1, 0] - H[0, 0] * H[1, 2]
    f2 = H[0, 0] * H[1, 1] - H[0, 1] * H[1, 0]
    x[v, 0] -= scale * (c0 * g[0] + d0 * g[1] + f0 * g[2])
    x[v, 1] -= scale * (c1 * g[0] + d1 * g[1] + f1 * g[2])
    x[v, 2] -= scale * (c2 * g[0] + d2 * g[1] + f2 * g[2])


@njit(cache=True, error_model="numpy")
def sweep_constraints(x, w, terms):
    """Solve the constraints of one term after the other; x (V, 3) [m] is moved in place.

    w: dt^2 over the mass (V,) [m/N]. terms: (kernel, data) of each.
    """
    call_each(terms, np.empty(len(terms)), x, w)


class VertexBlockDescent(SweepSolver):
    """Vertex block descent. Raises ValueError for a term without a sweep, and without inertia."""

    def __init__(self, potential: Potential, *, max_iterations: int) -> None:
        super().__init__(potential, max_iterations=max_iterations)
        self._terms = step_terms(potential, "vertex_block", "vertex block descent")
        self._free = np.flatnonzero(potential.cloth.free)
        vertices = potential.cloth.vertex_count
        self._blocks = [
            (
                kernel_argument(blocks.kernel),
                incidence(blocks.stencils, blocks.used, vertices),
                blocks.freeze,
            )
            for blocks in self._terms.kernels
        ]

    def freeze(self) -> tuple[tuple, tuple]:
        """Return inertia and the other terms as `sweep_vertices` takes them in this step."""
        terms, inertia = self._terms, self._terms.inertia
        return (
            (inertia.masses / inertia.dt**2, inertia.x_hat, terms.weights),
            tuple((kernel, (*around, *freeze())) for kernel, around, freeze in self._blocks),
        )

    def begin(self, guess: np.ndarray) -> tuple[np.ndarray, Callable[[], object]]:
        """Begin at the guess."""
        x = guess.copy()
        return x, resolve_types(sweep_vertices, x, self._free, *self.freeze())


def incidence(stencils: np.ndarray, used: np.ndarray, vertices: int) -> tuple[np.ndarray, np.ndarray]:
    """Find the elements around each vertex among stencils (N, k), by the corners marked used (N, k).

    Returns:
        first (V + 1,) and corners (M,): corner c of element e is e * k + c, and those of vertex v are
        corners[first[v] : first[v + 1]].
    """
    corners = np.flatnonzero(used)
    owner = stencils.ravel()[corners]
    first = np.concatenate([[0], np.cumsum(np.bincount(owner, minlength=vertices))])
    return first, corners[np.argsort(owner, kind="stable")]


class XPBD(SweepSolver):
    """Extended position-based dynamics. Raises ValueError for a term without a sweep, and without inertia."""

    def __init__(self, potential: Potential, *, max_iterations: int) -> None:
        super().__init__(potential, max_iterations=max_iterations)
        self._terms = terms = step_terms(potential, "constraint", "XPBD")
        self._kernels = [kernel_argument(constraints.kernel) for constraints in terms.kernels]
        masses, dt = terms.inertia.masses, terms.inertia.dt
        self._inverse = np.where(potential.cloth.free, dt**2 / masses, 0.0)

    def begin(self, guess: np.ndarray) -> tuple[np.ndarray, Callable[[], object]]:
        """Begin at the predicted positions; of the guess only the pinned vertices are read."""
        x = self._terms.inertia.x_hat.copy()
        x[:, 1] -= self._inverse * self._terms.weights
        pins = self.potential.cloth.pins
        x[pins] = guess[pins]
        frozen = (constraints.freeze() for constraints in self._terms.kernels)
        terms = tuple(zip(self._kernels, frozen))
        return x, resolve_types(sweep_constraints, x, self._inverse, terms)
