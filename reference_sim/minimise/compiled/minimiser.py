"""Preconditioned L-BFGS that is stopped early, compiled as a whole and in float32.

The method of minimise.LBFGS without its finish by Newton: the same preconditioner (mass over dt^2, the
cotangent Laplacian, contacts at the start), the same two-loop recursion, the same sufficient decrease. What
it leaves out: float64, the check of convergence (nothing but a factorised Hessian can say "converged"), and
all terms but inertia, weight, StVK, hinges and the contact penalty.
"""

from __future__ import annotations

import time
from math import prod
from typing import TYPE_CHECKING, Any

import numpy as np

from reference_sim.cloth import Cloth
from reference_sim.energies.term_kinds import Terms, terms_of
from reference_sim.kernels.kernel_cache import njit
from reference_sim.minimise.compiled import iteration
from reference_sim.minimise.compiled.elements import LANES, SCRATCH, blocks, edges_of
from reference_sim.minimise.compiled.scalar_factor import WIDTH, ScalarPattern
from reference_sim.minimise.descent import mean_weight
from reference_sim.minimise.result import Result
from reference_sim.potential import Potential

if TYPE_CHECKING:
    from reference_sim.energies import BendHinge, ContactPenalty, Energy, StretchStVK

MEMORY = 10


class CompiledLBFGS:
    """A minimiser bound to one potential.

    Args:
        max_iterations: after which it stops.
        tolerance: relative residual, as in Newton, at which it stops sooner.

    Raises:
        ValueError: a term that it has no kernel for, or no inertia.
    """

    def __init__(self, potential: Potential, *, max_iterations: int, tolerance: float = 1e-6) -> None:
        self.potential, self.max_iterations = potential, max_iterations
        self._terms = terms = terms_of(potential, "CompiledLBFGS")
        self._weight = mean_weight(potential)
        self._tolerance = tolerance * self._weight
        cloth = potential.cloth
        count = cloth.vertex_count
        zero = np.zeros(count)
        self._vertices = iteration.Vertices(
            (terms.inertia.masses / terms.inertia.dt**2).astype(np.float32),
            (zero if terms.gravity is None else terms.gravity.weights).astype(np.float32),
            3 * np.asarray(cloth.pins, np.int64),
        )
        self._membrane, self._lame = _membrane(terms.strain)
        self._hinges = _hinges(terms.bending)
        self._order, self._contact = _contact(terms.contact)
        self._weights = np.zeros((0, 3 * LANES))  # in float64: a third of metres is no third in float32
        if terms.contact is not None:
            self._weights = blocks(terms.contact.weights[self._order])
        self._factor = _factor(cloth, terms, self._order)
        size = (MEMORY, 3 * count)
        self._memory = iteration.Memory(
            np.empty(size, np.float32), np.empty(size, np.float32), np.empty(MEMORY, np.float32)
        )
        self._work = np.empty((4, 3 * count), np.float32)
        self._scratch = np.empty(SCRATCH, np.float32)
        self._energies, self._counts = np.zeros(len(iteration.ENERGIES)), np.zeros(3)
        self.start_again()

    def start_again(self) -> None:
        """Forget what the last step taught, as before a first one."""
        self._first_step = 1.0  # what the first direction of the last step allowed: most of the next too

    def minimise(self, x0: np.ndarray) -> Result:
        """Run from x0 (V, 3) [m]: status "max_iterations", "stalled" or "diverged"."""
        start = time.perf_counter()
        terms, x0 = self._terms, np.ascontiguousarray(x0, np.float64)
        target = (terms.inertia.x_hat - x0).astype(np.float32).ravel()
        edges_of(x0, self._membrane.vertices, 2, self._membrane.state)
        edges_of(x0, self._hinges.vertices, 3, self._hinges.state)
        contact = self._frozen_contact(x0)
        self._energies[:], self._counts[:] = np.nan, 0.0  # nothing of the step before is reported
        u = np.zeros(x0.size, np.float32)
        middle = time.perf_counter()
        if not iteration.precondition(contact, self._factor):
            return self._result(x0, "stalled", "the preconditioner is not positive definite", {}, np.nan)
        begun = time.perf_counter()
        residual = iteration.descend(
            u, target, self._vertices, self._membrane, self._lame, self._hinges, contact, self._factor,
            self._memory, self.max_iterations, self._tolerance, min(2.0 * self._first_step, 1.0), self._work,
            self._scratch, self._energies, self._counts,
        )  # fmt: skip
        self._first_step = float(self._counts[2])
        seconds = {"assemble": middle - start, "factorise": begun - middle}
        seconds["evaluate"] = time.perf_counter() - begun
        x = x0 + u.reshape(x0.shape)
        if not np.isfinite(self._energies.sum()):
            return self._result(x, "diverged", "the energy is not finite", seconds, residual)
        reason = f"stopped after {int(self._counts[0])} iterations"
        return self._result(x, "max_iterations", reason, seconds, residual)

    def _frozen_contact(self, x0: np.ndarray) -> Any:
        """The blocks of samples, and which of them have one that is not far."""
        near, term = np.zeros(0, np.int64), self._terms.contact
        if term is not None:
            near = _depths(
                x0.ravel(), self._order, self._contact.vertices, self._weights, term.points, term.normals,
                term.margin, _far(term), self._contact.state,
            )  # fmt: skip
        return iteration.Contact(near, *self._contact)

    def _result(
        self, x: np.ndarray, status: str, reason: str, seconds: dict[str, float], residual: float
    ) -> Result:
        named = dict(zip(iteration.ENERGIES, self._energies.tolist()))
        gravity = self._terms.gravity
        if gravity is not None:
            named["gravity"] = gravity.value_and_gradient(x)[0]
        terms = {energy.name: named[energy.name] for energy in self.potential.energies}
        return Result(
            positions=x,
            status=status,
            reason=reason,
            iterations=int(self._counts[0]),
            factorisations=1,
            gradient_norm=float(residual) / self._weight,
            energy=sum(terms.values()),
            terms=terms,
            seconds=seconds,
        )


def _elements(stencils: np.ndarray, constants: list[np.ndarray], states: int) -> Any:
    """Blocks of elements with constants (N,) or (N, k), and room for so many states."""
    columns = np.concatenate([c.reshape(len(c), prod(c.shape[1:])) for c in constants], axis=1)
    vertices = blocks(3 * stencils.astype(np.int32))
    state = np.zeros((len(vertices), states * LANES), np.float32)
    return iteration.Elements(vertices, blocks(columns.astype(np.float32)), state)


def _membrane(term: StretchStVK | None) -> tuple[Any, Any]:
    if term is None:
        return _elements(np.zeros((0, 3), int), [np.zeros((0, 5))], 6), iteration.Lame(*np.zeros(2, "f4"))
    elements = _elements(term.stencils, [term.Dm_inverse, term.areas], 6)
    return elements, iteration.Lame(np.float32(term.lam), np.float32(term.mu))


def _hinges(term: BendHinge | None) -> Any:
    if term is None:
        return _elements(np.zeros((0, 4), int), [np.zeros((0, 2))], 9)
    return _elements(term.stencils, [term.stiffness, term.rest_angles], 9)


def _contact(term: ContactPenalty | None) -> tuple[np.ndarray, Any]:
    """Samples in an order (S,) in which those of a block lie near each other, and their blocks."""
    if term is None:
        return np.zeros(0, int), _elements(np.zeros((0, 3), int), [np.zeros((0, 4))], 4)
    from reference_sim.contact.closest_point import by_cells  # not of a cloth that meets nothing

    order = by_cells(term.rest_samples)
    return order, _elements(term.stencils[order], [term.weights[order], term.stiffness[order]], 4)


def _factor(cloth: Cloth, terms: Terms, order: np.ndarray) -> Any:
    """Pattern and constant values of the preconditioner, and room for its factor."""
    number = np.full(cloth.vertex_count, -1)
    number[cloth.free] = np.arange(cloth.free.sum())
    fixed: list[Energy] = [e for e in (terms.inertia, terms.strain) if e is not None]
    touching = np.zeros((0, 3), int) if terms.contact is None else terms.contact.stencils[order]
    pattern = ScalarPattern(int(cloth.free.sum()), [number[e.stencils] for e in fixed] + [number[touching]])
    constant = np.zeros(pattern.entries)
    for energy in fixed:
        elements, values = energy.scalar_stiffness(cloth.rest_positions)
        places = pattern.places(number[energy.stencils[elements]])
        np.add.at(constant, places[places >= 0], values[places >= 0])
    places = pattern.places(number[touching]).reshape(-1, 9)
    n, entries = pattern.count, len(pattern.rows)
    return iteration.Factor(
        constant, blocks(places), np.flatnonzero(cloth.free)[pattern.order], pattern.row_starts,
        pattern.row_columns, pattern.factor_rows, pattern.factor_columns, pattern.starts, pattern.rows,
        np.empty_like(constant), np.empty(entries), np.empty(n), np.zeros(n), np.empty(n, np.int64),
        np.zeros((n, WIDTH)),
    )  # fmt: skip


def _far(term: ContactPenalty) -> np.ndarray:
    """(S,) samples that the step has out of reach."""
    planes = term.planes
    return np.zeros(len(term.stencils), bool) if planes is None or planes.far is None else planes.far


@njit(cache=True)
def _depths(x, order, vertices, constants, points, normals, margin, far, state):
    """Normals and depths of the samples at x (3V,), in blocks; those with one that is not far (S,)."""
    near, count = np.empty(len(state), np.int64), 0
    for place in range(len(order)):
        s, block, lane = order[place], place // LANES, place % LANES
        i, j, k = vertices[block, lane], vertices[block, LANES + lane], vertices[block, 2 * LANES + lane]
        u, v, w = constants[block, lane], constants[block, LANES + lane], constants[block, 2 * LANES + lane]
        depth = margin
        for a in range(3):
            sample = u * x[i + a] + v * x[j + a] + w * x[k + a]
            depth -= normals[s, a] * (sample - points[s, a])
            state[block, a * LANES + lane] = normals[s, a]
        state[block, 3 * LANES + lane] = depth
        if far[s] or (count > 0 and near[count - 1] == block):
            continue
        near[count] = block
        count += 1
    return near[:count]
