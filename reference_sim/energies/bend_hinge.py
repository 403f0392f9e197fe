"""Bending as dihedral hinges.

    theta = atan2(e . (n1 x n2) / |e|, n1 . n2)
    E = k/2 s (theta - theta_0)^2

with the edge e = x1 - x0 and the face normals n1 = e x (x2 - x0), n2 = (x3 - x0) x e. By default
s = l^2 / (4 (A1 + A2)) of the rest state, as in the code of SNUG's authors (losses/physics.py), to which
their k belongs; l is the present length there. scaling="none" is s = 1, as the paper prints it (eq. 11):
some three times as stiff.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from reference_sim.cloth import Cloth
from reference_sim.energies.bend_hinge_kernels import batch, constraint, lanes, vertex_block
from reference_sim.energies.energy import Energy
from reference_sim.kernels.kernel_cache import njit
from reference_sim.kernels.lanes import LANES_FLOAT64, add_blocks, arctan2, copy_lanes

if TYPE_CHECKING:
    from torch import Tensor

    from reference_sim.kernels.lanes import BlockPlaces

SCALINGS = ("length_area", "none")
SIGNS = (-1.0, 1.0, 0.0, 0.0)  # r of the corners of a hinge, in _hessian


class BendHinge(Energy):
    """Hinge bending energy [J] of each inner edge of `cloth`, whose material gives k [J].

    scaling: "length_area" or "none" (as the paper prints it). rest_angles: (H,) [rad], "rest" for the
    angles of rest_positions, or one number. Raises ValueError for others.
    """

    name = "bending"
    kernels: ClassVar = {
        "float32_lanes": lanes,
        "vertex_block": vertex_block,
        "constraint": constraint,
        "training_batch": batch,
    }

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
        if isinstance(rest_angles, str) and rest_angles == "rest":
            rest_angles = dihedral_angles(cloth.rest_positions, self.stencils)
        angles = np.broadcast_to(np.asarray(rest_angles, dtype=np.float64), (len(self.stencils),))
        if not np.isfinite(angles).all():
            raise ValueError("BendHinge rest_angles: must be finite numbers [rad]")
        self.rest_angles = np.array(angles)  # its own: a broadcast view is read-only

    def parameters(self) -> dict[str, Any]:
        """Return scaling and mean stiffness [J]."""
        mean = float(self.stiffness.mean()) if len(self.stiffness) else 0.0
        return {"scaling": self.scaling, "mean_stiffness_J": mean}

    def arrays(self) -> dict[str, np.ndarray]:
        """Return vertices (H, 4), stiffness (H,) [J] and rest angles (H,) [rad] of the hinges."""
        return {
            "vertices": self.stencils, "stiffness_J": self.stiffness, "rest_angles_rad": self.rest_angles,
        }  # fmt: skip

    def element_energy(self, u: Tensor) -> Tensor:
        """Return E [J] of each hinge: u (..., N, 4, 3) [m] -> (..., N)."""
        import torch

        stiffness = torch.as_tensor(self.stiffness).to(u)
        rest = torch.as_tensor(self.rest_angles).to(u)
        e = u[..., 1, :] - u[..., 0, :]
        n1 = torch.linalg.cross(e, u[..., 2, :] - u[..., 0, :])
        n2 = torch.linalg.cross(u[..., 3, :] - u[..., 0, :], e)
        sine = (torch.linalg.cross(n1, n2) * e).sum(-1) / torch.linalg.vector_norm(e, dim=-1)
        theta = torch.atan2(sine, (n1 * n2).sum(-1))
        # In [-pi, pi): a hinge past half a turn is nearer from the other side.
        turn = torch.remainder(theta - rest + np.pi, 2 * np.pi) - np.pi
        return 0.5 * stiffness * turn**2

    def value_and_gradient(self, x: np.ndarray) -> tuple[float, np.ndarray]:
        """Return the sum of E [J] and its gradient (V, 3) [N] at x (V, 3) [m]."""
        x = self.check_positions(x)
        gradient = np.zeros_like(x)
        return _gradient(x, self.stencils, self.stiffness, self.rest_angles, gradient), gradient

    def add_hessian(self, x: np.ndarray, convexity: float, places: BlockPlaces, data: np.ndarray) -> None:
        """Add the second derivatives at x (V, 3) [m] to the values `data` of a matrix."""
        _hessian(
            x, self.stencils, self.stiffness, self.rest_angles, convexity, places.slots, places.base,
            places.stride, data,
        )  # fmt: skip


@njit(cache=True, inline="always", error_model="numpy")
def _from_rest(theta, rest):
    """Return theta - theta_0 in [-pi, pi)."""
    theta -= rest
    return theta - 2 * np.pi * np.floor((theta + np.pi) / (2 * np.pi))


def dihedral_angles(x: np.ndarray, hinges: np.ndarray) -> np.ndarray:
    """Return signed dihedral angles (H,) [rad] of positions x (V, 3) [m]; 0 is flat."""
    first, e, r, s = x[hinges.T]
    e, r, s = e - first, r - first, s - first
    a, b = np.cross(e, r), np.cross(s, e)
    sine = (np.cross(a, b) * e).sum(axis=1) / np.sqrt((e * e).sum(axis=1))
    return np.arctan2(sine, (a * b).sum(axis=1))


@njit(cache=True, error_model="numpy")
def _gradient(x, hinges, stiffness, rest, gradient):
    """Add the forces (V, 3) [N] to gradient; returns the energy [J].

    An incomplete group of LANES_FLOAT64 hinges (kernels.lanes) is filled up with the last one.
    """
    L, count, total = LANES_FLOAT64, len(hinges), 0.0
    u = np.empty(14 * L)
    for begin in range(0, count, L):
        for n in range(L):
            h = min(begin + n, count - 1)
            for a in range(4):
                for i in range(3):
                    u[(3 * a + i) * L + n] = x[hinges[h, a], i]
            u[12 * L + n], u[13 * L + n] = stiffness[h], rest[h]
        for n in range(L):
            ex, ey, ez = u[3 * L + n] - u[n], u[4 * L + n] - u[L + n], u[5 * L + n] - u[2 * L + n]
            rx, ry, rz = u[6 * L + n] - u[n], u[7 * L + n] - u[L + n], u[8 * L + n] - u[2 * L + n]
            sx, sy, sz = u[9 * L + n] - u[n], u[10 * L + n] - u[L + n], u[11 * L + n] - u[2 * L + n]
            length = np.sqrt(ex * ex + ey * ey + ez * ez)
            ax, ay, az = ey * rz - ez * ry, ez * rx - ex * rz, ex * ry - ey * rx
            bx, by, bz = sy * ez - sz * ey, sz * ex - sx * ez, sx * ey - sy * ex
            cx, cy, cz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
            sine = (cx * ex + cy * ey + cz * ez) / length
            theta = _from_rest(arctan2(sine, ax * bx + ay * by + az * bz), u[13 * L + n])
            s = u[12 * L + n] * theta
            u[12 * L + n] = 0.5 * s * theta
            # d theta / d x_a = w_a n/|n|^2 of each face, w as in _hessian.
            a, b = s / (ax * ax + ay * ay + az * az), s / (bx * bx + by * by + bz * bz)
            foot_a = (ex * rx + ey * ry + ez * rz) / length
            foot_b = (ex * sx + ey * sy + ez * sz) / length
            a0, b0, a1, b1 = (length - foot_a) * a, (length - foot_b) * b, foot_a * a, foot_b * b
            a2, b2 = -length * a, -length * b
            u[n], u[L + n], u[2 * L + n] = a0 * ax + b0 * bx, a0 * ay + b0 * by, a0 * az + b0 * bz
            u[3 * L + n], u[4 * L + n] = a1 * ax + b1 * bx, a1 * ay + b1 * by
            u[5 * L + n] = a1 * az + b1 * bz
            u[6 * L + n], u[7 * L + n], u[8 * L + n] = a2 * ax, a2 * ay, a2 * az
            u[9 * L + n], u[10 * L + n], u[11 * L + n] = b2 * bx, b2 * by, b2 * bz
        for n in range(min(L, count - begin)):
            total += u[12 * L + n]
            for a in range(4):
                for i in range(3):
                    gradient[hinges[begin + n, a], i] += u[(3 * a + i) * L + n]
    return total


@njit(cache=True, error_model="numpy")
def _hessian(x, hinges, stiffness, rest, convexity, slots, base, stride, data):
    """Add k [grad theta grad theta^T + (1 - convexity) (theta - theta_0) Hess theta] to data.

    With the edge's length L and direction e, the foot t of a face's tip, m = n/|n|^2, p = m x e, the
    weights w = (L - t, t, -L) and signs r = (-1, 1, 0) of the edge's ends and the tip, and c = |n|^2 / (2
    L^2), the face's part of block a, b of Hess theta is +- m y^T + z m^T with

        y = (w_a w_b + r_a r_b c) p - r_a w_b e / L,   z = (w_a w_b + r_a r_b c) p - r_b w_a e / L

    but for antisymmetric parts that cancel between both faces.
    """
    L, count, corners = LANES_FLOAT64, len(hinges), hinges.shape[1]
    u, blocks = np.empty(55 * L), np.empty(90 * L)
    for begin in range(0, count, L):
        for n in range(L):
            h = min(begin + n, count - 1)
            for a in range(4):
                for i in range(3):
                    u[(3 * a + i) * L + n] = x[hinges[h, a], i]
            u[12 * L + n], u[13 * L + n] = stiffness[h], rest[h]
        for n in range(L):
            ex, ey, ez = u[3 * L + n] - u[n], u[4 * L + n] - u[L + n], u[5 * L + n] - u[2 * L + n]
            rx, ry, rz = u[6 * L + n] - u[n], u[7 * L + n] - u[L + n], u[8 * L + n] - u[2 * L + n]
            sx, sy, sz = u[9 * L + n] - u[n], u[10 * L + n] - u[L + n], u[11 * L + n] - u[2 * L + n]
            length = np.sqrt(ex * ex + ey * ey + ez * ez)
            ax, ay, az = ey * rz - ez * ry, ez * rx - ex * rz, ex * ry - ey * rx
            bx, by, bz = ey * sz - ez * sy, ez * sx - ex * sz, ex * sy - ey * sx
            cx, cy, cz = by * az - bz * ay, bz * ax - bx * az, bx * ay - by * ax
            sine = (cx * ex + cy * ey + cz * ez) / length
            theta = _from_rest(arctan2(sine, -(ax * bx + ay * by + az * bz)), u[13 * L + n])
            u[13 * L + n] = (1.0 - convexity) * u[12 * L + n] * theta
            na, nb, square = ax * ax + ay * ay + az * az, bx * bx + by * by + bz * bz, length * length
            ax, ay, az, bx, by, bz = ax / na, ay / na, az / na, bx / nb, by / nb, bz / nb
            a1, b1 = (ex * rx + ey * ry + ez * rz) / length, (ex * sx + ey * sy + ez * sz) / length
            a0, b0 = length - a1, length - b1
            # Gradients of theta; m and w of both faces; e / L; p of both; c of both.
            u[n], u[L + n], u[2 * L + n] = a0 * ax - b0 * bx, a0 * ay - b0 * by, a0 * az - b0 * bz
            u[3 * L + n], u[4 * L + n] = a1 * ax - b1 * bx, a1 * ay - b1 * by
            u[5 * L + n] = a1 * az - b1 * bz
            u[6 * L + n], u[7 * L + n], u[8 * L + n] = -length * ax, -length * ay, -length * az
            u[9 * L + n], u[10 * L + n], u[11 * L + n] = length * bx, length * by, length * bz
            u[14 * L + n], u[15 * L + n], u[16 * L + n] = ax, ay, az
            u[17 * L + n], u[18 * L + n], u[19 * L + n] = bx, by, bz
            u[20 * L + n], u[21 * L + n], u[22 * L + n], u[23 * L + n] = a0, a1, -length, 0.0
            u[24 * L + n], u[25 * L + n], u[26 * L + n], u[27 * L + n] = b0, b1, 0.0, -length
            u[28 * L + n], u[29 * L + n], u[30 * L + n] = ex / square, ey / square, ez / square
            ex, ey, ez = ex / length, ey / length, ez / length
            u[31 * L + n], u[32 * L + n] = ay * ez - az * ey, az * ex - ax * ez
            u[33 * L + n], u[34 * L + n] = ax * ey - ay * ex, by * ez - bz * ey
            u[35 * L + n], u[36 * L + n] = bz * ex - bx * ez, bx * ey - by * ex
            u[37 * L + n], u[38 * L + n] = 0.5 * na / square, 0.5 * nb / square
        for a in range(4):
            for b in range(a + 1):
                _block(u, a, b, blocks)
        for n in range(min(L, count - begin)):
            add_blocks(blocks, n, begin + n, corners, slots, base, stride, data)


@njit(cache=True)
def _block(u, a, b, blocks):
    """Write the blocks of corners a, b of the hinges of u, as _hessian lays it out, into blocks."""
    L, ra, rb = LANES_FLOAT64, SIGNS[a], SIGNS[b]
    # Only loops over rows that the compiler knows become vector instructions.
    for row, source in ((39, 20 + a), (40, 20 + b), (41, 24 + a), (42, 24 + b)):
        copy_lanes(u, source, u, row)
    for i in range(3):
        copy_lanes(u, 3 * b + i, u, 43 + i)
    for n in range(L):
        k, s = u[12 * L + n], u[13 * L + n]
        wa, wb, va, vb = u[39 * L + n], u[40 * L + n], u[41 * L + n], u[42 * L + n]
        ax, ay, az, bx, by, bz = (
            u[14 * L + n], u[15 * L + n], u[16 * L + n], u[17 * L + n], u[18 * L + n], u[19 * L + n]
        )  # fmt: skip
        ex, ey, ez = u[28 * L + n], u[29 * L + n], u[30 * L + n]
        c, d = s * (wa * wb + ra * rb * u[37 * L + n]), -s * (va * vb + ra * rb * u[38 * L + n])
        px, py, pz = c * u[31 * L + n], c * u[32 * L + n], c * u[33 * L + n]
        qx, qy, qz = d * u[34 * L + n], d * u[35 * L + n], d * u[36 * L + n]
        gx, gy, gz = k * u[43 * L + n], k * u[44 * L + n], k * u[45 * L + n]
        f = -s * ra * wb
        yx, yy, yz = px + f * ex + wa * gx, py + f * ey + wa * gy, pz + f * ez + wa * gz
        f = s * ra * vb
        hx, hy, hz = qx + f * ex - va * gx, qy + f * ey - va * gy, qz + f * ez - va * gz
        f = -s * rb * wa
        zx, zy, zz = px + f * ex, py + f * ey, pz + f * ez
        f = s * rb * va
        tx, ty, tz = qx + f * ex, qy + f * ey, qz + f * ez
        u[46 * L + n] = ax * yx + zx * ax + bx * hx + tx * bx
        u[47 * L + n] = ax * yy + zx * ay + bx * hy + tx * by
        u[48 * L + n] = ax * yz + zx * az + bx * hz + tx * bz
        u[49 * L + n] = ay * yx + zy * ax + by * hx + ty * bx
        u[50 * L + n] = ay * yy + zy * ay + by * hy + ty * by
        u[51 * L + n] = ay * yz + zy * az + by * hz + ty * bz
        u[52 * L + n] = az * yx + zz * ax + bz * hx + tz * bx
        u[53 * L + n] = az * yy + zz * ay + bz * hy + tz * by
        u[54 * L + n] = az * yz + zz * az + bz * hz + tz * bz
    place = 9 * (a * (a + 1) // 2 + b)
    for i in range(9):
        copy_lanes(u, 46 + i, blocks, place + i)
