"""IPC's barrier: cloth meets neither itself nor a body (Li et al. 2020; in physical units Li et al. 2023).

    E = kappa dhat sum_k w_k m_k b(d_k^2 / dhat^2),   b(s) = -(s - 1)^2 ln s  for s < 1, else 0

over the pairs k of a vertex and a face, or of two edges, that are closer than dhat; d_k is their distance.
w_k [m^2] is a quarter of the rest area of the vertex, or of those of both edges; m_k fades out edges that are
nearly parallel. kappa [Pa] is a pressure: a pair pushes with -2 kappa w_k m_k b'(s) d_k / dhat, which at
half the distance dhat is 4.3 kappa w_k.

Distances, pairs and derivatives are those of the package ipctk (see collisions.py), which *is* the
definition: there is none in torch. Networks are trained with ContactPenalty.

Beyond a touch the energy means nothing: a distance has no sign. Hence `largest_step` bounds every line
search by continuous collision detection, and a step starts without an intersection: `ccd_fraction` and
`set_progress` let the simulator move cloth and body together from the start of the step as far as nothing
meets, minimise there to gain distance, and go on, until the body is where the frame has it.

Without the obstacle the barrier is self-contact alone, beside another term for contact with the body. Where
the body leaves less room than the cloth needs, as between arm and chest, that other term gives way: cloth
goes into the body and never through itself.
"""

from __future__ import annotations

import copy
from typing import TYPE_CHECKING, Any

import numpy as np

from reference_sim.cloth import Cloth
from reference_sim.energies.energy import Energy, Step, demand_positive
from reference_sim.geometry.collisions import NO_OBSTACLE, Collisions

if TYPE_CHECKING:
    import scipy.sparse as sp
    from torch import Tensor

DEFAULT_DISTANCE = 2e-3  # [m]
DEFAULT_STIFFNESS = 1e2  # [Pa]; measured: a tenth of it saves nothing, a hundred times it doubles Newton


class ContactBarrier(Energy):
    """Barrier energy [J] of `cloth` against itself and against the obstacle of a step.

    Args:
        distance: dhat [m], where the barrier begins; must be below every height of a rest triangle.
        stiffness: kappa [Pa].
        self_contact: whether the cloth meets itself.
        obstacle: whether the cloth meets the obstacle; if not, another term keeps it out of the body.

    Raises:
        ImportError: ipctk is not installed.
        ValueError: distance or stiffness not positive, distance above a height of a rest triangle, or nothing
            to meet.
    """

    name = "barrier"
    remembers = impassable = True  # what it remembers is where the obstacle stopped
    dynamic = True

    def __init__(
        self,
        cloth: Cloth,
        *,
        distance: float = DEFAULT_DISTANCE,
        stiffness: float = DEFAULT_STIFFNESS,
        self_contact: bool = True,
        obstacle: bool = True,
    ) -> None:
        demand_positive("ContactBarrier", distance=distance, stiffness=stiffness)
        if not (self_contact or obstacle):
            raise ValueError("ContactBarrier: meets nothing: give self_contact=True or obstacle=True")
        if self_contact:
            _check_heights(cloth, distance)
        self.cloth = cloth
        self.stencils = np.zeros((0, 4), dtype=np.int64)
        self.distance, self.stiffness = float(distance), float(stiffness)
        self.obstacle, self.joins_late = obstacle, not obstacle
        self.collisions = Collisions(cloth, distance, self_contact=self_contact)
        ipctk = self.collisions.package
        self.potential = ipctk.BarrierPotential(self.distance, self.stiffness, use_physical_barrier=True)
        self.step: Step | None = None
        self._hessians_of: tuple | None = None
        self._hessians: dict[str, sp.csc_matrix] = {}

    def __copy__(self) -> ContactBarrier:
        """Return a copy with its own collisions: they hold where the obstacle is in a step."""
        twin = object.__new__(type(self))
        vars(twin).update(vars(self), collisions=copy.copy(self.collisions))
        return twin

    def parameters(self) -> dict[str, Any]:
        """Return distance, stiffness, self-contact and the version of the package."""
        return {
            "distance_m": self.distance,
            "stiffness_Pa": self.stiffness,
            "self_contact": self.collisions.self_contact,
            "obstacle": self.obstacle,
            "package": f"ipctk {self.collisions.package.__version__}",
        }

    def energy(self, x: Tensor) -> Tensor:
        """Raise NotImplementedError: the definition is that of ipctk."""
        raise NotImplementedError(
            "ContactBarrier has no definition in torch, its energy is ipctk's: call value_and_gradient(x), "
            "or train with ContactPenalty"
        )

    def prepare(self, step: Step) -> None:
        """Put the obstacle at its end of the step.

        Its start is where the step before left it, if that was the frame before: an obstacle that found no
        way to its place goes on from where it stopped. A step that is prepared again keeps its start.
        """
        last, self.step = self.step, step
        if step.obstacle is None or not self.obstacle:
            self.collisions.begin(*NO_OBSTACLE)
            return
        after = step.obstacle.at(step.frame)
        before = step.obstacle.at(max(step.frame - 1, 0))
        if last and last.obstacle is step.obstacle:
            if last.frame == step.frame - 1:
                before = self.collisions.obstacle_at(self.collisions.progress)
            elif last.frame == step.frame:
                before = self.collisions.obstacle_at(0.0)
        self.collisions.begin(step.obstacle.faces, before, after)

    def value_and_gradient(self, x: np.ndarray) -> tuple[float, np.ndarray]:
        """Return the sum of E [J] and its gradient (V, 3) [N] at x (V, 3) [m]."""
        if not np.isfinite(x).all():
            return float("nan"), np.full(x.shape, np.nan)
        pairs, near, positions = self.collisions.pairs(x)
        gradient = self.potential.gradient(pairs, near.mesh, positions)
        return self.potential(pairs, near.mesh, positions), gradient.reshape(-1, 3)[: len(x)]

    def sparse_hessian(self, x: np.ndarray, convexity: float = 0.0) -> sp.csc_matrix:
        """Return the second derivatives (3V, 3V) [N/m] at x (V, 3) [m]; see Energy."""
        if convexity == 0:
            return self._hessian(x, "NONE")
        if convexity == 1:
            return self._hessian(x, "CLAMP")
        return (1 - convexity) * self._hessian(x, "NONE") + convexity * self._hessian(x, "CLAMP")

    def _hessian(self, x: np.ndarray, projection: str) -> sp.csc_matrix:
        """Return (3V, 3V), with the negative eigenvalues of each pair or without; kept while x stays."""
        candidates = self.collisions.pairs(x)
        if self._hessians_of is not candidates:
            self._hessians_of, self._hessians = candidates, {}
        if projection not in self._hessians:
            pairs, near, positions = candidates
            method = getattr(self.collisions.package.PSDProjectionMethod, projection)
            hessian, size = self.potential.hessian(pairs, near.mesh, positions, method), 3 * len(x)
            self._hessians[projection] = hessian[:, :size][:size]
        return self._hessians[projection]

    def largest_step(self, x: np.ndarray, direction: np.ndarray) -> float:
        """Return the share of `direction` that may be gone before anything meets; see Energy."""
        return self.collisions.largest_step(x, direction) if np.isfinite(direction).all() else 1.0

    def ccd_fraction(self, x: np.ndarray, goal: np.ndarray, progress: float) -> float:
        """Return the share of the joint way to goal (V, 3) [m] that is free of collisions; see Energy."""
        return self.collisions.ccd_fraction(x, goal, progress)

    def set_progress(self, progress: float) -> None:
        """Put the obstacle at `progress` of its motion in this step."""
        self.collisions.place(progress)

    def infeasibility(self, x: np.ndarray) -> str:
        """Name an edge that cuts a face, as far as the obstacle has come; "" if there is none."""
        return self.collisions.first_intersection(x) if np.isfinite(x).all() else ""


def _check_heights(cloth: Cloth, distance: float) -> None:
    """Raise ValueError where a barrier reaches across a triangle: it would push the resting cloth apart."""
    corners = cloth.rest_corners
    edges = np.linalg.norm(np.roll(corners, 1, axis=1) - corners, axis=2)
    heights = 2 * cloth.areas / edges.max(axis=1)
    face = int(np.argmin(heights))
    if heights[face] <= distance:
        raise ValueError(
            f"ContactBarrier distance = {distance:g} m: face {face} is only {heights[face]:.3g} m high at "
            "rest; choose a distance below that, or a mesh without slivers"
        )
