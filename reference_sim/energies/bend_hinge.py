"""Bending as dihedral hinges.

    theta = atan2(e . (n1 x n2) / |e|, n1 . n2)
    E = k/2 s (theta - theta_0)^2

with the edge e = x1 - x0 and the face normals n1 = e x (x2 - x0), n2 = (x3 - x0) x e. The paper (SNUG,
eq. 11) has s = 1: the plate it stands for then depends on the shape of the triangles. scaling="length_area"
gives s = l^2 / (4 (A1 + A2)), the form that most cloth codes use.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numba import njit

from ..cloth import Cloth
from .energy import Energy

if TYPE_CHECKING:
    from torch import Tensor

SCALINGS = ("none", "length_area")


class BendHinge(Energy):
    """Hinge bending energy [J] of each inner edge of `cloth`.

    Args:
        cloth: the rest state; its material gives k [J].
        scaling: "none" (the paper's) or "length_area".
        rest_angles: (H,) [rad], "rest" for the angles of rest_positions, or 0 (default: flat).

    Raises:
        ValueError: unknown scaling or wrong number of rest angles.
    """

    name = "bending"

    def __init__(
        self, cloth: Cloth, *, scaling: str = "none", rest_angles: np.ndarray | str | float = 0.0
    ) -> None:
        if scaling not in SCALINGS:
            raise ValueError(f"BendHinge scaling {scaling!r}: choose one of {', '.join(SCALINGS)}")
        self.cloth = cloth
        self.stencils = cloth.hinges
        self.scaling = scaling
        scale = np.ones(len(self.stencils))
        if scaling == "length_area":
            scale = cloth.hinge_lengths**2 / (4 * cloth.hinge_areas)
        self.stiffness = cloth.material.bending_stiffness * scale
        if isinstance(rest_angles, str):
            if rest_angles != "rest":
                raise ValueError(f"BendHinge rest_angles {rest_angles!r}: give an array, a number or 'rest'")
            rest_angles = dihedral_angles(cloth.rest_positions, self.stencils)
        angles = np.broadcast_to(np.asarray(rest_angles, dtype=np.float64), (len(self.stencils),))
        self.rest_angles = np.ascontiguousarray(angles)

    def parameters(self) -> dict[str, Any]:
        return {"scaling": self.scaling, "mean_stiffness_J": float(self.stiffness.mean())}

    def element_energy(self, u: Tensor) -> Tensor:
        import torch

        stiffness = torch.as_tensor(self.stiffness).to(u)
        rest = torch.as_tensor(self.rest_angles).to(u)
        e = u[..., 1, :] - u[..., 0, :]
        n1 = torch.linalg.cross(e, u[..., 2, :] - u[..., 0, :])
        n2 = torch.linalg.cross(u[..., 3, :] - u[..., 0, :], e)
        sine = (torch.linalg.cross(n1, n2) * e).sum(-1) / torch.linalg.vector_norm(e, dim=-1)
        theta = torch.atan2(sine, (n1 * n2).sum(-1))
        return 0.5 * stiffness * _wrap(theta - rest) ** 2

    def value_and_gradient(self, x: np.ndarray) -> tuple[float, np.ndarray]:
        gradient = np.zeros_like(x)
        return _gradient(x, self.stencils, self.stiffness, self.rest_angles, gradient), gradient

    def hessian_blocks(self, x: np.ndarray) -> np.ndarray:
        blocks = np.empty((len(self.stencils), 12, 12))
        _hessian(x, self.stencils, self.stiffness, self.rest_angles, blocks)
        return blocks


def _wrap(angle):
    """The same angle in [-pi, pi): a hinge past half a turn is nearer from the other side."""
    import torch

    return torch.remainder(angle + np.pi, 2 * np.pi) - np.pi


@njit(cache=True, inline="always")
def _half(x, i0, i1, i2, m, weights):
    """One face of a hinge: m = n/|n|^2 and the weights w_a with d theta/d x_a = +- w_a m.

    Moving the tip along the normal by h (its height over the edge) turns the face by one radian; the edge's
    ends take the opposite motion in proportion to the barycentric place of the tip's foot.
    """
    ex, ey, ez = x[i1, 0] - x[i0, 0], x[i1, 1] - x[i0, 1], x[i1, 2] - x[i0, 2]
    rx, ry, rz = x[i2, 0] - x[i0, 0], x[i2, 1] - x[i0, 1], x[i2, 2] - x[i0, 2]
    length = np.sqrt(ex * ex + ey * ey + ez * ez)
    nx, ny, nz = ey * rz - ez * ry, ez * rx - ex * rz, ex * ry - ey * rx
    n2 = nx * nx + ny * ny + nz * nz
    m[0], m[1], m[2] = nx / n2, ny / n2, nz / n2
    t = (ex * rx + ey * ry + ez * rz) / length
    weights[0], weights[1], weights[2] = length - t, t, -length
    return length, n2


@njit(cache=True, inline="always")
def _angle(e, length, mA, nA2, mB, nB2):
    """Dihedral angle from the scaled normals m = n/|n|^2; the second one points the other way."""
    nA, nB = mA * nA2, mB * -nB2
    sine = (
        (nA[1] * nB[2] - nA[2] * nB[1]) * e[0]
        + (nA[2] * nB[0] - nA[0] * nB[2]) * e[1]
        + (nA[0] * nB[1] - nA[1] * nB[0]) * e[2]
    ) / length
    return np.arctan2(sine, nA[0] * nB[0] + nA[1] * nB[1] + nA[2] * nB[2])


@njit(cache=True)
def dihedral_angles(x, hinges):
    """(H,) signed dihedral angles [rad] of positions x (V, 3); 0 is flat."""
    mA, mB, w = np.empty(3), np.empty(3), np.empty(3)
    angles = np.empty(hinges.shape[0])
    for h in range(hinges.shape[0]):
        i0, i1, i2, i3 = hinges[h]
        length, nA2 = _half(x, i0, i1, i2, mA, w)
        _, nB2 = _half(x, i0, i1, i3, mB, w)
        angles[h] = _angle(x[i1] - x[i0], length, mA, nA2, mB, nB2)
    return angles


@njit(cache=True)
def _gradient(x, hinges, stiffness, rest, gradient):
    mA, mB, wA, wB = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    total = 0.0
    for h in range(hinges.shape[0]):
        i0, i1, i2, i3 = hinges[h]
        length, nA2 = _half(x, i0, i1, i2, mA, wA)
        _, nB2 = _half(x, i0, i1, i3, mB, wB)
        theta = _angle(x[i1] - x[i0], length, mA, nA2, mB, nB2) - rest[h]
        theta -= 2 * np.pi * np.floor((theta + np.pi) / (2 * np.pi))
        total += 0.5 * stiffness[h] * theta * theta
        s = stiffness[h] * theta
        for i in range(3):
            gradient[i0, i] += s * (wA[0] * mA[i] - wB[0] * mB[i])
            gradient[i1, i] += s * (wA[1] * mA[i] - wB[1] * mB[i])
            gradient[i2, i] += s * wA[2] * mA[i]
            gradient[i3, i] -= s * wB[2] * mB[i]
    return total


@njit(cache=True, inline="always")
def _add_half_hessian(x, i0, i1, i2, tip, sign, m, n2, w, length, H):
    """Add sign * d(w_a m)/dx_b for the three vertices of one face: m dw_a/dx_b^T + w_a (dm/dn) (dn/dx_b)."""
    e, r = np.empty(3), np.empty(3)
    for i in range(3):
        e[i] = x[i1, i] - x[i0, i]
        r[i] = x[i2, i] - x[i0, i]
    dt = np.empty((3, 3))  # derivative of the tip's foot t = r.e/|e| by each vertex
    dL = np.zeros((3, 3))  # derivative of |e|
    N = np.empty((3, 3, 3))  # dn/dx_b as a cross-product matrix of c_b: dn = c_b x dx_b
    for i in range(3):
        unit = e[i] / length
        dt[1, i] = (r[i] - w[1] * unit) / length
        dt[2, i] = unit
        dt[0, i] = -dt[1, i] - dt[2, i]
        dL[1, i], dL[0, i] = unit, -unit
    for b in range(3):
        c0 = -r[0] if b == 1 else (e[0] if b == 2 else r[0] - e[0])
        c1 = -r[1] if b == 1 else (e[1] if b == 2 else r[1] - e[1])
        c2 = -r[2] if b == 1 else (e[2] if b == 2 else r[2] - e[2])
        N[b, 0, 0], N[b, 0, 1], N[b, 0, 2] = 0.0, -c2, c1
        N[b, 1, 0], N[b, 1, 1], N[b, 1, 2] = c2, 0.0, -c0
        N[b, 2, 0], N[b, 2, 1], N[b, 2, 2] = -c1, c0, 0.0
    for b in range(3):
        for j in range(3):
            mN = m[0] * N[b, 0, j] + m[1] * N[b, 1, j] + m[2] * N[b, 2, j]
            dw0, dw1, dw2 = dL[b, j] - dt[b, j], dt[b, j], -dL[b, j]
            column = 3 * (tip if b == 2 else b) + j
            for i in range(3):
                dm = N[b, i, j] / n2 - 2.0 * m[i] * mN
                H[i, column] += sign * (m[i] * dw0 + w[0] * dm)
                H[3 + i, column] += sign * (m[i] * dw1 + w[1] * dm)
                H[3 * tip + i, column] += sign * (m[i] * dw2 + w[2] * dm)


@njit(cache=True)
def _hessian(x, hinges, stiffness, rest, blocks):
    """k [grad theta grad theta^T + (theta - theta_0) Hess theta]."""
    mA, mB, wA, wB = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    g = np.empty(12)
    H = np.empty((12, 12))
    for h in range(hinges.shape[0]):
        i0, i1, i2, i3 = hinges[h]
        length, nA2 = _half(x, i0, i1, i2, mA, wA)
        _, nB2 = _half(x, i0, i1, i3, mB, wB)
        theta = _angle(x[i1] - x[i0], length, mA, nA2, mB, nB2) - rest[h]
        theta -= 2 * np.pi * np.floor((theta + np.pi) / (2 * np.pi))
        for i in range(3):
            g[i] = wA[0] * mA[i] - wB[0] * mB[i]
            g[3 + i] = wA[1] * mA[i] - wB[1] * mB[i]
            g[6 + i] = wA[2] * mA[i]
            g[9 + i] = -wB[2] * mB[i]
        H[:, :] = 0.0
        _add_half_hessian(x, i0, i1, i2, 2, 1.0, mA, nA2, wA, length, H)
        _add_half_hessian(x, i0, i1, i3, 3, -1.0, mB, nB2, wB, length, H)
        for i in range(12):
            for j in range(12):
                blocks[h, i, j] = stiffness[h] * (g[i] * g[j] + theta * 0.5 * (H[i, j] + H[j, i]))
