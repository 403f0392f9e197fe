"""One hinge at a time: the kernels of vertex block descent and XPBD.

See kernels.element_sweeps for the layout.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from reference_sim.kernels.element_sweeps import Constraints, VertexBlocks
from reference_sim.kernels.kernel_cache import njit

if TYPE_CHECKING:
    from reference_sim.energies.bend_hinge.definition import BendHinge


def vertex_block(term: BendHinge) -> VertexBlocks:
    """Hand the hinges of the term to vertex block descent."""
    stencils = term.stencils
    return VertexBlocks(_add_block, stencils, np.ones_like(stencils), lambda: _arrays(term))


def constraint(term: BendHinge) -> Constraints:
    """Hand the hinges of the term to XPBD: C = theta - theta_0 of each."""
    return Constraints(_solve, lambda: (*_arrays(term), np.zeros(len(term.stencils))))


def _arrays(term: BendHinge) -> tuple:
    """Return hinges, stiffness and rest angles."""
    return term.stencils, term.stiffness, term.rest_angles


@njit(cache=True, error_model="numpy")
def fold(x, hinge, rest, gradient):
    """Return theta - rest of one hinge, wrapped into half a turn; its gradient (4, 3) [1/m] is written.

    A face of a hinge turns by one radian where its tip moves by its height over the edge, along the normal.
    """
    p, q = hinge[0], hinge[1]
    e0, e1, e2 = x[q, 0] - x[p, 0], x[q, 1] - x[p, 1], x[q, 2] - x[p, 2]
    length = np.sqrt(e0 * e0 + e1 * e1 + e2 * e2)
    normals = np.empty((2, 3))
    for side in range(2):
        t = hinge[2 + side]
        r0, r1, r2 = x[t, 0] - x[p, 0], x[t, 1] - x[p, 1], x[t, 2] - x[p, 2]
        sign = 1.0 if side == 0 else -1.0
        n0, n1, n2 = sign * (e1 * r2 - e2 * r1), sign * (e2 * r0 - e0 * r2), sign * (e0 * r1 - e1 * r0)
        normals[side, 0], normals[side, 1], normals[side, 2] = n0, n1, n2
        along = (e0 * r0 + e1 * r1 + e2 * r2) / length
        scale = 1.0 / (n0 * n0 + n1 * n1 + n2 * n2)
        for i in range(3):
            m = normals[side, i] * scale
            if side == 0:
                gradient[0, i], gradient[1, i] = 0.0, 0.0
            gradient[0, i] += (length - along) * m
            gradient[1, i] += along * m
            gradient[2 + side, i] = -length * m
    a, b = normals[0], normals[1]
    c0, c1, c2 = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
    sine = (e0 * c0 + e1 * c1 + e2 * c2) / length
    angle = np.arctan2(sine, a[0] * b[0] + a[1] * b[1] + a[2] * b[2]) - rest
    return angle - 2.0 * np.pi * np.floor(angle / (2.0 * np.pi) + 0.5)


@njit(cache=True, error_model="numpy", forceinline=True)
def _add_block(data, x, v, g, H, scratch):
    """Add gradient and convex block of vertex v: the second derivatives of theta are left out."""
    first, corners, hinges, stiffness, rest = data
    turn = scratch
    for at in range(first[v], first[v + 1]):
        e, corner = corners[at] // 4, corners[at] % 4
        angle = fold(x, hinges[e], rest[e], turn)
        for i in range(3):
            pull = stiffness[e] * turn[corner, i]
            g[i] += pull * angle
            for j in range(3):
                H[i, j] += pull * turn[corner, j]
    return 0.0


@njit(cache=True, error_model="numpy")
def _solve(data, x, w):
    """Solve one hinge after the other."""
    hinges, stiffness, rest, force = data
    turn = np.empty((4, 3))
    for e in range(len(hinges)):
        hinge, k = hinges[e], stiffness[e]
        if k == 0.0:  # its compliance is infinite: it pulls at nothing
            continue
        angle = fold(x, hinge, rest[e], turn)
        total = 1.0 / k
        for c in range(4):
            total += w[hinge[c]] * (turn[c, 0] ** 2 + turn[c, 1] ** 2 + turn[c, 2] ** 2)
        change = -(angle + force[e] / k) / total
        force[e] += change
        for c in range(4):
            for i in range(3):
                x[hinge[c], i] += w[hinge[c]] * turn[c, i] * change
    return 0.0
