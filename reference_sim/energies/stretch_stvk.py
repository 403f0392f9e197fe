"""Membrane strain of a Saint Venant-Kirchhoff sheet.

    F = [x1 - x0, x2 - x0] Dm^-1        (3 x 2)
    G = (F^T F - I) / 2
    E = A (lambda/2 tr(G)^2 + mu tr(G^2))

with the membrane constants lambda, mu in N/m and the rest area A in m^2 (SNUG, eq. 9 and 10, where the
thickness is already inside the printed constants).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..cloth import Cloth
from ..kernel_cache import njit
from .energy import Energy

if TYPE_CHECKING:
    from torch import Tensor


class StretchStVK(Energy):
    """StVK membrane energy [J] of each face of `cloth`."""

    name = "strain"
    constant = (1,)

    def __init__(self, cloth: Cloth) -> None:
        self.cloth = cloth
        self.stencils = cloth.faces
        self.Dm_inverse = cloth.Dm_inverse
        self.areas = cloth.areas
        self.lam = cloth.material.lame_lambda
        self.mu = cloth.material.lame_mu
        self._predicted_stress: np.ndarray | None = None  # (F, 3) stresses S00, S11, S01 [N/m]

    def parameters(self) -> dict[str, Any]:
        return {"lambda_N_per_m": self.lam, "mu_N_per_m": self.mu}

    def element_energy(self, u: Tensor) -> Tensor:
        import torch

        Dm_inverse = torch.as_tensor(self.Dm_inverse).to(u)
        area = torch.as_tensor(self.areas).to(u)
        Ds = torch.stack([u[..., 1, :] - u[..., 0, :], u[..., 2, :] - u[..., 0, :]], dim=-1)
        F = Ds @ Dm_inverse
        G = 0.5 * (F.transpose(-1, -2) @ F - torch.eye(2, dtype=u.dtype, device=u.device))
        trace = G[..., 0, 0] + G[..., 1, 1]
        return area * (0.5 * self.lam * trace**2 + self.mu * (G * G).sum((-1, -2)))

    def value_and_gradient(self, x: np.ndarray) -> tuple[float, np.ndarray]:
        gradient = np.zeros_like(x)
        value = _gradient(x, self.stencils, self.Dm_inverse, self.areas, self.lam, self.mu, gradient)
        return value, gradient

    def hessian_blocks(self, x: np.ndarray) -> np.ndarray:
        return self.active_hessian_blocks(x)[1]

    def active_hessian_blocks(self, x: np.ndarray, convexity: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
        """Negative curvature comes from compressive stress alone, so only that is reduced by `convexity`."""
        blocks = np.empty((len(self.stencils), 9, 9))
        stress = self._predicted_stress
        if stress is None:
            stress = self._stress(x, np.zeros_like(x))
        _hessian(x, self.stencils, self.Dm_inverse, self.areas, self.lam, self.mu, convexity, stress, blocks)
        return np.arange(len(blocks)), blocks

    def predict_stress(self, x: np.ndarray, step: np.ndarray) -> None:
        self._predicted_stress = self._stress(x, step)

    def forget(self) -> None:
        self._predicted_stress = None

    def _stress(self, x: np.ndarray, step: np.ndarray) -> np.ndarray:
        stress = np.empty((len(self.stencils), 3))
        _linear_stress(x, step, self.stencils, self.Dm_inverse, self.lam, self.mu, stress)
        return stress

    def scalar_stiffness(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(mu + lambda/2) times the cotangent Laplacian.

        At rest the Hessian's mean over directions is (lambda + 3 mu)/2 of it in the plane of the cloth and
        lambda/3 + mu of it in space; this lies between the two.
        """
        b = np.concatenate([-self.Dm_inverse.sum(axis=1, keepdims=True), self.Dm_inverse], axis=1)
        scale = (self.mu + 0.5 * self.lam) * self.areas
        return np.arange(len(self.areas)), scale[:, None, None] * (b @ b.transpose(0, 2, 1))


@njit(cache=True, inline="always")
def _deformation(x, face, D, fa, fb):
    """Strain (G00, G11, G01); the columns of F are written into fa and fb."""
    for i in range(3):
        e1 = x[face[1], i] - x[face[0], i]
        e2 = x[face[2], i] - x[face[0], i]
        fa[i] = e1 * D[0, 0] + e2 * D[1, 0]
        fb[i] = e1 * D[0, 1] + e2 * D[1, 1]
    G00 = 0.5 * (fa[0] * fa[0] + fa[1] * fa[1] + fa[2] * fa[2] - 1.0)
    G11 = 0.5 * (fb[0] * fb[0] + fb[1] * fb[1] + fb[2] * fb[2] - 1.0)
    G01 = 0.5 * (fa[0] * fb[0] + fa[1] * fb[1] + fa[2] * fb[2])
    return G00, G11, G01


@njit(cache=True)
def _gradient(x, faces, Dm_inverse, areas, lam, mu, gradient):
    """dE/dx_a = A F S b_a with S = lambda tr(G) I + 2 mu G and b_a the gradient of the hat function."""
    total = 0.0
    fa, fb = np.empty(3), np.empty(3)
    for f in range(faces.shape[0]):
        D = Dm_inverse[f]
        G00, G11, G01 = _deformation(x, faces[f], D, fa, fb)
        trace = G00 + G11
        total += areas[f] * (0.5 * lam * trace * trace + mu * (G00 * G00 + G11 * G11 + 2 * G01 * G01))
        S00, S11, S01 = lam * trace + 2 * mu * G00, lam * trace + 2 * mu * G11, 2 * mu * G01
        for i in range(3):
            P0 = areas[f] * (fa[i] * S00 + fb[i] * S01)
            P1 = areas[f] * (fa[i] * S01 + fb[i] * S11)
            g1 = P0 * D[0, 0] + P1 * D[0, 1]
            g2 = P0 * D[1, 0] + P1 * D[1, 1]
            gradient[faces[f, 1], i] += g1
            gradient[faces[f, 2], i] += g2
            gradient[faces[f, 0], i] -= g1 + g2
    return total


@njit(cache=True, inline="always")
def _less_compressed(S00, S11, S01, keep):
    """The symmetric matrix S with its negative eigenvalues times `keep`."""
    mean, half = 0.5 * (S00 + S11), 0.5 * (S00 - S11)
    radius = np.sqrt(half * half + S01 * S01)
    high, low = mean + radius, mean - radius
    if low >= 0.0:
        return S00, S11, S01
    low *= keep
    if high < 0.0:
        high *= keep
    # S = mean I + radius R with a reflection R; at radius 0 any R will do.
    scale = 0.5 * (high - low) / radius if radius > 0.0 else 0.0
    mean = 0.5 * (high + low)
    return mean + scale * half, mean - scale * half, scale * S01


@njit(cache=True)
def _linear_stress(x, step, faces, Dm_inverse, lam, mu, stress):
    """S00, S11, S01 of S = lambda tr(G) I + 2 mu G with G(x) + sym(F(x)^T dF), linear in the step."""
    fa, fb, da, db = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    for f in range(faces.shape[0]):
        G00, G11, G01 = _deformation(x, faces[f], Dm_inverse[f], fa, fb)
        _deformation(step, faces[f], Dm_inverse[f], da, db)
        for i in range(3):
            G00 += fa[i] * da[i]
            G11 += fb[i] * db[i]
            G01 += 0.5 * (fa[i] * db[i] + fb[i] * da[i])
        trace = lam * (G00 + G11)
        stress[f, 0], stress[f, 1], stress[f, 2] = trace + 2 * mu * G00, trace + 2 * mu * G11, 2 * mu * G01


@njit(cache=True)
def _hessian(x, faces, Dm_inverse, areas, lam, mu, convexity, stress, blocks):
    """K_ac = A [(b_a.S b_c) I + lambda (F b_a)(F b_c)^T + mu ((F b_c)(F b_a)^T + (b_a.b_c) F F^T)]."""
    b = np.empty((3, 2))
    Fb = np.empty((3, 3))
    fa, fb = np.empty(3), np.empty(3)
    for f in range(faces.shape[0]):
        D = Dm_inverse[f]
        _deformation(x, faces[f], D, fa, fb)
        S00, S11, S01 = stress[f, 0], stress[f, 1], stress[f, 2]
        if convexity > 0.0:
            S00, S11, S01 = _less_compressed(S00, S11, S01, 1.0 - convexity)
        for k in range(2):
            b[1, k], b[2, k] = D[0, k], D[1, k]
            b[0, k] = -D[0, k] - D[1, k]
        for a in range(3):
            for i in range(3):
                Fb[a, i] = fa[i] * b[a, 0] + fb[i] * b[a, 1]
        for a in range(3):
            for c in range(a + 1):
                bSb = b[a, 0] * (S00 * b[c, 0] + S01 * b[c, 1]) + b[a, 1] * (S01 * b[c, 0] + S11 * b[c, 1])
                bb = b[a, 0] * b[c, 0] + b[a, 1] * b[c, 1]
                for i in range(3):
                    for j in range(3):
                        value = lam * Fb[a, i] * Fb[c, j] + mu * (
                            Fb[c, i] * Fb[a, j] + bb * (fa[i] * fa[j] + fb[i] * fb[j])
                        )
                        if i == j:
                            value += bSb
                        blocks[f, 3 * a + i, 3 * c + j] = areas[f] * value
                        blocks[f, 3 * c + j, 3 * a + i] = areas[f] * value
