"""Gradients of the membrane, the hinges and the contact penalty in float32, LANES elements at a time.

A state is u (3V,), the displacement [m] from a point x_0 that float64 has: differences of positions are taken
there once a step, in float64, and each element keeps its own (E, R, H below). So round-off is that of a
displacement of millimetres and not of a body metres away.

Elements come in blocks of LANES; the last one is filled up with elements of no stiffness. Arrays of a block
lie one quantity after the other, each LANES wide, so that the loops over lanes become vector instructions.
The formulas are those of energies.stretch_stvk, bend_hinge and contact_penalty; tests/reference_sim/minimise/test_compiled.py
holds values and gradients to them.
"""

from __future__ import annotations

import numpy as np

from reference_sim.kernels.kernel_cache import njit

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
    return np.ascontiguousarray(padded.reshape(-1, LANES, width).transpose(0, 2, 1)).reshape(
        -1, width * LANES
    )


@njit(cache=True)
def edges_of(x, vertices, columns, out):
    """out (B, 3 columns LANES) float32: x_(k+1) - x_0 of each element, k < columns, from x (V, 3) float64."""
    for b in range(len(vertices)):
        for g in range(LANES):
            first = vertices[b, g] // 3
            for k in range(columns):
                other = vertices[b, (k + 1) * LANES + g] // 3
                for i in range(3):
                    out[b, (3 * k + i) * LANES + g] = np.float32(x[other, i] - x[first, i])


@njit(cache=True, fastmath=FAST, error_model="numpy")
def membrane_gradient(u, vertices, constants, edges, lam, mu, gradient, s):
    """Energy [J] of StVK; adds to gradient (3V,) [N].

    vertices (B, 3 LANES): 3 times the vertex. constants (B, 5 LANES): Dm^-1 by rows, rest area. edges
    (B, 6 LANES): of x_0.
    """
    total = 0.0
    for b in range(len(vertices)):
        at, c, e = vertices[b], constants[b], edges[b]
        for g in range(LANES):
            i, j, k = at[g], at[LANES + g], at[2 * LANES + g]
            s[g] = u[j] - u[i]
            s[LANES + g] = u[j + 1] - u[i + 1]
            s[2 * LANES + g] = u[j + 2] - u[i + 2]
            s[3 * LANES + g] = u[k] - u[i]
            s[4 * LANES + g] = u[k + 1] - u[i + 1]
            s[5 * LANES + g] = u[k + 2] - u[i + 2]
        energy = np.float32(0.0)
        for g in range(LANES):
            x1, y1, z1 = s[g] + e[g], s[LANES + g] + e[LANES + g], s[2 * LANES + g] + e[2 * LANES + g]
            x2 = s[3 * LANES + g] + e[3 * LANES + g]
            y2 = s[4 * LANES + g] + e[4 * LANES + g]
            z2 = s[5 * LANES + g] + e[5 * LANES + g]
            d00, d01, d10, d11 = c[g], c[LANES + g], c[2 * LANES + g], c[3 * LANES + g]
            area = c[4 * LANES + g]
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
            s[6 * LANES + g], s[9 * LANES + g] = ax * t00 + bx * t01, ax * t10 + bx * t11
            s[7 * LANES + g], s[10 * LANES + g] = ay * t00 + by * t01, ay * t10 + by * t11
            s[8 * LANES + g], s[11 * LANES + g] = az * t00 + bz * t01, az * t10 + bz * t11
        total += float(energy)
        for g in range(LANES):
            i, j, k = at[g], at[LANES + g], at[2 * LANES + g]
            for a in range(3):
                f1, f2 = s[(6 + a) * LANES + g], s[(9 + a) * LANES + g]
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
        for g in range(LANES):
            i0, i1, i2, i3 = at[g], at[LANES + g], at[2 * LANES + g], at[3 * LANES + g]
            x, y, z = u[i0], u[i0 + 1], u[i0 + 2]
            s[g], s[LANES + g], s[2 * LANES + g] = u[i1] - x, u[i1 + 1] - y, u[i1 + 2] - z
            s[3 * LANES + g], s[4 * LANES + g], s[5 * LANES + g] = u[i2] - x, u[i2 + 1] - y, u[i2 + 2] - z
            s[6 * LANES + g], s[7 * LANES + g], s[8 * LANES + g] = u[i3] - x, u[i3 + 1] - y, u[i3 + 2] - z
        energy = np.float32(0.0)
        for g in range(LANES):
            ex, ey, ez = s[g] + e[g], s[LANES + g] + e[LANES + g], s[2 * LANES + g] + e[2 * LANES + g]
            px = s[3 * LANES + g] + e[3 * LANES + g]
            py = s[4 * LANES + g] + e[4 * LANES + g]
            pz = s[5 * LANES + g] + e[5 * LANES + g]
            qx = s[6 * LANES + g] + e[6 * LANES + g]
            qy = s[7 * LANES + g] + e[7 * LANES + g]
            qz = s[8 * LANES + g] + e[8 * LANES + g]
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
            size_s, size_c = abs(sine), abs(cosine)
            a = min(size_s, size_c) / (max(size_s, size_c) + TINY)
            q = a * a
            angle = a * (C0 + q * (C1 + q * (C2 + q * (C3 + q * (C4 + q * (C5 + q * (C6 + q * C7)))))))
            angle = HALF_PI - angle if size_s > size_c else angle
            angle = PI - angle if cosine < np.float32(0.0) else angle
            angle = -angle if sine < np.float32(0.0) else angle
            angle -= c[LANES + g]
            angle -= TWO_PI * np.floor((angle + PI) / TWO_PI)
            stiffness = c[g]
            energy += HALF * stiffness * angle * angle
            force = stiffness * angle
            wa, wb = force * (length - foot_a), force * (length - foot_b)
            va, vb = force * foot_a, force * foot_b
            s[9 * LANES + g] = wa * ax - wb * bx
            s[10 * LANES + g] = wa * ay - wb * by
            s[11 * LANES + g] = wa * az - wb * bz
            s[12 * LANES + g] = va * ax - vb * bx
            s[13 * LANES + g] = va * ay - vb * by
            s[14 * LANES + g] = va * az - vb * bz
            force *= length
            s[15 * LANES + g], s[16 * LANES + g], s[17 * LANES + g] = -force * ax, -force * ay, -force * az
            s[18 * LANES + g], s[19 * LANES + g], s[20 * LANES + g] = force * bx, force * by, force * bz
        total += float(energy)
        for g in range(LANES):
            i0, i1, i2, i3 = at[g], at[LANES + g], at[2 * LANES + g], at[3 * LANES + g]
            for a in range(3):
                gradient[i0 + a] += s[(9 + a) * LANES + g]
                gradient[i1 + a] += s[(12 + a) * LANES + g]
                gradient[i2 + a] += s[(15 + a) * LANES + g]
                gradient[i3 + a] += s[(18 + a) * LANES + g]
    return total


@njit(cache=True, fastmath=FAST, error_model="numpy")
def contact_gradient(u, near, vertices, constants, planes, gradient, s):
    """Energy [J] of the contact penalty; adds to gradient (3V,) [N].

    near: the blocks that are looked at. vertices (B, 3 LANES): 3 times the vertex. constants (B, 4 LANES):
    weights, stiffness [J/m^3]. planes (B, 4 LANES): normal, and the depth of x_0 under the margin [m], below
    zero above it.
    """
    total = 0.0
    for b in near:
        at, c, n = vertices[b], constants[b], planes[b]
        for g in range(LANES):
            i, j, k = at[g], at[LANES + g], at[2 * LANES + g]
            for a in range(3):
                s[a * LANES + g] = u[i + a]
                s[(3 + a) * LANES + g] = u[j + a]
                s[(6 + a) * LANES + g] = u[k + a]
        deepest, energy = np.float32(0.0), np.float32(0.0)
        for g in range(LANES):
            w0, w1, w2 = c[g], c[LANES + g], c[2 * LANES + g]
            x = w0 * s[g] + w1 * s[3 * LANES + g] + w2 * s[6 * LANES + g]
            y = w0 * s[LANES + g] + w1 * s[4 * LANES + g] + w2 * s[7 * LANES + g]
            z = w0 * s[2 * LANES + g] + w1 * s[5 * LANES + g] + w2 * s[8 * LANES + g]
            depth = n[3 * LANES + g] - (n[g] * x + n[LANES + g] * y + n[2 * LANES + g] * z)
            depth = max(depth, np.float32(0.0))
            stiffness = c[3 * LANES + g] * depth * depth
            energy += stiffness * depth
            s[9 * LANES + g] = -THREE * stiffness
            deepest = max(deepest, depth)
        if deepest == np.float32(0.0):
            continue
        total += float(energy)
        for g in range(LANES):
            force = s[9 * LANES + g]
            if force == np.float32(0.0):
                continue
            for corner in range(3):
                part, i = force * c[corner * LANES + g], at[corner * LANES + g]
                for a in range(3):
                    gradient[i + a] += part * n[a * LANES + g]
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
