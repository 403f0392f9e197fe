"""Scalar preconditioner: an n x n matrix that x, y and z share, in place of the Hessian.

Source: Liu, Bouaziz and Kavan 2017.
"""

from __future__ import annotations

import numpy as np

from reference_sim.assembly.cholesky import analyse
from reference_sim.potential import Potential

# In units of M/dt^2 at 30 steps a second. Cloth that nothing holds needs it against its rigid motions alone;
# 1 in its place slows the soft bending modes down ten times.
FLOOR = 1e-4


class ScalarPreconditioner:
    """Scalar stiffness of a potential's terms over the free vertices; one symbolic analysis for all steps."""

    def __init__(self, potential: Potential) -> None:
        free = potential.cloth.free
        self._pattern = potential.pattern(free, block=1)
        self._solver = analyse(self._pattern.indptr, self._pattern.indices, self._pattern.order)
        self._floor = FLOOR * potential.cloth.masses[free] * 30**2

    def assemble(self, x: np.ndarray) -> np.ndarray:
        """Return values (nnz,) [N/m] at x (V, 3) [m]."""
        values = self._pattern.assemble(x)
        values[self._pattern.diagonal] += self._floor
        return values

    def factorise(self, values: np.ndarray) -> bool:
        """Factorise the matrix with these values (nnz,); False if it is not positive definite."""
        return self._solver.factorise(values)

    def solve(self, b: np.ndarray) -> np.ndarray:
        """Solve with the last factorisation: b (3n,)."""
        return self._solver.solve(b.reshape(-1, 3)).ravel()
