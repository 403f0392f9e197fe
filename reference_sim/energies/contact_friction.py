"""Coulomb friction of contact samples on a moving body, smoothed and lagged so that it is an energy.

    u = (I - n n^T) ((x_s - x_s^t) - (c - c^t))    slip over the step, relative to the skin
    E = mu N f(|u|),   f(y) = y^2/h - y^3/(3 h^2) + h/3 for y < h, else y,   h = speed dt

(IPC's smoothing, Li et al. 2020.) `speed` [m/s] is the slip below which friction is still growing.

N [N] is the normal force of the collision penalty that ended the previous step, on that step's planes. It
comes a step late: a sample that meets the skin within a step has friction from the next one on. In a first
step (frame 1, or 0 of a potential without frames) N is that of the start, on the step's own planes moved
back with the skin. In any other step without the one before, the energy is refused.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from reference_sim.energies.contact_penalty import ContactPenalty
from reference_sim.energies.energy import Energy, Step, demand_positive
from reference_sim.kernels.kernel_cache import njit

if TYPE_CHECKING:
    from torch import Tensor

    from reference_sim.obstacle import Planes


class ContactFriction(Energy):
    """Friction energy [J] of each sample of a ContactPenalty, which must come before it in a scene's terms.

    The coefficient is mu [1]. Raises ValueError for a negative one, or a speed [m/s] not above 0; in
    `prepare`, unless the contact was prepared for the step; in evaluations, unless the step before was.
    """

    name = "friction"
    remembers = True

    def __init__(self, contact: ContactPenalty, *, coefficient: float = 0.5, speed: float = 0.02) -> None:
        demand_positive("ContactFriction", or_zero=True, coefficient=coefficient)
        demand_positive("ContactFriction", speed=speed)
        self.cloth = contact.cloth
        self.contact = contact
        self.stencils, self.weights = contact.stencils, contact.weights
        self.coefficient, self.speed = float(coefficient), float(speed)
        count = len(self.stencils)
        self.forces: np.ndarray | None = np.zeros(count)  # mu N; None where it is not known
        self.anchors = np.zeros((count, 3))  # where each sample would be if it stuck to the skin
        self.normals = np.zeros((count, 3))
        self.threshold = self.speed / 30
        self._last: tuple[Step, Planes] | None = None

    def parameters(self) -> dict[str, Any]:
        """Return coefficient and speed."""
        return {"coefficient": self.coefficient, "speed_m_per_s": self.speed}

    def prepare(self, step: Step) -> None:
        """Freeze planes and normal forces."""
        planes = self.contact.planes
        if self.contact.step is not step or step.obstacle is None or planes is None:
            raise ValueError("ContactFriction needs its own ContactPenalty before it in the terms")
        samples = self.contact.sample_matrix @ step.previous
        corners = step.obstacle.at(max(step.frame - 1, 0))[step.obstacle.faces[planes.faces]]
        skin = np.einsum("sa,sai->si", planes.barycentric, corners)  # where the planes' points were
        last, self._last = self._last, (step, planes)
        if step.frame <= 1:
            self.forces = self._coulomb(samples, skin, planes.normals)
        elif last and last[0].obstacle is step.obstacle and last[0].frame == step.frame - 1:
            self.forces = self._coulomb(samples, last[1].points, last[1].normals)
        elif not (
            last
            and (last[0].obstacle, last[0].frame) == (step.obstacle, step.frame)
            and np.array_equal(last[0].previous, step.previous)
        ):
            # Left over from another run, or a frame that was jumped to; the same step is frozen again at
            # another guess, and the force of the step before stays.
            self.forces = None
        self.anchors, self.normals = samples + planes.points - skin, planes.normals
        self.threshold = self.speed * step.dt

    def _coulomb(self, samples: np.ndarray, points: np.ndarray, normals: np.ndarray) -> np.ndarray:
        """Return mu N (S,) [N] of samples (S, 3) [m] on planes."""
        gap = np.einsum("si,si->s", normals, samples - points)
        depth = np.maximum(self.contact.margin - gap, 0.0)
        power = self.contact.power
        return self.coefficient * power * self.contact.stiffness * depth ** (power - 1)

    def _demand_forces(self) -> np.ndarray:
        if self.forces is None:
            raise ValueError(
                "ContactFriction does not know its normal force: prepare the step of the frame before first"
            )
        return self.forces

    def element_energy(self, u: Tensor) -> Tensor:
        """Return E [J] of each sample: u (..., N, 3, 3) [m] -> (..., N)."""
        import torch

        normals = torch.as_tensor(self.normals).to(u)
        slip = (torch.as_tensor(self.weights).to(u)[:, :, None] * u).sum(-2) - torch.as_tensor(
            self.anchors
        ).to(u)
        slip = slip - (slip * normals).sum(-1, keepdim=True) * normals
        square, h = (slip**2).sum(-1), self.threshold
        y = torch.sqrt(torch.where(square > 0, square, torch.ones_like(square)))
        cubic = square / h - torch.where(square > 0, y**3, torch.zeros_like(y)) / (3 * h * h) + h / 3
        return torch.as_tensor(self._demand_forces()).to(u) * torch.where(square < h * h, cubic, y)

    def value_and_gradient(self, x: np.ndarray) -> tuple[float, np.ndarray]:
        """Return the sum of E [J] and its gradient (V, 3) [N] at x (V, 3) [m]."""
        x = self.check_positions(x)
        gradient = np.zeros_like(x)
        state = (self._demand_forces(), self.anchors, self.normals, self.threshold)
        return _gradient(x, self.stencils, self.weights, *state, gradient), gradient

    def active_hessian_blocks(self, x: np.ndarray, convexity: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the samples (n,) with second derivatives, and these (n, 9, 9) [N/m]; see Energy."""
        forces = self._demand_forces()
        elements = np.flatnonzero(forces)
        state = (forces, self.anchors, self.normals, self.threshold)
        return elements, _hessian(x, elements, self.stencils, self.weights, *state)

    def scalar_stiffness(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the curvature of sticking, 2 mu N / h, in every direction; see Energy."""
        forces = self._demand_forces()
        elements = np.flatnonzero(forces)
        w = self.weights[elements]
        curvature = 2 * forces[elements] / self.threshold
        return elements, curvature[:, None, None] * w[:, :, None] * w[:, None, :]


@njit(cache=True, inline="always")
def _slip(x, stencil, w, anchor, n, u):
    """Write the tangential slip vector into u; returns its length."""
    along = 0.0
    for i in range(3):
        u[i] = w[0] * x[stencil[0], i] + w[1] * x[stencil[1], i] + w[2] * x[stencil[2], i] - anchor[i]
        along += u[i] * n[i]
    square = 0.0
    for i in range(3):
        u[i] -= along * n[i]
        square += u[i] * u[i]
    return np.sqrt(square)


@njit(cache=True)
def _gradient(x, stencils, weights, forces, anchors, normals, h, gradient):
    u = np.empty(3)
    total = 0.0
    for s in range(stencils.shape[0]):
        if forces[s] == 0.0:
            continue
        y = _slip(x, stencils[s], weights[s], anchors[s], normals[s], u)
        if y < h:
            total += forces[s] * (y * y / h - y**3 / (3 * h * h) + h / 3)
            slope = forces[s] * (2 / h - y / (h * h))  # f'(y) / y
        else:
            total += forces[s] * y
            slope = forces[s] / y
        for a in range(3):
            for i in range(3):
                gradient[stencils[s, a], i] += slope * weights[s, a] * u[i]
    return total


@njit(cache=True)
def _hessian(x, elements, stencils, weights, forces, anchors, normals, h):
    """Return w_a w_b mu N [f'/y (I - n n^T) + (f'' - f'/y) t t^T] with the slip direction t."""
    blocks = np.empty((elements.shape[0], 9, 9))
    u, K = np.empty(3), np.empty((3, 3))
    for k in range(elements.shape[0]):
        s = elements[k]
        y = _slip(x, stencils[s], weights[s], anchors[s], normals[s], u)
        over = 2 / h - y / (h * h) if y < h else 1 / y
        second = 2 / h - 2 * y / (h * h) if y < h else 0.0
        for i in range(3):
            for j in range(3):
                K[i, j] = -over * normals[s, i] * normals[s, j]
                if y > 0.0:
                    K[i, j] += (second - over) * (u[i] / y) * (u[j] / y)
            K[i, i] += over
        for a in range(3):
            for b in range(3):
                w = forces[s] * weights[s, a] * weights[s, b]
                for i in range(3):
                    for j in range(3):
                        blocks[k, 3 * a + i, 3 * b + j] = w * K[i, j]
    return blocks
