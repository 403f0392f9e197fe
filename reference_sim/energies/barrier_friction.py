"""Coulomb friction in the contacts of a barrier, smoothed and lagged to be an energy (Li et al. 2020).

    E = mu sum_k w_k N_k f(|u_k|),   f(y) = y^2/h - y^3/(3 h^2) + h/3  for y < h, else y,   h = speed dt

u_k [m] is the slip over the step between the two closest points of pair k, in the plane across their
distance; points, plane and force w_k N_k [N] are those of the barrier at the start of the step. `speed`
[m/s] is the slip below which friction is still growing: where it holds, cloth creeps at a share of that
speed, on a slope of tan(angle) = r mu at speed (1 - sqrt(1 - r)). A pair that meets within a step has
friction from the next step on. Edges that are nearly parallel have none.

Pairs and derivatives are those of the package ipctk, as in the barrier; there is no definition in torch.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from reference_sim.energies.contact_barrier import ContactBarrier
from reference_sim.energies.energy import Energy, Step, demand_not_negative, demand_positive

if TYPE_CHECKING:
    import scipy.sparse as sp
    from torch import Tensor


class BarrierFriction(Energy):
    """Friction energy [J] of the pairs of a ContactBarrier, which must come before it in a scene's terms.

    Args:
        barrier: the contact term whose pairs and forces are used.
        coefficient: mu [1], of cloth on cloth and on the body.
        speed: [m/s].

    Raises:
        ValueError: a negative coefficient, or a speed that is not above 0.
    """

    name = "friction"
    dynamic = True

    def __init__(self, barrier: ContactBarrier, *, coefficient: float = 0.5, speed: float = 0.02) -> None:
        demand_not_negative("BarrierFriction", coefficient=coefficient)
        demand_positive("BarrierFriction", speed=speed)
        self.cloth, self.barrier = barrier.cloth, barrier
        self.stencils = np.zeros((0, 4), dtype=np.int64)
        self.coefficient, self.speed = float(coefficient), float(speed)
        self._pairs = barrier.collisions.package.TangentialCollisions()

    def parameters(self) -> dict[str, Any]:
        """Return coefficient and speed."""
        return {"coefficient": self.coefficient, "speed_m_per_s": self.speed}

    def energy(self, x: Tensor) -> Tensor:
        """Raise NotImplementedError: the definition is that of ipctk."""
        raise NotImplementedError(
            "BarrierFriction has no definition in torch, its energy is ipctk's: call value_and_gradient(x), "
            "or train with ContactFriction"
        )

    def prepare(self, step: Step) -> None:
        """Pairs, forces and places at the start of the step.

        Raises:
            ValueError: the barrier was not prepared for this step: it must come first among the terms.
        """
        if self.barrier.step is not step:
            raise ValueError("BarrierFriction comes before its ContactBarrier: list the barrier first")
        collisions = self.barrier.collisions
        collisions.place(0.0)
        pairs, self._near, self._start = collisions.pairs(step.previous)
        collisions.place(1.0)
        self._pairs = collisions.package.TangentialCollisions()
        barrier, coefficient = self.barrier.potential, self.coefficient
        self._pairs.build(self._near.mesh, self._start, pairs, barrier, coefficient)
        self._potential = collisions.package.FrictionPotential(self.speed * step.dt)

    def _slip(self, x: np.ndarray) -> np.ndarray:
        collisions = self.barrier.collisions
        return self._near.stack(x, collisions.obstacle_at(collisions.progress)) - self._start

    def value_and_gradient(self, x: np.ndarray) -> tuple[float, np.ndarray]:
        """Return the sum of E [J] and its gradient (V, 3) [N] at x (V, 3) [m]."""
        if not len(self._pairs):
            return 0.0, np.zeros(x.shape)
        slip = self._slip(x)
        gradient = self._potential.gradient(self._pairs, self._near.mesh, slip)
        return self._potential(self._pairs, self._near.mesh, slip), gradient.reshape(-1, 3)[: len(x)]

    def sparse_hessian(self, x: np.ndarray, convexity: float = 0.0) -> sp.csc_matrix:
        """Convex as it is: f' and f'' are not negative."""
        import scipy.sparse as sp

        size = 3 * len(x)
        if not len(self._pairs):
            return sp.csc_matrix((size, size))
        hessian = self._potential.hessian(self._pairs, self._near.mesh, self._slip(x))
        return hessian[:, :size][:size]
