"""Preconditioned L-BFGS that is stopped early, compiled as a whole and in float32.

The method of minimise.LBFGS without its finish by Newton: the same preconditioner (mass over dt^2, the
cotangent Laplacian, contacts at the start), the same two-loop recursion, the same sufficient decrease. What
it leaves out: float64, the check of convergence (nothing but a factorised Hessian can say "converged"), and
all terms that declare no kernel "float32_lanes" (kernels.fast_kernels).
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from reference_sim.kernels.fast_kernels import StepTerms, step_terms
from reference_sim.kernels.float32_layout import SCRATCH, Float32Lanes, to_blocks
from reference_sim.kernels.kernel_argument import kernel_argument
from reference_sim.minimise.compiled import iteration
from reference_sim.minimise.compiled.scalar_factor import WIDTH, ScalarPattern
from reference_sim.minimise.descent import mean_weight
from reference_sim.minimise.result import TOLERANCE, Result
from reference_sim.potential import Potential

MEMORY = 10


class CompiledLBFGS:
    """A minimiser bound to one potential.

    Args:
        max_iterations: after which it stops.
        tolerance: relative residual, as in Newton, at which it stops sooner.

    Raises:
        ValueError: a term that it has no kernel for, or no inertia.
    """

    def __init__(self, potential: Potential, *, max_iterations: int, tolerance: float = TOLERANCE) -> None:
        self.potential, self.max_iterations = potential, max_iterations
        self._terms = terms = step_terms(potential, "float32_lanes", "CompiledLBFGS")
        self._lanes: tuple[Float32Lanes, ...] = terms.kernels
        self._gradients = [kernel_argument(lanes.gradient) for lanes in self._lanes]
        self._weight = mean_weight(potential)
        self._tolerance = tolerance * self._weight
        cloth = potential.cloth
        count = cloth.vertex_count
        self._vertices = iteration.Vertices(
            (terms.inertia.masses / terms.inertia.dt**2).astype(np.float32),
            terms.weights.astype(np.float32),
            3 * np.asarray(cloth.pins, np.int64),
        )
        self._factor, self._stiffening = _factor(cloth.free, cloth.rest_positions, terms)
        size = (MEMORY, 3 * count)
        self._memory = iteration.Memory(
            np.empty(size, np.float32), np.empty(size, np.float32), np.empty(MEMORY, np.float32)
        )
        self._work = np.empty((4, 3 * count), np.float32)
        self._scratch = np.empty(SCRATCH, np.float32)
        self._energies, self._counts = np.zeros(iteration.ELEMENTS + len(self._lanes)), np.zeros(2)
        self.start_again()

    def start_again(self) -> None:
        """Forget what the last step taught, as before a first one."""
        self._first_step = 1.0  # what the first direction of the last step allowed: most of the next too

    def minimise(self, x0: np.ndarray) -> Result:
        """Run from x0 (V, 3) [m]: status "max_iterations", "stalled" or "diverged"."""
        start = time.perf_counter()
        x0 = np.ascontiguousarray(x0, np.float64)
        target = (self._terms.inertia.x_hat - x0).astype(np.float32).ravel()
        terms = self.freeze(x0)
        stiffening = tuple((kernel, (*terms[k][1], places)) for k, kernel, places in self._stiffening)
        self._energies[:], self._counts[:] = np.nan, 0.0  # nothing of the step before is reported
        u = np.zeros(x0.size, np.float32)
        middle = time.perf_counter()
        if not iteration.precondition(stiffening, self._factor):
            return self._result(x0, "stalled", "the preconditioner is not positive definite", {}, np.nan)
        begun = time.perf_counter()
        residual = iteration.descend(
            u, target, self._vertices, terms, self._factor, self._memory, self.max_iterations,
            self._tolerance, min(2.0 * self._first_step, 1.0), self._work, self._scratch, self._energies,
            self._counts,
        )  # fmt: skip
        self._first_step = float(self._counts[1])
        seconds = {"assemble": middle - start, "factorise": begun - middle}
        seconds["descend"] = time.perf_counter() - begun
        x = x0 + u.reshape(x0.shape)
        if not np.isfinite(self._energies.sum()):
            return self._result(x, "diverged", "the energy is not finite", seconds, residual)
        return self._result(x, "max_iterations", self._reason(residual), seconds, residual)

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

    def _result(
        self, x: np.ndarray, status: str, reason: str, seconds: dict[str, float], residual: float
    ) -> Result:
        inertia, _, *elements = self._energies.tolist()
        values = {self._terms.inertia.name: inertia}
        values |= {term.name: term.value_and_gradient(x)[0] for term in self._terms.weighing}
        values |= {term.name: value for term, value in zip(self._terms.elements, elements)}
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
            seconds=seconds,
        )


def _factor(free: np.ndarray, rest: np.ndarray, terms: StepTerms) -> tuple[Any, list[tuple]]:
    """Lay the preconditioner of free vertices (V,) bool out.

    Returns pattern and constant values, at positions rest (V, 3) [m], with room for the factor; and of each
    term whose stiffness changes from step to step its number, its kernel and the places of its lanes.
    """
    number = np.full(len(free), -1)
    number[free] = np.arange(free.sum())
    fixed = [e for e in (terms.inertia, *terms.elements) if 1 in e.constant]
    changing = [(k, lanes) for k, lanes in enumerate(terms.kernels) if lanes.stiffness is not None]
    stencils = [number[e.stencils] for e in fixed] + [number[lanes.stencils] for _, lanes in changing]
    pattern = ScalarPattern(int(free.sum()), stencils)
    constant = np.zeros(pattern.entries)
    for energy in fixed:
        elements, values = energy.scalar_stiffness(rest)
        places = pattern.places(number[energy.stencils[elements]])
        np.add.at(constant, places[places >= 0], values[places >= 0])
    n, entries = pattern.count, len(pattern.rows)
    factor = iteration.Factor(
        constant, np.flatnonzero(free)[pattern.order], pattern.row_starts, pattern.row_columns,
        pattern.factor_rows, pattern.factor_columns, pattern.starts, pattern.rows, np.empty_like(constant),
        np.empty(entries), np.empty(n), np.zeros(n), np.empty(n, np.int64), np.zeros((n, WIDTH)),
    )  # fmt: skip
    stiffening = []
    for k, lanes in changing:
        places = pattern.places(number[lanes.stencils])
        blocks = to_blocks(places.reshape(len(places), -1))
        stiffening.append((k, kernel_argument(lanes.stiffness), blocks))
    return factor, stiffening
