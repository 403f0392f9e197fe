"""Hinges in float32, LANES_FLOAT32 at a time: the kernel of early-stopped L-BFGS.

See kernels.float32_layout for the layout.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from reference_sim.energies.bend_hinge.training_batch import arctan2
from reference_sim.kernels.float32_layout import (
    FAST,
    HALF,
    ONE,
    TINY,
    Float32Lanes,
    empty_state,
    lay_out,
    set_edges,
)
from reference_sim.kernels.float32_layout import LANES_FLOAT32 as L
from reference_sim.kernels.kernel_cache import njit

if TYPE_CHECKING:
    from reference_sim.energies.bend_hinge.definition import BendHinge

PI, TWO_PI = np.float32(np.pi), np.float32(2 * np.pi)


def lanes(term: BendHinge) -> Float32Lanes:
    """Lay the hinges of the term out; a step freezes their edges."""
    vertices, constants = lay_out(term.stencils, term.stiffness, term.rest_angles)
    edges = empty_state(vertices, 9)

    def freeze(x0: np.ndarray) -> tuple:
        set_edges(x0, vertices, 3, edges)
        return vertices, constants, edges

    return Float32Lanes(hinge_gradient, freeze)


@njit(cache=True, fastmath=FAST, error_model="numpy")
def hinge_gradient(data, u, gradient, s):
    """Return the energy [J] of the hinges and add to gradient (3V,) [N].

    With L for LANES_FLOAT32: vertices (B, 4 L): 3 times the vertex. constants (B, 2 L): stiffness [J], rest
    angle [rad]. edges (B, 9 L): of x_0.
    """
    vertices, constants, edges = data
    total = 0.0
    for b in range(len(vertices)):
        at, c, e = vertices[b], constants[b], edges[b]
        for g in range(L):
            i0, i1, i2, i3 = at[g], at[L + g], at[2 * L + g], at[3 * L + g]
            x, y, z = u[i0], u[i0 + 1], u[i0 + 2]
            s[g], s[L + g], s[2 * L + g] = u[i1] - x, u[i1 + 1] - y, u[i1 + 2] - z
            s[3 * L + g], s[4 * L + g], s[5 * L + g] = u[i2] - x, u[i2 + 1] - y, u[i2 + 2] - z
            s[6 * L + g], s[7 * L + g], s[8 * L + g] = u[i3] - x, u[i3 + 1] - y, u[i3 + 2] - z
        energy = np.float32(0.0)
        for g in range(L):
            ex, ey, ez = s[g] + e[g], s[L + g] + e[L + g], s[2 * L + g] + e[2 * L + g]
            px, py, pz = s[3 * L + g] + e[3 * L + g], s[4 * L + g] + e[4 * L + g], s[5 * L + g] + e[5 * L + g]
            qx, qy, qz = s[6 * L + g] + e[6 * L + g], s[7 * L + g] + e[7 * L + g], s[8 * L + g] + e[8 * L + g]
            length2 = ex * ex + ey * ey + ez * ez + TINY
            inverse = ONE / np.sqrt(length2)
            length = length2 * inverse
            # Of each face m = n/|n|^2, and where the foot of its tip lies along the edge.
            nx, ny, nz = ey * pz - ez * py, ez * px - ex * pz, ex * py - ey * px
            scale = ONE / (nx * nx + ny * ny + nz * nz + TINY)
            ax, ay, az = nx * scale, ny * scale, nz * scale
            nx, ny, nz = ey * qz - ez * qy, ez * qx - ex * qz, ex * qy - ey * qx
            scale = ONE / (nx * nx + ny * ny + nz * nz + TINY)
            bx, by, bz = nx * scale, ny * scale, nz * scale
            foot_a = (ex * px + ey * py + ez * pz) * inverse
            foot_b = (ex * qx + ey * qy + ez * qz) * inverse
            sine = inverse * ((by * az - bz * ay) * ex + (bz * ax - bx * az) * ey + (bx * ay - by * ax) * ez)
            cosine = -(ax * bx + ay * by + az * bz)
            angle = arctan2(sine, cosine) - c[L + g]
            angle -= TWO_PI * np.floor((angle + PI) / TWO_PI)
            stiffness = c[g]
            energy += HALF * stiffness * angle * angle
            force = stiffness * angle
            wa, wb = force * (length - foot_a), force * (length - foot_b)
            va, vb = force * foot_a, force * foot_b
            s[9 * L + g] = wa * ax - wb * bx
            s[10 * L + g] = wa * ay - wb * by
            s[11 * L + g] = wa * az - wb * bz
            s[12 * L + g] = va * ax - vb * bx
            s[13 * L + g] = va * ay - vb * by
            s[14 * L + g] = va * az - vb * bz
            force *= length
            s[15 * L + g], s[16 * L + g], s[17 * L + g] = -force * ax, -force * ay, -force * az
            s[18 * L + g], s[19 * L + g], s[20 * L + g] = force * bx, force * by, force * bz
        total += float(energy)
        for g in range(L):
            i0, i1, i2, i3 = at[g], at[L + g], at[2 * L + g], at[3 * L + g]
            for a in range(3):
                gradient[i0 + a] += s[(9 + a) * L + g]
                gradient[i1 + a] += s[(12 + a) * L + g]
                gradient[i2 + a] += s[(15 + a) * L + g]
                gradient[i3 + a] += s[(18 + a) * L + g]
    return total
