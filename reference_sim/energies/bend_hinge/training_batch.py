"""Hinges of many configurations at once in float32: the kernel of training on a CPU.

See kernels.training_lanes for the layout.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from reference_sim.kernels.kernel_cache import njit
from reference_sim.kernels.training_lanes import GUARDED, TRAINING_LANES, BatchKernel, batch_kernel
from reference_sim.kernels.vector_rows import add_lanes, copy_lanes

if TYPE_CHECKING:
    from reference_sim.energies.bend_hinge.definition import BendHinge

ONE, HALF, PI, TWO_PI = (np.float32(value) for value in (1.0, 0.5, np.pi, 2 * np.pi))
# arctan(t) = t p(t^2) on [0, 1]; a Chebyshev fit, at most 4e-8 off.
P0, P1, P2, P3, P4, P5, P6, P7 = (
    np.float32(value)
    for value in (
        0.999999463558197, -0.3333010673522949, 0.19948509335517883, -0.13915802538394928,
        0.09656256437301636, -0.056063175201416016, 0.021946610882878304, -0.004073309246450663,
    )
)  # fmt: skip


def batch(term: BendHinge) -> BatchKernel:
    """Bind the kernel to the hinges of the term."""
    return batch_kernel(
        _bending, term.stencils, term.stiffness.astype(np.float32), term.rest_angles.astype(np.float32)
    )


@njit(cache=True, inline="always", fastmath=GUARDED, error_model="numpy")
def arctan2(y: np.float32, x: np.float32) -> np.float32:
    """Return the angle in float32, without a branch; (0, 0) gives 0."""
    along, across = abs(x), abs(y)
    t = min(along, across) / (max(along, across) + np.float32(1e-37))
    z = t * t
    a = t * (P0 + z * (P1 + z * (P2 + z * (P3 + z * (P4 + z * (P5 + z * (P6 + z * P7)))))))
    a = HALF * PI - a if across > along else a
    a = PI - a if x < np.float32(0.0) else a
    return -a if y < np.float32(0.0) else a


# The corners of an element are copied into one small array of known size and the result copied back: within
# it the compiler knows that nothing overlaps, which for rows chosen by index it could not know.
@njit(cache=True, fastmath=GUARDED, error_model="numpy")
def _bending(
    x: np.ndarray,
    hinges: np.ndarray,
    stiffness: np.ndarray,
    rest: np.ndarray,
    values: np.ndarray,
    gradients: np.ndarray,
) -> None:
    """Set values [J] and add to gradients [N]; d theta / d x_a = +- w_a n / |n|^2, as in definition."""
    L = TRAINING_LANES
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
                inverse = ONE / length
                ax, ay, az = ey * rz - ez * ry, ez * rx - ex * rz, ex * ry - ey * rx
                bx, by, bz = sy * ez - sz * ey, sz * ex - sx * ez, sx * ey - sy * ex
                cx, cy, cz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
                sine = (cx * ex + cy * ey + cz * ez) * inverse
                theta = arctan2(sine, ax * bx + ay * by + az * bz) - angle
                theta -= TWO_PI * np.floor((theta + PI) / TWO_PI)
                s = k * theta
                energy[n] = HALF * s * theta
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
