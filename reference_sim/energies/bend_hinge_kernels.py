"""Kernels of hinges for solvers and training: training batches, float32 lanes, sweeps.

See kernels.lanes and kernels.fast_kernels for the layouts.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from reference_sim.kernels.fast_kernels import (
    GUARDED,
    LANES,
    BatchKernel,
    Constraints,
    VertexBlocks,
    batch_kernel,
)
from reference_sim.kernels.kernel_cache import njit
from reference_sim.kernels.lanes import (
    FAST,
    HALF,
    ONE,
    TINY,
    Float32Lanes,
    add_lanes,
    copy_lanes,
    empty_state,
    lay_out,
    set_edges,
)
from reference_sim.kernels.lanes import LANES as L

if TYPE_CHECKING:
    from reference_sim.energies.bend_hinge import BendHinge

PI, TWO_PI, PER_TURN = np.float32(np.pi), np.float32(2 * np.pi), np.float32(0.5 / np.pi)
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


# The corners of an element are copied into one small array of known size and the result copied back:
# within it the compiler knows that nothing overlaps, which for rows chosen by index it could not know.
@njit(cache=True, fastmath=GUARDED, error_model="numpy")
def _bending(x, hinges, stiffness, rest, values, gradients):
    """Set values [J] and add to gradients [N]; d theta / d x_a = +- w_a n / |n|^2, as in definition."""
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
                inverse = ONE / length
                ax, ay, az = ey * rz - ez * ry, ez * rx - ex * rz, ex * ry - ey * rx
                bx, by, bz = sy * ez - sz * ey, sz * ex - sx * ez, sx * ey - sy * ex
                cx, cy, cz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
                sine = (cx * ex + cy * ey + cz * ez) * inverse
                theta = arctan2(sine, ax * bx + ay * by + az * bz) - angle
                theta -= TWO_PI * np.floor((theta + PI) * PER_TURN)
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
        for n in range(L):  # a whole row would compile numba's message on shapes: a second
            values[block, n] = total[n]


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

    With L for LANES: vertices (B, 4 L): 3 times the vertex. constants (B, 2 L): stiffness [J],
    rest angle [rad]. edges (B, 9 L): of x_0.
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
            px = s[3 * L + g] + e[3 * L + g]
            py = s[4 * L + g] + e[4 * L + g]
            pz = s[5 * L + g] + e[5 * L + g]
            qx = s[6 * L + g] + e[6 * L + g]
            qy = s[7 * L + g] + e[7 * L + g]
            qz = s[8 * L + g] + e[8 * L + g]
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
            sine = inverse * (
                (by * az - bz * ay) * ex + (bz * ax - bx * az) * ey + (bx * ay - by * ax) * ez
            )
            cosine = -(ax * bx + ay * by + az * bz)
            angle = arctan2(sine, cosine) - c[L + g]
            angle -= TWO_PI * np.floor((angle + PI) * PER_TURN)
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

    A face of a hinge turns by one radian where its tip moves by its height over the edge, along the
    normal.
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
