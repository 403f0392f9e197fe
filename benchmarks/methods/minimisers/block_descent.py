"""Vertex block descent (Chen et al. 2024) on the energies of reference_sim.

One sweep visits the free vertices one after the other. Each takes a Newton step of its own three coordinates,
all others held still:

    x_i <- x_i - H_ii^-1 g_i,    g_i, H_ii: gradient and 3 x 3 block of the whole step's potential

with H_ii made positive definite as in the simulator (compressive stress and the hinge's second derivative
left out). So it minimises exactly the potential that Newton minimises, and a vertex at rest for all sweeps is
a stationary point of it. On one core a sweep in the order of the mesh needs no colours. As in the paper there
is no line search; its guess and its Chebyshev acceleration are left out: all solvers start alike here.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from benchmarks.methods.minimisers.kernels import sweep_vertices
from benchmarks.methods.minimisers.sweeps import SweepRun, SweepSolver
from benchmarks.methods.solvers.simulation import Simulation
from reference_sim.kernels.fast_kernels import step_terms
from reference_sim.kernels.kernel_cache import kernel_argument, with_types_resolved
from reference_sim.minimise.descent import Stop
from reference_sim.potential import Potential


class VertexBlockDescent(SweepSolver):
    """Vertex block descent for one potential.

    Args:
        potential: the sum of energies.
        max_iterations: sweeps over all free vertices.

    Raises:
        ValueError: the potential has a term without a sweep, or no inertia.
    """

    def __init__(self, potential: Potential, *, max_iterations: int) -> None:
        super().__init__(potential, max_iterations=max_iterations)
        self._terms = step_terms(potential, "vertex_block", "vertex block descent")
        self._free = np.flatnonzero(potential.cloth.free)
        vertices = potential.cloth.vertex_count
        self._blocks = [
            (kernel_argument(blocks.kernel), incidence(blocks.stencils, blocks.used, vertices), blocks.freeze)
            for blocks in self._terms.kernels
        ]

    def freeze(self) -> tuple[tuple, tuple]:
        """Return inertia and the other terms as `sweep_vertices` takes them in this step."""
        terms, inertia = self._terms, self._terms.inertia
        return (
            (inertia.masses / inertia.dt**2, inertia.x_hat, terms.weights),
            tuple((kernel, (*around, *freeze())) for kernel, around, freeze in self._blocks),
        )

    def init(self, run: SweepRun) -> Stop | None:
        """Begin at the guess."""
        run.swept = run.x.copy()
        run.sweep = with_types_resolved(sweep_vertices, run.swept, self._free, *self.freeze())
        return None


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


def make(*, models: Path, seed: int, iterations: int) -> Simulation:
    """Make a simulation whose every step is `iterations` sweeps of vertex block descent."""
    return Simulation(options={"method": VertexBlockDescent, "max_iterations": iterations})
