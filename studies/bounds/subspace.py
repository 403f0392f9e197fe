"""Newton's method in an affine subspace: the least energy that a few numbers a frame can express.

    min over q of Phi(x(q)),   x_v(q) = c_v + R_v sum_k U_vk q_k

U is constant. R_v and c_v, turn and place of vertex v, change from step to step, as skinning changes
them. The columns of U are the shape functions of handles, principal components, or the last layer of a
network. In q the gradient is B^T dPhi/dx and the Hessian B^T H B with B_vk = R_v U_vk: a dense one, of as
many rows as there are numbers. All else is `minimise.newton`: the true Hessian, projected element by
element as far as need be, line search, and the test of curvature, here of the subspace, before a result
is "converged".
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.linalg import LinAlgError, cho_factor, cho_solve

from reference_sim.minimise.descent import Descent, Result
from reference_sim.minimise.factorised import FactorisedHessian
from reference_sim.minimise.newton import Newton, NewtonRun
from reference_sim.potential import Potential

SINGULAR = 1e-9  # of the largest singular value: smaller ones are those of columns that others express


@dataclass(frozen=True, eq=False)
class Placement:
    """Place of a subspace in one step."""

    turns: np.ndarray  # R, (V, 3, 3), invertible
    centre: np.ndarray  # c, (V, 3) [m]

    def unposed(self, x: np.ndarray) -> np.ndarray:
        """Return the offsets (V, 3) that the placement takes to x (V, 3) [m]."""
        return np.linalg.solve(self.turns, (x - self.centre)[..., None])[..., 0]

    def posed(self, offsets: np.ndarray) -> np.ndarray:
        """Return x (V, 3) [m] of offsets (V, 3)."""
        return self.centre + np.einsum("vij,vj->vi", self.turns, offsets)


def orthonormal(columns: np.ndarray) -> np.ndarray:
    """Return an orthonormal basis (n, K') of the span of columns (n, K)."""
    left, sizes, _ = np.linalg.svd(columns, full_matrices=False)
    return np.ascontiguousarray(left[:, sizes > SINGULAR * sizes[:1]])


def nearest_offsets(basis: np.ndarray, offsets: np.ndarray) -> np.ndarray:
    """Return the offsets U q (V, 3) nearest to `offsets` (V, 3), for an orthonormal basis U (V, 3, K)."""
    return np.einsum("vik,k->vi", basis, np.einsum("vik,vi->k", basis, offsets))


class SubspaceHessian(FactorisedHessian):
    """Hessian of the subspace: projected, shifted, factorised and solved with, for directions of vertices.

    Attributes:
        basis: B, (3n, K) over the free vertices; set before a minimisation.
    """

    basis: np.ndarray

    def factorise(self, values: np.ndarray, shift: float | np.ndarray) -> bool:
        """Factorise B^T (H + shift M/dt^2) B; False if that is not positive definite."""
        hessian = self._pattern.symmetric(self._shifted(values, shift))
        reduced = self.basis.T @ (hessian @ self.basis)
        try:
            self._factors = cho_factor(reduced, lower=True, overwrite_a=True, check_finite=False)
        except LinAlgError:
            return False
        return bool(np.isfinite(self._factors[0].diagonal()).all())

    def solve(self, b: np.ndarray) -> np.ndarray:
        """Return B (B^T H B)^-1 B^T b, a direction (3n,) within the subspace."""
        return self.basis @ cho_solve(self._factors, self.basis.T @ b, check_finite=False)


class SubspaceRun(NewtonRun):
    """Newton's method whose residual is that of the subspace."""

    hessian: SubspaceHessian

    def gradient_norm(self) -> float:
        """Return the largest component of B^T dPhi/dx over the mean weight of a vertex [1]."""
        return float(np.abs(self.hessian.basis.T @ self.g).max(initial=0.0)) / self.weight


class SubspaceNewton(Newton):
    """Newton's method from step to step in a subspace that follows its placements, one for each step.

    The basis U (V, 3, K) has orthonormal columns, and is zero at pinned vertices. The first step of a run
    starts at offsets (V, 3) in the span. options: of Newton.
    """

    def __init__(
        self,
        potential: Potential,
        *,
        basis: np.ndarray,
        placements: Sequence[Placement],
        offsets: np.ndarray,
        **options: Any,
    ) -> None:
        super().__init__(potential, **{"reuse": True, "start_projected": True} | options)
        self.hessian: SubspaceHessian = SubspaceHessian(potential, tolerance=self.tolerance)
        self._basis, self._placements, self._first_offsets = basis, placements, offsets
        self.start_again()

    def start_again(self) -> None:
        """Go back to the first placement, and to the offsets where its step starts."""
        super().start_again()
        self._steps, self._offsets = iter(self._placements), self._first_offsets

    def minimise(self, x0: np.ndarray, *, after: Descent | None = None) -> Result:
        """Minimise in the next placement, from the last step's offsets; x0 (V, 3) [m] holds the pins."""
        placement = next(self._steps)
        free = self.potential.cloth.free
        posed = np.einsum("vij,vjk->vik", placement.turns, self._basis)[free]
        self.hessian.basis = posed.reshape(-1, posed.shape[-1])
        start = placement.posed(self._offsets)
        start[~free] = x0[~free]
        result = self.descend(SubspaceRun(self, start, after))
        self._offsets = placement.unposed(result.positions)
        return result
