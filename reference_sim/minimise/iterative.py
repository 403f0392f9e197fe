"""Hessian of a mesh too large to factorise it: solved with by preconditioned conjugate gradients.

The preconditioner P^-1 = S^-1 + N (N^T H N)^-1 N^T needs two factorisations of n x n matrices. The scalar S
of L-BFGS takes cloth to be as stiff along its normals, the columns of N, as in its plane, though only bending
resists there. So the normals get the true Hessian among themselves. Cloth that hangs then needs a tenth of
the steps, crumpled cloth up to as many.

How exactly a system is solved follows from the size of its right-hand side (Nocedal and Wright 2006,
algorithm 7.1). A direction of negative curvature ends a solve, and the solution until then goes down all
the same. That there is none, nothing proves but a factorisation: Lanczos' method from a random start, which
finds the ends of the spectrum first, estimates the lowest curvature.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import eigh_tridiagonal

from reference_sim.assembly.cholesky import analyse
from reference_sim.geometry.surface import vertex_normals
from reference_sim.minimise.descent import mean_weight
from reference_sim.minimise.factorised import FactorisedHessian
from reference_sim.minimise.lbfgs_history import dot
from reference_sim.minimise.scalar_preconditioner import ScalarPreconditioner
from reference_sim.potential import Potential

LARGEST_FACTORISED = 200_000  # unknowns: from about here on a factorisation takes more than 2 s
LARGEST_RESIDUAL = 0.03  # of a solve, as a share of its right-hand side
MAX_PRODUCTS = 1000  # of the matrix and a vector, in one solve
LOOK_AFTER = 20  # steps of Lanczos' method until the lowest eigenvalue is looked at again
SETTLED = 0.1  # of the lowest eigenvalue found: how near to it the matrix has one
EXHAUSTED = 1e-12  # residual below which the steps have seen all that the start contains


class IterativeHessian(FactorisedHessian):
    """FactorisedHessian whose preconditioner alone is factorised: a solve may meet negative curvature."""

    def __init__(self, potential: Potential, *, tolerance: float) -> None:
        self._scalar = ScalarPreconditioner(potential)
        self._weight, self._faces = mean_weight(potential), potential.cloth.faces
        super().__init__(potential, tolerance=tolerance)

    def _analyse(self) -> None:
        indptr, rows, order = self._pattern.graph
        self._first, self._along_normals = indptr[:-1], analyse(indptr, rows, order)

    def assemble(self, x: np.ndarray, convexity: float) -> np.ndarray:
        """Return values (nnz,) at x (V, 3), and keep the preconditioner's scalar and normals there."""
        self._scalar_data = self._scalar.assemble(x)
        self._normals = vertex_normals(x, self._faces)[self._pattern.free]
        return super().assemble(x, convexity)

    def factorise(self, data: np.ndarray, shift: float | np.ndarray) -> bool:
        """Keep the values plus shift M/dt^2; False if among normals that is not positive definite."""
        self._data, self._shift, self.downward = data, shift * self.metric, None
        along = self._pattern.along(data, self._normals)
        # A vertex without a normal, as between folded faces, takes no part.
        none = 1.0 - np.einsum("vi,vi->v", self._normals, self._normals)
        along[self._first] += self._shift[::3] + none
        scalar = self._scalar.factorise(self._scalar_data, self._shift[::3])
        return scalar and self._along_normals.factorise(along)

    def solve(self, b: np.ndarray) -> np.ndarray:
        """Solve with the values kept last, b (3n,), until negative curvature is met: see `downward`."""
        residual = min(LARGEST_RESIDUAL, float(np.sqrt(np.abs(b).max(initial=0.0) / self._weight)))
        run = ConjugateGradients(self, b)
        while run.residual > residual and len(run.lengths) < MAX_PRODUCTS and run.step():
            pass
        self.downward = run.downward
        return run.x

    def look_for_negative_curvature(self) -> None:
        """Run Lanczos' method from a random start until its lowest eigenvalue has settled or is negative."""
        run = ConjugateGradients(self, np.random.default_rng(0).standard_normal(len(self.metric)))
        lowest, error = 0.0, np.inf
        while error > SETTLED * lowest and len(run.lengths) < MAX_PRODUCTS and run.step():
            if len(run.lengths) % LOOK_AFTER == 0 or run.residual < EXHAUSTED:
                lowest, error = run.lowest_eigenvalue()
        self.downward = run.downward
        self.settled = error <= SETTLED * lowest
        word = "unproved" if self.settled else "unsettled"
        self.evidence = f", lowest curvature {lowest:.1e} of the preconditioner's by Lanczos' method, {word}"

    def product(self, p: np.ndarray) -> np.ndarray:
        """Return the kept matrix times p (3n,)."""
        return self._pattern.product(self._data, p) + self._shift * p

    def precondition(self, r: np.ndarray) -> np.ndarray:
        """Return P^-1 r (3n,)."""
        along = self._along_normals.solve(np.einsum("vi,vi->v", self._normals, r.reshape(-1, 3)))
        return self._scalar.solve(r) + (along[:, None] * self._normals).ravel()


class ConjugateGradients:
    """Solution of H x = b from x = 0, a step at a time; its numbers are those of Lanczos' method for P^-1 H.

    Attributes:
        x: (3n,) the solution so far; P^-1 b where the curvature along that is not positive.
        downward: (3n,) direction along which the curvature is not positive, once one was met.
        residual: its norm in P^-1 as a share of that of b.
        lengths, ratios: of each step its length along p, and the residual's square over that before.
    """

    def __init__(self, hessian: IterativeHessian, b: np.ndarray) -> None:
        self._hessian = hessian
        self.x, self._r = np.zeros_like(b), b
        self._p = hessian.precondition(b)
        self._square = self._first = dot(b, self._p)
        self.residual = 1.0 if self._first > 0 else 0.0
        self.downward: np.ndarray | None = None
        self.lengths: list[float] = []
        self.ratios: list[float] = []

    def step(self) -> bool:
        """Go along p; return False if the curvature there is not positive."""
        product = self._hessian.product(self._p)
        curvature = dot(self._p, product)
        if not curvature > 0:
            self.downward = self._p
            self.x = self.x if self.lengths else self._p
            return False
        length = self._square / curvature
        self.x += length * self._p
        self._r = self._r - length * product
        z = self._hessian.precondition(self._r)
        before, self._square = self._square, dot(self._r, z)
        self.lengths.append(length)
        self.ratios.append(self._square / before)
        self.residual = float(np.sqrt(max(self._square, 0.0) / self._first))
        self._p = z + self.ratios[-1] * self._p
        return True

    def lowest_eigenvalue(self) -> tuple[float, float]:
        """Return the lowest Ritz value of P^-1 H, and how far from it there is an eigenvalue at most.

        Source: Saad 2003, section 6.7.3: the tridiagonal matrix of Lanczos' method from the numbers of the
        steps.
        """
        inverse, ratios = 1.0 / np.array(self.lengths), np.array(self.ratios)
        diagonal = inverse + np.append(0.0, ratios[:-1] * inverse[:-1])
        beside = np.sqrt(ratios) * inverse
        values, vectors = eigh_tridiagonal(diagonal, beside[:-1], select="i", select_range=(0, 0))
        return float(values[0]), float(abs(beside[-1] * vectors[-1, 0]))
