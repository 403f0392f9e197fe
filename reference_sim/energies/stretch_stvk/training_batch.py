"""StVK of many configurations at once in float32: the kernel of training on a CPU.

See kernels.training_lanes for the layout.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from reference_sim.kernels.kernel_cache import njit
from reference_sim.kernels.training_lanes import GUARDED, TRAINING_LANES, BatchKernel, batch_kernel
from reference_sim.kernels.vector_rows import add_lanes, copy_lanes

if TYPE_CHECKING:
    from reference_sim.energies.stretch_stvk.definition import StretchStVK

ONE, HALF = np.float32(1.0), np.float32(0.5)


def batch(term: StretchStVK) -> BatchKernel:
    """Bind the kernel to the faces of the term."""
    Dm_inverse = term.Dm_inverse.reshape(-1, 4).astype(np.float32)
    areas = term.areas.astype(np.float32)
    return batch_kernel(_strain, term.stencils, Dm_inverse, areas, np.float32(term.lam), np.float32(term.mu))


# The corners of an element are copied into one small array of known size and the result copied back: within
# it the compiler knows that nothing overlaps, which for rows chosen by index it could not know.
@njit(cache=True, fastmath=GUARDED, error_model="numpy")
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
    """Set values [J] and add dE/dx_a = A F S b_a to gradients [N], as in definition."""
    L = TRAINING_LANES
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
                G00 = HALF * (px * px + py * py + pz * pz - ONE)
                G11 = HALF * (qx * qx + qy * qy + qz * qz - ONE)
                G01 = HALF * (px * qx + py * qy + pz * qz)
                trace = G00 + G11
                square = G00 * G00 + G11 * G11 + G01 * G01 + G01 * G01
                energy[n] = area * (HALF * lam * trace * trace + mu * square)
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
