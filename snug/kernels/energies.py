"""Strain, bending and weight of many configurations at once, in float32: kernels of training on a CPU.

The closed forms are those beside the definitions in `reference_sim.energies`; what differs is the order of
the work. Training evaluates one mesh in some fifty configurations, so each element is worked out for LANES
of them side by side (snug.kernels.lanes): the innermost loop has a fixed length and no branch, and the compiler turns
it into vector instructions. tests/snug/training/test_loss.py holds them to the definitions.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np

from reference_sim.energies import BendHinge, Energy, Gravity, Inertia, StretchStVK
from reference_sim.kernels.kernel_cache import njit
from snug.kernels.lanes import LANES
from snug.kernels.vector_rows import add_lanes, copy_lanes

# No assumption on NaN or infinity: the guard of training must see them.
FAST = {"reassoc", "contract", "arcp", "nsz"}

_ONE, _HALF, _PI, _TWO_PI = (np.float32(value) for value in (1.0, 0.5, np.pi, 2 * np.pi))
# arctan(t) = t p(t^2) on [0, 1]; a Chebyshev fit, at most 4e-8 off.
_P0, _P1, _P2, _P3, _P4, _P5, _P6, _P7 = (
    np.float32(value)
    for value in (
        0.999999463558197, -0.3333010673522949, 0.19948509335517883, -0.13915802538394928,
        0.09656256437301636, -0.056063175201416016, 0.021946610882878304, -0.004073309246450663,
    )
)  # fmt: skip


# x (C, V, 3, LANES) float32 [m], see snug.kernels.lanes -> values (C, LANES) [J]; its second argument is like x,
# and the gradients [N] are added to it.
Kernel = Callable[[np.ndarray, np.ndarray], np.ndarray]


@lru_cache(maxsize=16)
def batched_kernel(energy: Energy) -> Kernel | None:
    """The kernel of this energy; None if it has none."""
    make = KERNELS.get(type(energy))
    return make(energy) if make else None


def _membrane(energy: Any) -> Kernel:
    Dm_inverse = energy.Dm_inverse.reshape(-1, 4).astype(np.float32)
    areas = energy.areas.astype(np.float32)
    lame = (np.float32(energy.lam), np.float32(energy.mu))
    return _runner(_strain, energy.stencils, (Dm_inverse, areas, *lame))


def _hinges(energy: Any) -> Kernel:
    constants = (energy.stiffness.astype(np.float32), energy.rest_angles.astype(np.float32))
    return _runner(_bending, energy.stencils, constants)


def _weight(energy: Any) -> Kernel:
    weights = energy.weights.astype(np.float32)
    zero = np.float32(energy.weights.sum() * energy.origin_height)

    def run(x: np.ndarray, gradients: np.ndarray) -> np.ndarray:
        gradients[:, :, 1] += weights[:, None]
        return weights @ x[:, :, 1] - zero

    return run


def inertia_kernel(energy: Inertia, ahead: np.ndarray, windows: int) -> Kernel:
    """With a = x_t - 2 x_{t-1} + x_{t-2} - ahead_t: E = m / (2 dt^2) |a|^2, zero for the first two frames.

    ahead (C, 3, LANES) [m], of windows that fill whole blocks.
    """
    stiffness = (energy.masses / energy.dt**2).astype(np.float32)[:, None, None]
    one = windows // LANES  # blocks a frame

    def run(x: np.ndarray, gradients: np.ndarray) -> np.ndarray:
        a = x[2 * one :] - x[one:-one]
        a -= x[one:-one]
        a += x[: -2 * one]
        a -= ahead[2 * one :, None]
        force = stiffness * a
        gradients[2 * one :] += force
        a *= force
        values = np.zeros((len(x), LANES), np.float32)
        values[2 * one :] = 0.5 * a.sum((1, 2), dtype=np.float64)
        gradients[: -2 * one] += force
        force += force
        gradients[one:-one] -= force
        return values

    return run


def _runner(kernel: Any, stencils: np.ndarray, constants: tuple[Any, ...]) -> Kernel:
    stencils = stencils.astype(np.uint32)  # for a signed index is first asked whether it counts from the end

    def run(x: np.ndarray, gradients: np.ndarray) -> np.ndarray:
        values = np.empty((len(x), LANES), np.float32)
        kernel(x.ravel(), stencils, *constants, values, gradients.ravel())
        return values

    return run


# Energies that have a kernel here, and what makes it. An energy without one is none the less trained.
KERNELS: dict[type[Energy], Callable[[Any], Kernel]] = {
    StretchStVK: _membrane,
    BendHinge: _hinges,
    Gravity: _weight,
}


@njit(cache=True, inline="always", fastmath=FAST, error_model="numpy")
def _arctan2(y: np.float32, x: np.float32) -> np.float32:
    """In float32, without a branch; (0, 0) gives 0."""
    along, across = abs(x), abs(y)
    t = min(along, across) / (max(along, across) + np.float32(1e-37))
    z = t * t
    a = t * (_P0 + z * (_P1 + z * (_P2 + z * (_P3 + z * (_P4 + z * (_P5 + z * (_P6 + z * _P7)))))))
    a = _HALF * _PI - a if across > along else a
    a = _PI - a if x < np.float32(0.0) else a
    return -a if y < np.float32(0.0) else a


# The corners of an element are copied into one small array of known size and the result copied back: within
# it the compiler knows that nothing overlaps, which for rows chosen by index it could not know.


@njit(cache=True, fastmath=FAST, error_model="numpy")
def _bending(
    x: np.ndarray,
    hinges: np.ndarray,
    stiffness: np.ndarray,
    rest: np.ndarray,
    values: np.ndarray,
    gradients: np.ndarray,
) -> None:
    """theta = atan2(e . (n1 x n2) / |e|, n1 . n2); d theta/d x_a = +- w_a n/|n|^2, see bend_hinge."""
    L = LANES
    u, energy, total = np.empty(12 * L, np.float32), np.empty(L, np.float32), np.empty(L)
    for block in range(len(values)):
        total[:] = 0.0
        first = len(x) // (3 * L * len(values)) * block  # of the block's vertices
        for h in range(len(hinges)):
            k, angle = stiffness[h], rest[h]
            for corner in range(4):
                for axis in range(3):
                    copy_lanes(x, 3 * (first + hinges[h, corner]) + axis, u, 3 * corner + axis)
            for n in range(L):
                ex, ey, ez = u[3 * L + n] - u[n], u[4 * L + n] - u[L + n], u[5 * L + n] - u[2 * L + n]
                rx, ry, rz = u[6 * L + n] - u[n], u[7 * L + n] - u[L + n], u[8 * L + n] - u[2 * L + n]
                sx, sy, sz = u[9 * L + n] - u[n], u[10 * L + n] - u[L + n], u[11 * L + n] - u[2 * L + n]
                length = np.sqrt(ex * ex + ey * ey + ez * ez)
                inverse = _ONE / length
                ax, ay, az = ey * rz - ez * ry, ez * rx - ex * rz, ex * ry - ey * rx
                bx, by, bz = sy * ez - sz * ey, sz * ex - sx * ez, sx * ey - sy * ex
                cx, cy, cz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
                sine = (cx * ex + cy * ey + cz * ez) * inverse
                theta = _arctan2(sine, ax * bx + ay * by + az * bz) - angle
                theta -= _TWO_PI * np.floor((theta + _PI) / _TWO_PI)
                s = k * theta
                energy[n] = _HALF * s * theta
                a, b = s / (ax * ax + ay * ay + az * az), s / (bx * bx + by * by + bz * bz)
                foot_a = (ex * rx + ey * ry + ez * rz) * inverse
                foot_b = (ex * sx + ey * sy + ez * sz) * inverse
                a0, b0 = (length - foot_a) * a, (length - foot_b) * b
                a1, b1, a2, b2 = foot_a * a, foot_b * b, -length * a, -length * b
                u[n], u[L + n], u[2 * L + n] = a0 * ax + b0 * bx, a0 * ay + b0 * by, a0 * az + b0 * bz
                u[3 * L + n], u[4 * L + n] = a1 * ax + b1 * bx, a1 * ay + b1 * by
                u[5 * L + n] = a1 * az + b1 * bz
                u[6 * L + n], u[7 * L + n], u[8 * L + n] = a2 * ax, a2 * ay, a2 * az
                u[9 * L + n], u[10 * L + n], u[11 * L + n] = b2 * bx, b2 * by, b2 * bz
            add_lanes(energy, 0, total, 0)
            for corner in range(4):
                for axis in range(3):
                    add_lanes(u, 3 * corner + axis, gradients, 3 * (first + hinges[h, corner]) + axis)
        values[block] = total


@njit(cache=True, fastmath=FAST, error_model="numpy")
def _strain(
    x: np.ndarray,
    faces: np.ndarray,
    Dm_inverse: np.ndarray,
    areas: np.ndarray,
    lam: np.float32,
    mu: np.float32,
    values: np.ndarray,
    gradients: np.ndarray,
) -> None:
    """E = A (lambda/2 tr(G)^2 + mu tr(G^2)), dE/dx_a = A F S b_a, see stretch_stvk._gradient."""
    L = LANES
    u, energy, total = np.empty(9 * L, np.float32), np.empty(L, np.float32), np.empty(L)
    for block in range(len(values)):
        total[:] = 0.0
        first = len(x) // (3 * L * len(values)) * block  # of the block's vertices
        for f in range(len(faces)):
            d00, d01, d10, d11 = Dm_inverse[f, 0], Dm_inverse[f, 1], Dm_inverse[f, 2], Dm_inverse[f, 3]
            area = areas[f]
            for corner in range(3):
                for axis in range(3):
                    copy_lanes(x, 3 * (first + faces[f, corner]) + axis, u, 3 * corner + axis)
            for n in range(L):
                ax, ay, az = u[3 * L + n] - u[n], u[4 * L + n] - u[L + n], u[5 * L + n] - u[2 * L + n]
                bx, by, bz = u[6 * L + n] - u[n], u[7 * L + n] - u[L + n], u[8 * L + n] - u[2 * L + n]
                px, py, pz = ax * d00 + bx * d10, ay * d00 + by * d10, az * d00 + bz * d10
                qx, qy, qz = ax * d01 + bx * d11, ay * d01 + by * d11, az * d01 + bz * d11
                G00 = _HALF * (px * px + py * py + pz * pz - _ONE)
                G11 = _HALF * (qx * qx + qy * qy + qz * qz - _ONE)
                G01 = _HALF * (px * qx + py * qy + pz * qz)
                trace = G00 + G11
                square = G00 * G00 + G11 * G11 + G01 * G01 + G01 * G01
                energy[n] = area * (_HALF * lam * trace * trace + mu * square)
                m = mu + mu
                S00, S11, S01 = area * (lam * trace + m * G00), area * (lam * trace + m * G11), area * m * G01
                # Columns of P = A F S, then the forces on the second and third corner.
                ux, uy, uz = px * S00 + qx * S01, py * S00 + qy * S01, pz * S00 + qz * S01
                vx, vy, vz = px * S01 + qx * S11, py * S01 + qy * S11, pz * S01 + qz * S11
                ax, ay, az = ux * d00 + vx * d01, uy * d00 + vy * d01, uz * d00 + vz * d01
                bx, by, bz = ux * d10 + vx * d11, uy * d10 + vy * d11, uz * d10 + vz * d11
                u[n], u[L + n], u[2 * L + n] = -ax - bx, -ay - by, -az - bz
                u[3 * L + n], u[4 * L + n], u[5 * L + n] = ax, ay, az
                u[6 * L + n], u[7 * L + n], u[8 * L + n] = bx, by, bz
            add_lanes(energy, 0, total, 0)
            for corner in range(3):
                for axis in range(3):
                    add_lanes(u, 3 * corner + axis, gradients, 3 * (first + faces[f, corner]) + axis)
        values[block] = total
