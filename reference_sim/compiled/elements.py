"""Gradients of the membrane, the hinges and the contact penalty in float32, LANES elements at a time.

A state is u (3V,), the displacement [m] from a point x_0 that float64 has: differences of positions are taken
there once a step, in float64, and each element keeps its own (E, R, H below). So round-off is that of a
displacement of millimetres and not of a body metres away.

Elements come in blocks of LANES; the last one is filled up with elements of no stiffness. Arrays of a block
lie one quantity after the other, each LANES wide, so that the loops over lanes become vector instructions.
The formulas are those of energies.stretch_stvk, bend_hinge and contact_penalty; tests/test_compiled.py
holds values and gradients to them.
"""

from __future__ import annotations

import numpy as np

from ..kernel_cache import njit

LANES = 16
SCRATCH = 24 * LANES
FAST = {"nnan", "nsz", "reassoc", "contract", "arcp"}
TINY = np.float32(1e-30)
HALF, ONE, TWO, THREE = np.float32(0.5), np.float32(1.0), np.float32(2.0), np.float32(3.0)
PI, HALF_PI, TWO_PI = np.float32(np.pi), np.float32(np.pi / 2), np.float32(2 * np.pi)


def _arctangent() -> tuple[np.float32, ...]:
    """Coefficients c of atan(a) = a sum c_k a^(2k) on [0, 1], from a fit at Chebyshev points."""
    terms = 8
    a = np.cos((np.arange(200) + 0.5) * np.pi / 400)
    columns = a[:, None] ** (2 * np.arange(terms))
    c, *_ = np.linalg.lstsq(columns, np.arctan(a) / a, rcond=None)
    return tuple(np.float32(value) for value in c)


C0, C1, C2, C3, C4, C5, C6, C7 = _arctangent()


def blocks(values: np.ndarray) -> np.ndarray:
    """(N, k) numbers of N elements -> (B, k LANES) in blocks, filled up with zeros."""
    count, width = values.shape
    padded = np.zeros((-(-count // LANES) * LANES, width), values.dtype)
    padded[:count] = values
    return np.ascontiguousarray(padded.reshape(-1, LANES, width).transpose(0, 2, 1)).reshape(-1, width * LANES)


@njit(cache=True)
def edges_of(x, vertices, columns, out):
    """out (B, 3 columns LANES) float32: x_(k+1) - x_0 of each element, k < columns, from x (V, 3) float64."""
    for b in range(len(vertices)):
        for l in range(LANES):
            first = vertices[b, l] // 3
            for k in range(columns):
                other = vertices[b, (k + 1) * LANES + l] // 3
                for i in range(3):
                    out[b, (3 * k + i) * LANES + l] = np.float32(x[other, i] - x[first, i])


@njit(cache=True, fastmath=FAST, error_model="numpy")
def membrane_gradient(u, vertices, constants, edges, lam, mu, gradient, s):
    """Energy [J] of StVK; adds to gradient (3V,) [N].

    vertices (B, 3 LANES): 3 times the vertex. constants (B, 5 LANES): Dm^-1 by rows, rest area. edges
    (B, 6 LANES): of x_0.
    """
    total = 0.0
    for b in range(len(vertices)):
        at, c, e = vertices[b], constants[b], edges[b]
        for l in range(LANES):
            i, j, k = at[l], at[LANES + l], at[2 * LANES + l]
            s[l] = u[j] - u[i]
            s[LANES + l] = u[j + 1] - u[i + 1]
            s[2 * LANES + l] = u[j + 2] - u[i + 2]
            s[3 * LANES + l] = u[k] - u[i]
            s[4 * LANES + l] = u[k + 1] - u[i + 1]
            s[5 * LANES + l] = u[k + 2] - u[i + 2]
        energy = np.float32(0.0)
        for l in range(LANES):
            x1, y1, z1 = s[l] + e[l], s[LANES + l] + e[LANES + l], s[2 * LANES + l] + e[2 * LANES + l]
            x2 = s[3 * LANES + l] + e[3 * LANES + l]
            y2 = s[4 * LANES + l] + e[4 * LANES + l]
            z2 = s[5 * LANES + l] + e[5 * LANES + l]
            d00, d01, d10, d11 = c[l], c[LANES + l], c[2 * LANES + l], c[3 * LANES + l]
            area = c[4 * LANES + l]
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
            s[6 * LANES + l], s[9 * LANES + l] = ax * t00 + bx * t01, ax * t10 + bx * t11
            s[7 * LANES + l], s[10 * LANES + l] = ay * t00 + by * t01, ay * t10 + by * t11
            s[8 * LANES + l], s[11 * LANES + l] = az * t00 + bz * t01, az * t10 + bz * t11
        total += energy
        for l in range(LANES):
            i, j, k = at[l], at[LANES + l], at[2 * LANES + l]
            for a in range(3):
                f1, f2 = s[(6 + a) * LANES + l], s[(9 + a) * LANES + l]
                gradient[j + a] += f1
                gradient[k + a] += f2
                gradient[i + a] -= f1 + f2
    return total


@njit(cache=True, fastmath=FAST, error_model="numpy")
def hinge_gradient(u, vertices, constants, edges, gradient, s):
    """Energy [J] of the hinges; adds to gradient (3V,) [N].

    vertices (B, 4 LANES): 3 times the vertex. constants (B, 2 LANES): stiffness [J], rest angle [rad]. edges
    (B, 9 LANES): of x_0.
    """
    total = 0.0
    for b in range(len(vertices)):
        at, c, e = vertices[b], constants[b], edges[b]
        for l in range(LANES):
            i0, i1, i2, i3 = at[l], at[LANES + l], at[2 * LANES + l], at[3 * LANES + l]
            x, y, z = u[i0], u[i0 + 1], u[i0 + 2]
            s[l], s[LANES + l], s[2 * LANES + l] = u[i1] - x, u[i1 + 1] - y, u[i1 + 2] - z
            s[3 * LANES + l], s[4 * LANES + l], s[5 * LANES + l] = u[i2] - x, u[i2 + 1] - y, u[i2 + 2] - z
            s[6 * LANES + l], s[7 * LANES + l], s[8 * LANES + l] = u[i3] - x, u[i3 + 1] - y, u[i3 + 2] - z
        energy = np.float32(0.0)
        for l in range(LANES):
            ex, ey, ez = s[l] + e[l], s[LANES + l] + e[LANES + l], s[2 * LANES + l] + e[2 * LANES + l]
            px = s[3 * LANES + l] + e[3 * LANES + l]
            py = s[4 * LANES + l] + e[4 * LANES + l]
            pz = s[5 * LANES + l] + e[5 * LANES + l]
            qx = s[6 * LANES + l] + e[6 * LANES + l]
            qy = s[7 * LANES + l] + e[7 * LANES + l]
            qz = s[8 * LANES + l] + e[8 * LANES + l]
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
            size_s, size_c = abs(sine), abs(cosine)
            a = min(size_s, size_c) / (max(size_s, size_c) + TINY)
            q = a * a
            angle = a * (C0 + q * (C1 + q * (C2 + q * (C3 + q * (C4 + q * (C5 + q * (C6 + q * C7)))))))
            angle = HALF_PI - angle if size_s > size_c else angle
            angle = PI - angle if cosine < np.float32(0.0) else angle
            angle = -angle if sine < np.float32(0.0) else angle
            angle -= c[LANES + l]
            angle -= TWO_PI * np.floor((angle + PI) / TWO_PI)
            stiffness = c[l]
            energy += HALF * stiffness * angle * angle
            force = stiffness * angle
            wa, wb = force * (length - foot_a), force * (length - foot_b)
            va, vb = force * foot_a, force * foot_b
            s[9 * LANES + l] = wa * ax - wb * bx
            s[10 * LANES + l] = wa * ay - wb * by
            s[11 * LANES + l] = wa * az - wb * bz
            s[12 * LANES + l] = va * ax - vb * bx
            s[13 * LANES + l] = va * ay - vb * by
            s[14 * LANES + l] = va * az - vb * bz
            force *= length
            s[15 * LANES + l], s[16 * LANES + l], s[17 * LANES + l] = -force * ax, -force * ay, -force * az
            s[18 * LANES + l], s[19 * LANES + l], s[20 * LANES + l] = force * bx, force * by, force * bz
        total += energy
        for l in range(LANES):
            i0, i1, i2, i3 = at[l], at[LANES + l], at[2 * LANES + l], at[3 * LANES + l]
            for a in range(3):
                gradient[i0 + a] += s[(9 + a) * LANES + l]
                gradient[i1 + a] += s[(12 + a) * LANES + l]
                gradient[i2 + a] += s[(15 + a) * LANES + l]
                gradient[i3 + a] += s[(18 + a) * LANES + l]
    return total


@njit(cache=True, fastmath=FAST, error_model="numpy")
def contact_gradient(u, near, vertices, constants, planes, gradient, s):
    """Energy [J] of the contact penalty; adds to gradient (3V,) [N].

    near: the blocks that are looked at. vertices (B, 3 LANES): 3 times the vertex. constants (B, 4 LANES): weights, stiffness [J/m^3]. planes
    (B, 4 LANES): normal, and the depth of x_0 under the margin [m], below zero above it.
    """
    total = 0.0
    for b in near:
        at, c, n = vertices[b], constants[b], planes[b]
        for l in range(LANES):
            i, j, k = at[l], at[LANES + l], at[2 * LANES + l]
            for a in range(3):
                s[a * LANES + l] = u[i + a]
                s[(3 + a) * LANES + l] = u[j + a]
                s[(6 + a) * LANES + l] = u[k + a]
        deepest, energy = np.float32(0.0), np.float32(0.0)
        for l in range(LANES):
            w0, w1, w2 = c[l], c[LANES + l], c[2 * LANES + l]
            x = w0 * s[l] + w1 * s[3 * LANES + l] + w2 * s[6 * LANES + l]
            y = w0 * s[LANES + l] + w1 * s[4 * LANES + l] + w2 * s[7 * LANES + l]
            z = w0 * s[2 * LANES + l] + w1 * s[5 * LANES + l] + w2 * s[8 * LANES + l]
            depth = n[3 * LANES + l] - (n[l] * x + n[LANES + l] * y + n[2 * LANES + l] * z)
            depth = max(depth, np.float32(0.0))
            stiffness = c[3 * LANES + l] * depth * depth
            energy += stiffness * depth
            s[9 * LANES + l] = -THREE * stiffness
            deepest = max(deepest, depth)
        if deepest == np.float32(0.0):
            continue
        total += energy
        for l in range(LANES):
            force = s[9 * LANES + l]
            if force == np.float32(0.0):
                continue
            for corner in range(3):
                part, i = force * c[corner * LANES + l], at[corner * LANES + l]
                for a in range(3):
                    gradient[i + a] += part * n[a * LANES + l]
    return total


@njit(cache=True, fastmath=FAST, error_model="numpy")
def vertex_gradient(u, inertia, target, weights, gradient):
    """Energy [J] of inertia [N/m] (V,) towards target (3V,) [m], and of the weights (V,) [N] from x_0 on;
    sets gradient (3V,) [N]. Both energies.
    """
    kinetic, potential = 0.0, 0.0
    for v in range(len(inertia)):
        part = np.float32(0.0)
        for a in range(3 * v, 3 * v + 3):
            offset = u[a] - target[a]
            gradient[a] = inertia[v] * offset
            part += offset * offset
        kinetic += HALF * inertia[v] * part
        gradient[3 * v + 1] += weights[v]
        potential += weights[v] * u[3 * v + 1]
    return kinetic, potential
