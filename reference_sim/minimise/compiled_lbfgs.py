"""Preconditioned L-BFGS that is stopped early, compiled as a whole and in float32.

The method of minimise.LBFGS without its finish by Newton, without float64, and without terms that declare
no kernel "float32_lanes" (kernels.fast_kernels). Evaluation, two-loop recursion, solves and line search
are one compiled function, of which the kernels of the terms are arguments.
"""

from __future__ import annotations

from collections import namedtuple
from types import SimpleNamespace
from typing import Any

import numpy as np

from reference_sim.cholesky import Cholesky, factorise, solve
from reference_sim.cloth import Cloth
from reference_sim.energies import bend_hinge_kernels, contact_penalty, stretch_stvk_kernels
from reference_sim.kernels.fast_kernels import StepTerms, step_terms
from reference_sim.kernels.kernel_cache import call_each, kernel_argument, njit
from reference_sim.kernels.lanes import FAST, HALF, SCRATCH, Float32Lanes, to_blocks
from reference_sim.minimise.descent import (
    LEAST_CURVATURE,
    SUFFICIENT_DECREASE,
    TOLERANCE,
    Result,
    add_scaled,
    dot,
    mean_weight,
)
from reference_sim.potential import HessianPattern, Potential

HALVINGS = 12  # of a step before its direction is given up
# Places of energies: the terms of elements come last, in their order.
INERTIA, WEIGHT, ELEMENTS = range(3)

# What is constant of the vertices: inertia [N/m] and weights [N] (V,); pinned: 3 times the vertex.
Vertices = namedtuple("Vertices", "inertia weights pinned")
# The preconditioner of free vertices (n,): constant values (nnz,), those of a step, layout and room of the
# factor, and room b (3, n + 1) for right sides.
Factor = namedtuple("Factor", "constant values free layout room b")
Memory = namedtuple("Memory", "S Y rho")  # of steps (m, 3V) [m] and changes of the gradient (m, 3V) [N]


@njit(cache=True, fastmath=FAST, error_model="numpy")
def vertex_gradient(u, inertia, target, weights, gradient):
    """Return the energies [J] of inertia and weight, and set gradient (3V,) [N].

    inertia (V,) [N/m] pulls towards target (3V,) [m]; the energy of weights (V,) [N] is counted from x_0
    on.
    """
    kinetic, potential = 0.0, 0.0
    for v in range(len(inertia)):
        part = np.float32(0.0)
        for a in range(3 * v, 3 * v + 3):
            offset = u[a] - target[a]
            gradient[a] = inertia[v] * offset
            part += offset * offset
        kinetic += HALF * inertia[v] * part
        gradient[3 * v + 1] += weights[v]
        potential += weights[v] * u[3 * v + 1]
    return kinetic, potential


@njit(cache=True)
def evaluate(u, target, vertices, terms, gradient, scratch, energies):
    """Return the sum of the energies [J] at u (3V,), and set its gradient (3V,) [N], zero at pinned vertices.

    terms: (kernel, data) of each term of elements, as `call_each` takes them. energies (2 + terms,) [J].
    """
    energies[INERTIA], energies[WEIGHT] = vertex_gradient(
        u, vertices.inertia, target, vertices.weights, gradient
    )
    call_each(terms, energies[ELEMENTS:], u, gradient, scratch)
    for i in vertices.pinned:
        for a in range(3):
            gradient[i + a] = np.float32(0.0)
    return energies.sum()


@njit(cache=True, error_model="numpy")
def precondition(stiffening, factor):
    """Factorise the constant stiffness plus that which terms ((kernel, data), ...) have in this step."""
    values = factor.values
    copy(factor.constant, values)
    call_each(stiffening, np.empty(len(stiffening)), values)
    return factorise(values, factor.layout, factor.room, np.float32(0.0))


@njit(cache=True)
def copy(source, target):
    """Copy n numbers: numba takes two seconds to compile an assignment to a slice."""
    for i in range(len(target)):
        target[i] = source[i]


@njit(cache=True)
def apply_inverse(q, factor):
    """Replace q (3V,) by the preconditioner's inverse times q."""
    b, free = factor.b, factor.free
    for k in range(len(free)):
        for axis in range(3):
            b[axis, k] = q[3 * free[k] + axis]
    solve(factor.layout, factor.room, b)
    for k in range(len(free)):
        for axis in range(3):
            q[3 * free[k] + axis] = b[axis, k]


@njit(cache=True, error_model="numpy")
def descend(
    u, target, vertices, terms, factor, memory, iterations, tolerance, first_step, work, scratch, energies,
    counts,
):  # fmt: skip
    """Run L-BFGS from u (3V,), which becomes the end; return the largest component of the gradient [N].

    It stops where that is within the tolerance [N]. first_step: share of the first direction that is
    tried first. work (4, 3V): room. counts: becomes iterations and first share taken.
    """
    gradient, trial_gradient, trial, p = work[0], work[1], work[2], work[3]
    value = evaluate(u, target, vertices, terms, gradient, scratch, energies)
    counts[0], counts[1] = 0.0, first_step
    trial_energies = np.empty_like(energies)
    size, pairs, newest = len(memory.rho), 0, -1
    alphas = np.empty(size, np.float32)
    while counts[0] < iterations and np.abs(gradient).max() > tolerance and np.isfinite(value):
        for i in range(len(u)):
            p[i] = -gradient[i]
        for back in range(pairs):
            k = (newest - back) % size
            alphas[k] = memory.rho[k] * dot(memory.S[k], p)
            add_scaled(p, -alphas[k], memory.Y[k])
        apply_inverse(p, factor)
        for back in range(pairs - 1, -1, -1):
            k = (newest - back) % size
            add_scaled(p, alphas[k] - memory.rho[k] * dot(memory.Y[k], p), memory.S[k])
        slope, trial_value = dot(gradient, p), value
        share, accepted = np.float32(1.0), False
        if counts[0] == 0:
            share = np.float32(first_step)
        for _ in range(HALVINGS if slope < 0 else 0):
            copy(u, trial)
            add_scaled(trial, share, p)
            trial_value = evaluate(
                trial, target, vertices, terms, trial_gradient, scratch, trial_energies
            )
            if np.isfinite(trial_value) and trial_value <= value + SUFFICIENT_DECREASE * share * slope:
                accepted = True
                break
            share *= np.float32(0.5)
        if not accepted:
            if pairs == 0:
                break
            pairs = 0
            continue
        if counts[0] == 0:
            counts[1] = share
        # The direction has done its work: it becomes the step, the gradient its change.
        for i in range(len(u)):
            p[i] = trial[i] - u[i]
            gradient[i] = trial_gradient[i] - gradient[i]
        curvature = dot(p, gradient)
        if curvature > LEAST_CURVATURE * np.sqrt(dot(p, p) * dot(gradient, gradient)):
            newest, pairs = (newest + 1) % size, min(pairs + 1, size)
            copy(p, memory.S[newest])
            copy(gradient, memory.Y[newest])
            memory.rho[newest] = np.float32(1.0) / curvature
        copy(trial, u)
        copy(trial_gradient, gradient)
        copy(trial_energies, energies)
        value = trial_value
        counts[0] += 1
    return np.abs(gradient).max()


MEMORY = 10


class CompiledLBFGS:
    """A minimiser of one potential. Raises ValueError for a term without a kernel, or no inertia."""

    def __init__(
        self, potential: Potential, *, max_iterations: int, tolerance: float = TOLERANCE
    ) -> None:
        self.potential, self.max_iterations = potential, max_iterations
        self._terms = terms = step_terms(potential, "float32_lanes", "CompiledLBFGS")
        self._lanes, self._places = _add_common(terms.kernels)
        self._gradients = [kernel_argument(lanes.gradient) for lanes in self._lanes]
        self._weight = mean_weight(potential)
        self._tolerance = tolerance * self._weight
        cloth = potential.cloth
        count = cloth.vertex_count
        self._vertices = Vertices(
            (terms.inertia.masses / terms.inertia.dt**2).astype(np.float32),
            terms.weights.astype(np.float32),
            3 * np.asarray(cloth.pins, np.int64),
        )
        self._factor, self._stiffening = _factor(cloth, terms, self._lanes)
        size = (MEMORY, 3 * count)
        self._memory = Memory(
            np.empty(size, np.float32), np.empty(size, np.float32), np.empty(MEMORY, np.float32)
        )
        self._work = np.empty((4, 3 * count), np.float32)
        self._scratch = np.empty(SCRATCH, np.float32)
        self._energies, self._counts = np.zeros(ELEMENTS + len(self._lanes)), np.zeros(2)
        self.start_again()

    def start_again(self) -> None:
        """Forget what the last step taught, as before a first one."""
        self._first_step = 1.0  # allowed by the first direction of the last step, mostly again

    def minimise(self, x0: np.ndarray) -> Result:
        """Run from x0 (V, 3) [m]: status "max_iterations", "stalled" or "diverged"."""
        x0 = np.ascontiguousarray(x0, np.float64)
        target = (self._terms.inertia.x_hat - x0).astype(np.float32).ravel()
        terms = self.freeze(x0)
        stiffening = tuple((kernel, (*terms[k][1], places)) for k, kernel, places in self._stiffening)
        self._energies[:], self._counts[:] = np.nan, 0.0  # nothing of the step before is reported
        u = np.zeros(x0.size, np.float32)
        if not precondition(stiffening, self._factor):
            return self._result(x0, "stalled", "the preconditioner is not positive definite", np.nan)
        residual = descend(
            u, target, self._vertices, terms, self._factor, self._memory, self.max_iterations,
            self._tolerance, min(2.0 * self._first_step, 1.0), self._work, self._scratch, self._energies,
            self._counts,
        )  # fmt: skip
        self._first_step = float(self._counts[1])
        x = x0 + u.reshape(x0.shape)
        if not np.isfinite(self._energies.sum()):
            return self._result(x, "diverged", "the energy is not finite", residual)
        return self._result(x, "max_iterations", self._reason(residual), residual)

    def freeze(self, x0: np.ndarray) -> tuple[tuple[np.ndarray, tuple[Any, ...]], ...]:
        """Return kernel and data of each term of elements for a step from x0 (V, 3) [m]."""
        return tuple(zip(self._gradients, (lanes.freeze(x0) for lanes in self._lanes)))

    def _reason(self, residual: float) -> str:
        """Say why the iterations ended where the largest component of the gradient is `residual` [N]."""
        count = int(self._counts[0])
        if residual <= self._tolerance:
            return f"gradient within tolerance after {count} iterations; curvature not checked"
        if count < self.max_iterations:
            return f"no step along the quasi-Newton direction lowers the energy, after {count} iterations"
        return f"stopped after {count} iterations"

    def _result(self, x: np.ndarray, status: str, reason: str, residual: float) -> Result:
        inertia, _, *elements = self._energies.tolist()
        values = {self._terms.inertia.name: inertia}
        values |= {term.name: term.value_and_gradient(x)[0] for term in self._terms.weighing}
        values |= {e.name: elements[k] for e, k in zip(self._terms.elements, self._places)}
        terms = {energy.name: values[energy.name] for energy in self.potential.energies}
        return Result(
            positions=x,
            status=status,
            reason=reason,
            iterations=int(self._counts[0]),
            factorisations=1,
            gradient_norm=float(residual) / self._weight,
            energy=sum(terms.values()),
            terms=terms,
        )


COMMON = stretch_stvk_kernels.lanes, bend_hinge_kernels.lanes, contact_penalty.lanes
_NONE, _VECTORS = np.empty(0), np.empty((0, 3))
NOTHING: Any = SimpleNamespace(  # a term of any of these kinds, without elements
    stencils=_VECTORS.astype(int), Dm_inverse=_VECTORS, areas=_NONE, lam=0.0, mu=0.0, stiffness=_NONE,
    rest_angles=_NONE, rest_samples=_VECTORS, weights=_VECTORS, points=_VECTORS, normals=_VECTORS,
    margin=0.0,
)  # fmt: skip


def _add_common(kernels: tuple[Float32Lanes, ...]) -> tuple[list[Float32Lanes], list[int]]:
    """Return the kernels of terms beside empty ones of the common kinds that are absent; places of terms.

    So `descend` is compiled once for all cloths of these kinds.
    """
    kinds = [lanes.gradient for lanes in kernels]
    if len(set(kinds)) < len(kinds):
        return list(kernels), list(range(len(kinds)))
    common = {lanes.gradient: lanes for lanes in (make(NOTHING) for make in COMMON)}
    common |= dict(zip(kinds, kernels))
    return list(common.values()), [list(common).index(kind) for kind in kinds]


def _factor(cloth: Cloth, terms: StepTerms, lanes: list[Float32Lanes]) -> tuple[Any, list[tuple]]:
    """Lay the preconditioner of free vertices out.

    Returns pattern and constant values, at rest, with room for the factor; and of each term whose
    stiffness changes from step to step its number, its kernel and the places of its lanes.
    """
    fixed = [e for e in (terms.inertia, *terms.elements) if 1 in e.constant]
    changing = [(k, term) for k, term in enumerate(lanes) if term.stiffness is not None]
    widening: list[Any] = [SimpleNamespace(stencils=term.stencils, constant=()) for _, term in changing]
    pattern = HessianPattern([*fixed, *widening], cloth.free, block=1)
    cholesky = Cholesky(pattern.indptr, pattern.indices, pattern.order)
    factor = Factor(
        pattern.constant, np.empty_like(pattern.constant), pattern.free, cholesky.layout,
        cholesky.room(np.float32), np.zeros((3, len(pattern.free) + 1), np.float32),
    )  # fmt: skip
    places = pattern.slots[len(fixed) :]
    stiffening = [
        (k, kernel_argument(term.stiffness), to_blocks(slots))
        for (k, term), slots in zip(changing, places)
    ]
    return factor, stiffening
