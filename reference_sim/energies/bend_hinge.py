"""Bending as dihedral hinges.

    theta = atan2(e . (n1 x n2) / |e|, n1 . n2)
    E = k/2 s (theta - theta_0)^2

with the edge e = x1 - x0 and the face normals n1 = e x (x2 - x0), n2 = (x3 - x0) x e. By default
s = l^2 / (4 (A1 + A2)) of the rest state. The authors of SNUG have since stated that this is what their code
computes and that the printed form is a typo; their k belongs to it. scaling="none" is s = 1, as the paper
prints it (eq. 11): some three times as stiff.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from ..cloth import Cloth
from ..kernel_cache import njit
from .energy import Energy

if TYPE_CHECKING:
    from torch import Tensor

SCALINGS = ("length_area", "none")
PIECE = 1 << 14  # hinges whose blocks, 1152 bytes each, are in memory at once


class BendHinge(Energy):
    """Hinge bending energy [J] of each inner edge of `cloth`.

    Args:
        cloth: the rest state; its material gives k [J].
        scaling: "length_area" or "none" (as the paper prints it).
        rest_angles: (H,) [rad], "rest" for the angles of rest_positions, or 0 (default: flat).

    Raises:
        ValueError: unknown scaling or wrong number of rest angles.
    """

    name = "bending"

    def __init__(
        self, cloth: Cloth, *, scaling: str = "length_area", rest_angles: np.ndarray | str | float = 0.0
    ) -> None:
        if scaling not in SCALINGS:
            raise ValueError(f"BendHinge scaling {scaling!r}: choose one of {', '.join(SCALINGS)}")
        self.cloth = cloth
        self.stencils = cloth.hinges
        self.scaling = scaling
        scale = cloth.hinge_lengths**2 / (4 * cloth.hinge_areas)
        if scaling == "none":
            scale = np.ones(len(self.stencils))
        self.stiffness = cloth.material.bending_stiffness * scale
        if isinstance(rest_angles, str):
            if rest_angles != "rest":
                raise ValueError(f"BendHinge rest_angles {rest_angles!r}: give an array, a number or 'rest'")
            rest_angles = dihedral_angles(cloth.rest_positions, self.stencils)
        angles = np.broadcast_to(np.asarray(rest_angles, dtype=np.float64), (len(self.stencils),))
        self.rest_angles = np.array(angles)  # its own: a broadcast view is read-only

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
        return self.active_hessian_blocks(x)[1]

    def active_hessian_blocks(self, x: np.ndarray, convexity: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
        """grad theta grad theta^T is never negative; the term with Hess theta is reduced by `convexity`."""
        return self._piece(x, convexity, slice(None))

    def hessian_pieces(
        self, x: np.ndarray, convexity: float = 0.0
    ) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        for start in range(0, len(self.stencils), PIECE):
            yield self._piece(x, convexity, slice(start, start + PIECE))

    def _piece(self, x: np.ndarray, convexity: float, piece: slice) -> tuple[np.ndarray, np.ndarray]:
        hinges = np.arange(len(self.stencils))[piece]
        blocks = np.empty((len(hinges), 12, 12))
        stencils, stiffness, rest = self.stencils[piece], self.stiffness[piece], self.rest_angles[piece]
        _hessian(x, stencils, stiffness, rest, convexity, blocks)
        return hinges, blocks


def _wrap(angle):
    """The same angle in [-pi, pi): a hinge past half a turn is nearer from the other side."""
    import torch

    return torch.remainder(angle + np.pi, 2 * np.pi) - np.pi


@njit(cache=True, inline="always")
def _half(x, i0, i1, i2, m, w):
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
    w[0], w[1], w[2] = length - t, t, -length
    return length, n2


@njit(cache=True, inline="always")
def _angle(x, i0, i1, length, mA, nA2, mB, nB2):
    """Dihedral angle from m = n/|n|^2 of both faces; the second one points the other way."""
    cx = mB[1] * mA[2] - mB[2] * mA[1]
    cy = mB[2] * mA[0] - mB[0] * mA[2]
    cz = mB[0] * mA[1] - mB[1] * mA[0]
    ex, ey, ez = x[i1, 0] - x[i0, 0], x[i1, 1] - x[i0, 1], x[i1, 2] - x[i0, 2]
    scale = nA2 * nB2
    sine = scale * (cx * ex + cy * ey + cz * ez) / length
    return np.arctan2(sine, -scale * (mA[0] * mB[0] + mA[1] * mB[1] + mA[2] * mB[2]))


@njit(cache=True, inline="always")
def _from_rest(theta, rest):
    """theta - theta_0 in [-pi, pi)."""
    theta -= rest
    return theta - 2 * np.pi * np.floor((theta + np.pi) / (2 * np.pi))


@njit(cache=True, error_model="numpy")
def dihedral_angles(x, hinges):
    """(H,) signed dihedral angles [rad] of positions x (V, 3); 0 is flat."""
    mA, mB, w = np.empty(3), np.empty(3), np.empty(3)
    angles = np.empty(hinges.shape[0])
    for h in range(hinges.shape[0]):
        i0, i1, i2, i3 = hinges[h, 0], hinges[h, 1], hinges[h, 2], hinges[h, 3]
        length, nA2 = _half(x, i0, i1, i2, mA, w)
        _, nB2 = _half(x, i0, i1, i3, mB, w)
        angles[h] = _angle(x, i0, i1, length, mA, nA2, mB, nB2)
    return angles


@njit(cache=True, error_model="numpy")
def _gradient(x, hinges, stiffness, rest, gradient):
    mA, mB, wA, wB = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    total = 0.0
    for h in range(hinges.shape[0]):
        i0, i1, i2, i3 = hinges[h, 0], hinges[h, 1], hinges[h, 2], hinges[h, 3]
        length, nA2 = _half(x, i0, i1, i2, mA, wA)
        _, nB2 = _half(x, i0, i1, i3, mB, wB)
        theta = _from_rest(_angle(x, i0, i1, length, mA, nA2, mB, nB2), rest[h])
        total += 0.5 * stiffness[h] * theta * theta
        s = stiffness[h] * theta
        for i in range(3):
            gradient[i0, i] += s * (wA[0] * mA[i] - wB[0] * mB[i])
            gradient[i1, i] += s * (wA[1] * mA[i] - wB[1] * mB[i])
            gradient[i2, i] += s * wA[2] * mA[i]
            gradient[i3, i] -= s * wB[2] * mB[i]
    return total


@njit(cache=True, inline="always")
def _add_half_hessian(x, i0, i1, i2, tip, scale, m, n2, w, length, D, B):
    """Add scale * d(w_a m)/dx_b of one face to the element's matrix B.

    d(w_a m)/dx_b = m dw_a/dx_b^T + w_a (dm/dn) (c_b x .), with dm/dn = (I - 2 n n^T/|n|^2)/|n|^2 and the
    vectors c_b of dn = sum_b c_b x dx_b. D is scratch for dm/dx_b.
    """
    for b in range(3):
        column = 3 * tip if b == 2 else 3 * b
        c = D[3]  # c_b, then the derivatives of the tip's foot t and of the edge's length
        for i in range(3):
            e, r = x[i1, i] - x[i0, i], x[i2, i] - x[i0, i]
            unit = e / length
            along = (r - w[1] * unit) / length
            if b == 1:
                c[i], D[4, i], D[5, i] = -r, along, unit
            elif b == 2:
                c[i], D[4, i], D[5, i] = e, unit, 0.0
            else:
                c[i], D[4, i], D[5, i] = r - e, -along - unit, -unit
        D[0, 0], D[0, 1], D[0, 2] = 0.0, -c[2] / n2, c[1] / n2
        D[1, 0], D[1, 1], D[1, 2] = c[2] / n2, 0.0, -c[0] / n2
        D[2, 0], D[2, 1], D[2, 2] = -c[1] / n2, c[0] / n2, 0.0
        for j in range(3):
            mN = 2.0 * n2 * (m[0] * D[0, j] + m[1] * D[1, j] + m[2] * D[2, j])
            dt, dL = D[4, j], D[5, j]
            for i in range(3):
                dm = scale * (D[i, j] - m[i] * mN)
                sm = scale * m[i]
                B[i, column + j] += sm * (dL - dt) + w[0] * dm
                B[3 + i, column + j] += sm * dt + w[1] * dm
                B[3 * tip + i, column + j] += -sm * dL + w[2] * dm


@njit(cache=True, error_model="numpy")
def _hessian(x, hinges, stiffness, rest, convexity, blocks):
    """k [grad theta grad theta^T + (1 - convexity) (theta - theta_0) Hess theta].

    The two halves of Hess theta are symmetric only in their sum.
    """
    mA, mB, wA, wB = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    g, D = np.empty(12), np.empty((6, 3))
    for h in range(hinges.shape[0]):
        i0, i1, i2, i3 = hinges[h, 0], hinges[h, 1], hinges[h, 2], hinges[h, 3]
        length, nA2 = _half(x, i0, i1, i2, mA, wA)
        _, nB2 = _half(x, i0, i1, i3, mB, wB)
        theta = _from_rest(_angle(x, i0, i1, length, mA, nA2, mB, nB2), rest[h])
        for i in range(3):
            g[i] = wA[0] * mA[i] - wB[0] * mB[i]
            g[3 + i] = wA[1] * mA[i] - wB[1] * mB[i]
            g[6 + i] = wA[2] * mA[i]
            g[9 + i] = -wB[2] * mB[i]
        B = blocks[h]
        for i in range(12):
            for j in range(12):
                B[i, j] = stiffness[h] * g[i] * g[j]
        s = (1.0 - convexity) * stiffness[h] * theta
        _add_half_hessian(x, i0, i1, i2, 2, s, mA, nA2, wA, length, D, B)
        _add_half_hessian(x, i0, i1, i3, 3, -s, mB, nB2, wB, length, D, B)
