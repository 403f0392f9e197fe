"""Membrane strain of a Saint Venant-Kirchhoff sheet.

    F = [x1 - x0, x2 - x0] Dm^-1        (3 x 2)
    G = (F^T F - I) / 2
    E = A (lambda/2 tr(G)^2 + mu tr(G^2))

with the membrane constants lambda, mu in N/m and the rest area A in m^2 (SNUG, eq. 9 and 10, where the
thickness is already inside the printed constants).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from reference_sim.cloth import Cloth
from reference_sim.energies.energy import Energy
from reference_sim.energies.stretch_stvk_kernels import batch, constraint, lanes, strain, vertex_block
from reference_sim.kernels.kernel_cache import njit
from reference_sim.kernels.lanes import LANES_FLOAT64, add_blocks, copy_lanes

if TYPE_CHECKING:
    from torch import Tensor

    from reference_sim.kernels.lanes import BlockPlaces


class StretchStVK(Energy):
    """StVK membrane energy [J] of each face of `cloth`."""

    name = "strain"
    constant = (1,)
    kernels: ClassVar = {
        "float32_lanes": lanes,
        "vertex_block": vertex_block,
        "constraint": constraint,
        "training_batch": batch,
    }

    def __init__(self, cloth: Cloth) -> None:
        self.cloth = cloth
        self.stencils = cloth.faces
        self.Dm_inverse = cloth.Dm_inverse
        self.areas = cloth.areas
        self.lam = cloth.material.lame_lambda
        self.mu = cloth.material.lame_mu
        self._predicted_stress: np.ndarray | None = None  # (F, 3) stresses S00, S11, S01 [N/m]

    def parameters(self) -> dict[str, Any]:
        """Return lambda and mu [N/m]."""
        return {"lambda_N_per_m": self.lam, "mu_N_per_m": self.mu}

    def arrays(self) -> dict[str, np.ndarray]:
        """Return of each face: vertices (F, 3), inverse rest shape (F, 2, 2) [1/m], rest area (F,) [m^2]."""
        return {"vertices": self.stencils, "Dm_inverse_per_m": self.Dm_inverse, "areas_m2": self.areas}

    def element_energy(self, u: Tensor) -> Tensor:
        """Return E [J] of each face: u (..., N, 3, 3) [m] -> (..., N)."""
        import torch

        Dm_inverse = torch.as_tensor(self.Dm_inverse).to(u)
        area = torch.as_tensor(self.areas).to(u)
        first, second = u[..., 1, :] - u[..., 0, :], u[..., 2, :] - u[..., 0, :]
        # Entry by entry: hundreds of thousands of small matrix products take a GPU ten times as long.
        # The columns of F.
        along, across = (
            first * Dm_inverse[..., 0, column, None] + second * Dm_inverse[..., 1, column, None]
            for column in range(2)
        )
        G00, G11 = 0.5 * ((along * along).sum(-1) - 1), 0.5 * ((across * across).sum(-1) - 1)
        G01 = 0.5 * (along * across).sum(-1)
        trace_of_square = G00**2 + G11**2 + 2 * G01**2
        return area * (0.5 * self.lam * (G00 + G11) ** 2 + self.mu * trace_of_square)

    def value_and_gradient(self, x: np.ndarray) -> tuple[float, np.ndarray]:
        """Return the sum of E [J] and its gradient (V, 3) [N] at x (V, 3) [m]."""
        x = self.check_positions(x)
        gradient = np.zeros_like(x)
        value = _gradient(x, self.stencils, self.Dm_inverse, self.areas, self.lam, self.mu, gradient)
        return value, gradient

    def add_hessian(self, x: np.ndarray, convexity: float, places: BlockPlaces, data: np.ndarray) -> None:
        """Add the second derivatives at x (V, 3) [m] to the values `data` of a matrix.

        Compressive stress alone is negative, and reduced by `convexity`.
        """
        stress = self._predicted_stress
        if stress is None:
            stress = self._stress(x, np.zeros_like(x))
        if convexity > 0:
            stress = _reduce_compression(stress, 1 - convexity)
        _hessian(
            x, self.stencils, self.Dm_inverse, self.areas, self.lam, self.mu, stress, places.slots,
            places.base, places.stride, data,
        )  # fmt: skip

    def predict_stress(self, x: np.ndarray, step: np.ndarray) -> None:
        """Let the Hessian take the stress that linear strain predicts at x + step; see Energy."""
        self._predicted_stress = self._stress(x, step)

    def forget(self) -> None:
        """Let the Hessian take the stress at x again."""
        self._predicted_stress = None

    def _stress(self, x: np.ndarray, step: np.ndarray) -> np.ndarray:
        stress = np.empty((len(self.stencils), 3))
        _linear_stress(x, step, self.stencils, self.Dm_inverse, self.lam, self.mu, stress)
        return stress

    def scalar_stiffness(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return (mu + lambda/2) times the cotangent Laplacian.

        This lies between the rest Hessian's mean over directions in the plane of the cloth and in space.
        """
        b = np.concatenate([-self.Dm_inverse.sum(axis=1, keepdims=True), self.Dm_inverse], axis=1)
        scale = (self.mu + 0.5 * self.lam) * self.areas
        return np.arange(len(self.areas)), scale[:, None, None] * (b @ b.transpose(0, 2, 1))


@njit(cache=True, error_model="numpy")
def _gradient(x, faces, Dm_inverse, areas, lam, mu, gradient):
    """Add dE/dx_a = A F S b_a to gradient; returns the energy [J].

    S = lambda tr(G) I + 2 mu G, and b_a is the gradient of the hat function. An incomplete group of
    LANES_FLOAT64 faces side by side (kernels.lanes) is filled up with the last one.
    """
    L, count, total = LANES_FLOAT64, len(faces), 0.0
    u = np.empty(14 * L)
    for begin in range(0, count, L):
        for n in range(L):
            f = min(begin + n, count - 1)
            for a in range(3):
                for i in range(3):
                    u[(3 * a + i) * L + n] = x[faces[f, a], i]
            for i in range(2):
                for j in range(2):
                    u[(9 + 2 * i + j) * L + n] = Dm_inverse[f, i, j]
            u[13 * L + n] = areas[f]
        for n in range(L):
            ax, ay, az = u[3 * L + n] - u[n], u[4 * L + n] - u[L + n], u[5 * L + n] - u[2 * L + n]
            bx, by, bz = u[6 * L + n] - u[n], u[7 * L + n] - u[L + n], u[8 * L + n] - u[2 * L + n]
            d00, d01, d10, d11 = u[9 * L + n], u[10 * L + n], u[11 * L + n], u[12 * L + n]
            area = u[13 * L + n]
            px, py, pz = ax * d00 + bx * d10, ay * d00 + by * d10, az * d00 + bz * d10
            qx, qy, qz = ax * d01 + bx * d11, ay * d01 + by * d11, az * d01 + bz * d11
            G00 = 0.5 * (px * px + py * py + pz * pz - 1.0)
            G11 = 0.5 * (qx * qx + qy * qy + qz * qz - 1.0)
            G01 = 0.5 * (px * qx + py * qy + pz * qz)
            trace = G00 + G11
            square = G00 * G00 + G11 * G11 + 2 * G01 * G01
            u[13 * L + n] = area * (0.5 * lam * trace * trace + mu * square)
            S00, S11 = area * (lam * trace + 2 * mu * G00), area * (lam * trace + 2 * mu * G11)
            S01 = area * (2 * mu * G01)
            ux, uy, uz = px * S00 + qx * S01, py * S00 + qy * S01, pz * S00 + qz * S01
            vx, vy, vz = px * S01 + qx * S11, py * S01 + qy * S11, pz * S01 + qz * S11
            ax, ay, az = ux * d00 + vx * d01, uy * d00 + vy * d01, uz * d00 + vz * d01
            bx, by, bz = ux * d10 + vx * d11, uy * d10 + vy * d11, uz * d10 + vz * d11
            u[n], u[L + n], u[2 * L + n] = -ax - bx, -ay - by, -az - bz
            u[3 * L + n], u[4 * L + n], u[5 * L + n] = ax, ay, az
            u[6 * L + n], u[7 * L + n], u[8 * L + n] = bx, by, bz
        for n in range(min(L, count - begin)):
            total += u[13 * L + n]
            for a in range(3):
                for i in range(3):
                    gradient[faces[begin + n, a], i] += u[(3 * a + i) * L + n]
    return total


@njit(cache=True)
def _reduce_compression(stress, keep):
    """Multiply the negative eigenvalues of stresses S00, S11, S01 (F, 3) by `keep`."""
    reduced = stress.copy()
    for f in range(len(stress)):
        mean, half = 0.5 * (stress[f, 0] + stress[f, 1]), 0.5 * (stress[f, 0] - stress[f, 1])
        radius = np.sqrt(half * half + stress[f, 2] * stress[f, 2])
        high, low = mean + radius, mean - radius
        if low >= 0.0:
            continue
        low *= keep
        if high < 0.0:
            high *= keep
        # S = mean I + radius R with a reflection R; at radius 0 any R will do.
        scale = 0.5 * (high - low) / radius if radius > 0.0 else 0.0
        mean = 0.5 * (high + low)
        reduced[f, 0], reduced[f, 1] = mean + scale * half, mean - scale * half
        reduced[f, 2] = scale * stress[f, 2]
    return reduced


@njit(cache=True)
def _linear_stress(x, step, faces, Dm_inverse, lam, mu, stress):
    """Write S00, S11, S01 into stress (F, 3), linear in the step.

    S = lambda tr(G) I + 2 mu G with G(x) + sym(F(x)^T dF) in place of G.
    """
    fa, fb, da, db = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    for f in range(faces.shape[0]):
        G00, G11, G01 = strain(x, faces[f], Dm_inverse[f], fa, fb)
        strain(step, faces[f], Dm_inverse[f], da, db)
        for i in range(3):
            G00 += fa[i] * da[i]
            G11 += fb[i] * db[i]
            G01 += 0.5 * (fa[i] * db[i] + fb[i] * da[i])
        trace = lam * (G00 + G11)
        stress[f, 0] = trace + 2 * mu * G00
        stress[f, 1] = trace + 2 * mu * G11
        stress[f, 2] = 2 * mu * G01


@njit(cache=True, error_model="numpy")
def _hessian(x, faces, Dm_inverse, areas, lam, mu, stress, slots, base, stride, data):
    """Add A [(b_a.S b_c) I + lambda (F b_a)(F b_c)^T + mu ((F b_c)(F b_a)^T + (b_a.b_c) F F^T)]."""
    L, count, corners = LANES_FLOAT64, len(faces), faces.shape[1]
    u, blocks = np.empty(48 * L), np.empty(54 * L)
    for begin in range(0, count, L):
        for n in range(L):
            f = min(begin + n, count - 1)
            for a in range(3):
                for i in range(3):
                    u[(3 * a + i) * L + n] = x[faces[f, a], i]
                u[(13 + a) * L + n] = areas[f] * stress[f, a]
            for i in range(2):
                for j in range(2):
                    u[(9 + 2 * i + j) * L + n] = Dm_inverse[f, i, j]
            u[16 * L + n] = areas[f]
        for n in range(L):
            ax, ay, az = u[3 * L + n] - u[n], u[4 * L + n] - u[L + n], u[5 * L + n] - u[2 * L + n]
            bx, by, bz = u[6 * L + n] - u[n], u[7 * L + n] - u[L + n], u[8 * L + n] - u[2 * L + n]
            d00, d01, d10, d11 = u[9 * L + n], u[10 * L + n], u[11 * L + n], u[12 * L + n]
            px, py, pz = ax * d00 + bx * d10, ay * d00 + by * d10, az * d00 + bz * d10
            qx, qy, qz = ax * d01 + bx * d11, ay * d01 + by * d11, az * d01 + bz * d11
            # F b_a; b_a; F F^T, of which the six entries on and below the diagonal.
            e0, e1 = -d00 - d10, -d01 - d11
            u[n], u[L + n], u[2 * L + n] = px * e0 + qx * e1, py * e0 + qy * e1, pz * e0 + qz * e1
            u[3 * L + n], u[4 * L + n] = px * d00 + qx * d01, py * d00 + qy * d01
            u[5 * L + n], u[6 * L + n] = pz * d00 + qz * d01, px * d10 + qx * d11
            u[7 * L + n], u[8 * L + n] = py * d10 + qy * d11, pz * d10 + qz * d11
            u[17 * L + n], u[18 * L + n] = e0, e1
            u[19 * L + n], u[20 * L + n], u[21 * L + n], u[22 * L + n] = d00, d01, d10, d11
            u[23 * L + n], u[24 * L + n] = px * px + qx * qx, py * px + qy * qx
            u[25 * L + n], u[26 * L + n] = py * py + qy * qy, pz * px + qz * qx
            u[27 * L + n], u[28 * L + n] = pz * py + qz * qy, pz * pz + qz * qz
        for a in range(3):
            for c in range(a + 1):
                _block(u, a, c, lam, mu, blocks)
        for n in range(min(L, count - begin)):
            add_blocks(blocks, n, begin + n, corners, slots, base, stride, data)


@njit(cache=True)
def _block(u, a, c, lam, mu, blocks):
    """Write the blocks of corners a, c of the faces of u, as _hessian lays it out, into blocks."""
    # Only loops over rows that the compiler knows become vector instructions.
    L = LANES_FLOAT64
    for i in range(3):
        copy_lanes(u, 3 * a + i, u, 29 + i)
        copy_lanes(u, 3 * c + i, u, 32 + i)
    for i in range(2):
        copy_lanes(u, 17 + 2 * a + i, u, 35 + i)
        copy_lanes(u, 17 + 2 * c + i, u, 37 + i)
    for n in range(L):
        ax, ay, az = u[29 * L + n], u[30 * L + n], u[31 * L + n]
        cx, cy, cz = u[32 * L + n], u[33 * L + n], u[34 * L + n]
        a0, a1, c0, c1 = u[35 * L + n], u[36 * L + n], u[37 * L + n], u[38 * L + n]
        s00, s11, s01, area = u[13 * L + n], u[14 * L + n], u[15 * L + n], u[16 * L + n]
        s = a0 * (s00 * c0 + s01 * c1) + a1 * (s01 * c0 + s11 * c1)
        k, m = lam * area, mu * area
        b = m * (a0 * c0 + a1 * c1)
        u[39 * L + n] = (k + m) * (ax * cx) + b * u[23 * L + n] + s
        u[40 * L + n] = k * (ax * cy) + m * (cx * ay) + b * u[24 * L + n]
        u[41 * L + n] = k * (ax * cz) + m * (cx * az) + b * u[26 * L + n]
        u[42 * L + n] = k * (ay * cx) + m * (cy * ax) + b * u[24 * L + n]
        u[43 * L + n] = (k + m) * (ay * cy) + b * u[25 * L + n] + s
        u[44 * L + n] = k * (ay * cz) + m * (cy * az) + b * u[27 * L + n]
        u[45 * L + n] = k * (az * cx) + m * (cz * ax) + b * u[26 * L + n]
        u[46 * L + n] = k * (az * cy) + m * (cz * ay) + b * u[27 * L + n]
        u[47 * L + n] = (k + m) * (az * cz) + b * u[28 * L + n] + s
    place = 9 * (a * (a + 1) // 2 + c)
    for i in range(9):
        copy_lanes(u, 39 + i, blocks, place + i)
