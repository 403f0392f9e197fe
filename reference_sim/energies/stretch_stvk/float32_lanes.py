"""StVK in float32, LANES_FLOAT32 faces at a time: the kernel of early-stopped L-BFGS.

See kernels.float32_layout for the layout.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from reference_sim.kernels.float32_layout import (
    FAST,
    HALF,
    ONE,
    TWO,
    Float32Lanes,
    empty_state,
    lay_out,
    set_edges,
)
from reference_sim.kernels.float32_layout import LANES_FLOAT32 as L
from reference_sim.kernels.kernel_cache import njit

if TYPE_CHECKING:
    from reference_sim.energies.stretch_stvk.definition import StretchStVK


def lanes(term: StretchStVK) -> Float32Lanes:
    """Lay the faces of the term out; a step freezes their edges."""
    vertices, constants = lay_out(term.stencils, term.Dm_inverse, term.areas)
    edges, lame = empty_state(vertices, 6), (np.float32(term.lam), np.float32(term.mu))

    def freeze(x0: np.ndarray) -> tuple:
        set_edges(x0, vertices, 2, edges)
        return vertices, constants, edges, *lame

    return Float32Lanes(membrane_gradient, freeze)


@njit(cache=True, fastmath=FAST, error_model="numpy")
def membrane_gradient(data, u, gradient, s):
    """Return the energy [J] of StVK and add to gradient (3V,) [N].

    With L for LANES_FLOAT32: vertices (B, 3 L): 3 times the vertex. constants (B, 5 L): Dm^-1 by rows, rest
    area. edges (B, 6 L): of x_0.
    """
    vertices, constants, edges, lam, mu = data
    total = 0.0
    for b in range(len(vertices)):
        at, c, e = vertices[b], constants[b], edges[b]
        for g in range(L):
            i, j, k = at[g], at[L + g], at[2 * L + g]
            s[g] = u[j] - u[i]
            s[L + g] = u[j + 1] - u[i + 1]
            s[2 * L + g] = u[j + 2] - u[i + 2]
            s[3 * L + g] = u[k] - u[i]
            s[4 * L + g] = u[k + 1] - u[i + 1]
            s[5 * L + g] = u[k + 2] - u[i + 2]
        energy = np.float32(0.0)
        for g in range(L):
            x1, y1, z1 = s[g] + e[g], s[L + g] + e[L + g], s[2 * L + g] + e[2 * L + g]
            x2, y2, z2 = s[3 * L + g] + e[3 * L + g], s[4 * L + g] + e[4 * L + g], s[5 * L + g] + e[5 * L + g]
            d00, d01, d10, d11 = c[g], c[L + g], c[2 * L + g], c[3 * L + g]
            area = c[4 * L + g]
            ax, ay, az = x1 * d00 + x2 * d10, y1 * d00 + y2 * d10, z1 * d00 + z2 * d10
            bx, by, bz = x1 * d01 + x2 * d11, y1 * d01 + y2 * d11, z1 * d01 + z2 * d11
            g00 = HALF * (ax * ax + ay * ay + az * az - ONE)
            g11 = HALF * (bx * bx + by * by + bz * bz - ONE)
            g01 = HALF * (ax * bx + ay * by + az * bz)
            trace = g00 + g11
            energy += area * (HALF * lam * trace * trace + mu * (g00 * g00 + g11 * g11 + TWO * g01 * g01))
            s00 = area * (lam * trace + TWO * mu * g00)
            s11 = area * (lam * trace + TWO * mu * g11)
            s01 = area * TWO * mu * g01
            # P = F S, and the force of a corner P b.
            t00, t01 = d00 * s00 + d01 * s01, d00 * s01 + d01 * s11
            t10, t11 = d10 * s00 + d11 * s01, d10 * s01 + d11 * s11
            s[6 * L + g], s[9 * L + g] = ax * t00 + bx * t01, ax * t10 + bx * t11
            s[7 * L + g], s[10 * L + g] = ay * t00 + by * t01, ay * t10 + by * t11
            s[8 * L + g], s[11 * L + g] = az * t00 + bz * t01, az * t10 + bz * t11
        total += float(energy)
        for g in range(L):
            i, j, k = at[g], at[L + g], at[2 * L + g]
            for a in range(3):
                f1, f2 = s[(6 + a) * L + g], s[(9 + a) * L + g]
                gradient[j + a] += f1
                gradient[k + a] += f2
                gradient[i + a] -= f1 + f2
    return total
