"""A barrier against triangles that collapse, which StVK alone allows at a finite price.

    q = det(F^T F)                      squared area ratio
    E = -kappa A (q - q0)^2 ln(q / q0)  for q < q0, else 0

The form is IPC's barrier (Li et al. 2020) applied to q. Not part of the paper: a scene declares it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from reference_sim.cloth import Cloth
from reference_sim.energies.energy import Energy, demand_positive
from reference_sim.kernels.kernel_cache import njit

if TYPE_CHECKING:
    from torch import Tensor


class AreaBarrier(Energy):
    """Barrier energy [J] of each face of `cloth`; stiffness kappa [J/m^2], threshold q0 [1] above 0."""

    name = "area_barrier"

    def __init__(self, cloth: Cloth, *, stiffness: float = 100.0, threshold: float = 0.1) -> None:
        demand_positive("AreaBarrier", or_zero=True, stiffness=stiffness)
        demand_positive("AreaBarrier", threshold=threshold)
        self.cloth = cloth
        self.stencils = cloth.faces
        self.Dm_inverse = cloth.Dm_inverse
        self.scales = stiffness * cloth.areas
        self.stiffness, self.threshold = float(stiffness), float(threshold)

    def parameters(self) -> dict[str, Any]:
        """Return stiffness and threshold."""
        return {"stiffness_J_per_m2": self.stiffness, "threshold": self.threshold}

    def element_energy(self, u: Tensor) -> Tensor:
        """Return E [J] of each face: u (..., N, 3, 3) [m] -> (..., N)."""
        import torch

        Ds = torch.stack([u[..., 1, :] - u[..., 0, :], u[..., 2, :] - u[..., 0, :]], dim=-1)
        F = Ds @ torch.as_tensor(self.Dm_inverse).to(u)
        C = F.transpose(-1, -2) @ F
        q = C[..., 0, 0] * C[..., 1, 1] - C[..., 0, 1] ** 2
        inside = torch.clamp(q, max=self.threshold)
        gap = inside - self.threshold
        return -torch.as_tensor(self.scales).to(u) * gap**2 * torch.log(inside / self.threshold)

    def value_and_gradient(self, x: np.ndarray) -> tuple[float, np.ndarray]:
        """Return the sum of E [J] and its gradient (V, 3) [N] at x (V, 3) [m]."""
        gradient = np.zeros_like(x)
        return _gradient(
            x, self.stencils, self.Dm_inverse, self.scales, self.threshold, gradient
        ), gradient

    def active_hessian_blocks(
        self, x: np.ndarray, convexity: float = 0.0
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the blocks, see Energy: E'' grad q grad q^T, and E' Hess q reduced by `convexity`."""
        return _hessian(x, self.stencils, self.Dm_inverse, self.scales, self.threshold, convexity)


@njit(cache=True, inline="always")
def _squared_area_ratio(x, face, D, F, C):
    """Return q; F (3, 2) and C = F^T F, as (C00, C11, C01), are written into."""
    for i in range(3):
        e1 = x[face[1], i] - x[face[0], i]
        e2 = x[face[2], i] - x[face[0], i]
        F[i, 0] = e1 * D[0, 0] + e2 * D[1, 0]
        F[i, 1] = e1 * D[0, 1] + e2 * D[1, 1]
    C[0] = F[0, 0] ** 2 + F[1, 0] ** 2 + F[2, 0] ** 2
    C[1] = F[0, 1] ** 2 + F[1, 1] ** 2 + F[2, 1] ** 2
    C[2] = F[0, 0] * F[0, 1] + F[1, 0] * F[1, 1] + F[2, 0] * F[2, 1]
    return C[0] * C[1] - C[2] * C[2]


@njit(cache=True, error_model="numpy")
def _gradient(x, faces, Dm_inverse, scales, q0, gradient):
    """Add dE/dx_a = 2 E'(q) F adj(C) b_a to gradient; returns the energy [J]."""
    total = 0.0
    F, C = np.empty((3, 2)), np.empty(3)
    for f in range(faces.shape[0]):
        D = Dm_inverse[f]
        q = _squared_area_ratio(x, faces[f], D, F, C)
        if q < q0:
            log = np.log(q / q0)
            total -= scales[f] * (q - q0) ** 2 * log
            slope = -scales[f] * (2 * (q - q0) * log + (q - q0) ** 2 / q)
            for i in range(3):
                P0 = 2 * slope * (F[i, 0] * C[1] - F[i, 1] * C[2])
                P1 = 2 * slope * (F[i, 1] * C[0] - F[i, 0] * C[2])
                g1 = P0 * D[0, 0] + P1 * D[0, 1]
                g2 = P0 * D[1, 0] + P1 * D[1, 1]
                gradient[faces[f, 1], i] += g1
                gradient[faces[f, 2], i] += g2
                gradient[faces[f, 0], i] -= g1 + g2
    return total


@njit(cache=True, error_model="numpy")
def _hessian(x, faces, Dm_inverse, scales, q0, convexity):
    """Return the faces below q0 and E'' grad q grad q^T + E' Hess q of each.

    grad_a q = 2 F adj(C) b_a
    Hess_ac q = 2 [(b_a.adj(C) b_c) I + 2 Fb_a Fb_c^T - Fb_c Fb_a^T - (b_a.b_c) F F^T]
    """
    F, C = np.empty((3, 2)), np.empty(3)
    b, Fb, Gb = np.empty((3, 2)), np.empty((3, 3)), np.empty((3, 3))
    elements = np.empty(faces.shape[0], dtype=np.int64)
    count = 0
    for f in range(faces.shape[0]):
        if _squared_area_ratio(x, faces[f], Dm_inverse[f], F, C) < q0:
            elements[count] = f
            count += 1
    blocks = np.empty((count, 9, 9))
    for n in range(count):
        f = elements[n]
        D = Dm_inverse[f]
        q = _squared_area_ratio(x, faces[f], D, F, C)
        log = np.log(q / q0)
        slope = -(1.0 - convexity) * scales[f] * (2 * (q - q0) * log + (q - q0) ** 2 / q)
        curvature = -scales[f] * (2 * log + 4 * (q - q0) / q - (q - q0) ** 2 / q**2)
        for k in range(2):
            b[1, k], b[2, k] = D[0, k], D[1, k]
            b[0, k] = -D[0, k] - D[1, k]
        for a in range(3):
            for i in range(3):
                Fb[a, i] = F[i, 0] * b[a, 0] + F[i, 1] * b[a, 1]
                Gb[a, i] = F[i, 0] * (C[1] * b[a, 0] - C[2] * b[a, 1])
                Gb[a, i] += F[i, 1] * (C[0] * b[a, 1] - C[2] * b[a, 0])
        for a in range(3):
            for c in range(3):
                bb = b[a, 0] * b[c, 0] + b[a, 1] * b[c, 1]
                bab = b[a, 0] * (C[1] * b[c, 0] - C[2] * b[c, 1])
                bab += b[a, 1] * (C[0] * b[c, 1] - C[2] * b[c, 0])
                for i in range(3):
                    for j in range(3):
                        value = 2 * Fb[a, i] * Fb[c, j] - Fb[c, i] * Fb[a, j]
                        value -= bb * (F[i, 0] * F[j, 0] + F[i, 1] * F[j, 1])
                        if i == j:
                            value += bab
                        value = 2 * slope * value + 4 * curvature * Gb[a, i] * Gb[c, j]
                        blocks[n, 3 * a + i, 3 * c + j] = value
    return elements[:count], blocks
