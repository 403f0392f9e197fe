"""Kernels of the StVK membrane for solvers and training: float32 lanes, training batches, sweeps.

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
    TWO,
    Float32Lanes,
    add_lanes,
    copy_lanes,
    empty_state,
    lay_out,
    set_edges,
)
from reference_sim.kernels.lanes import LANES as L

if TYPE_CHECKING:
    from reference_sim.energies.stretch_stvk import StretchStVK


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

    With L for LANES: vertices (B, 3 L): 3 times the vertex. constants (B, 5 L): Dm^-1 by rows,
    rest area. edges (B, 6 L): of x_0.
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
            x2 = s[3 * L + g] + e[3 * L + g]
            y2 = s[4 * L + g] + e[4 * L + g]
            z2 = s[5 * L + g] + e[5 * L + g]
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


def batch(term: StretchStVK) -> BatchKernel:
    """Bind the kernel to the faces of the term."""
    Dm_inverse = term.Dm_inverse.reshape(-1, 4).astype(np.float32)
    areas = term.areas.astype(np.float32)
    return batch_kernel(
        _strain, term.stencils, Dm_inverse, areas, np.float32(term.lam), np.float32(term.mu)
    )


# The corners of an element are copied into one small array of known size and the result copied back:
# within it the compiler knows that nothing overlaps, which for rows chosen by index it could not know.
@njit(cache=True, fastmath=GUARDED, error_model="numpy")
def _strain(x, faces, Dm_inverse, areas, lam, mu, values, gradients):
    """Set values [J] and add dE/dx_a = A F S b_a to gradients [N], as in definition."""
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
                G00 = HALF * (px * px + py * py + pz * pz - ONE)
                G11 = HALF * (qx * qx + qy * qy + qz * qz - ONE)
                G01 = HALF * (px * qx + py * qy + pz * qz)
                trace = G00 + G11
                square = G00 * G00 + G11 * G11 + G01 * G01 + G01 * G01
                energy[n] = area * (HALF * lam * trace * trace + mu * square)
                m = mu + mu
                S00 = area * (lam * trace + m * G00)
                S11 = area * (lam * trace + m * G11)
                S01 = area * m * G01
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
        for n in range(L):  # a whole row would compile numba's message on shapes: a second
            values[block, n] = total[n]


@njit(cache=True, inline="always")
def strain(x, face, D, fa, fb):
    """Return G00, G11, G01 of the Green strain; the columns of F are written into fa and fb."""
    p, q, r = face[0], face[1], face[2]
    for i in range(3):
        first, second = x[q, i] - x[p, i], x[r, i] - x[p, i]
        fa[i] = first * D[0, 0] + second * D[1, 0]
        fb[i] = first * D[0, 1] + second * D[1, 1]
    aa = fa[0] * fa[0] + fa[1] * fa[1] + fa[2] * fa[2]
    bb = fb[0] * fb[0] + fb[1] * fb[1] + fb[2] * fb[2]
    ab = fa[0] * fb[0] + fa[1] * fb[1] + fa[2] * fb[2]
    return 0.5 * (aa - 1.0), 0.5 * (bb - 1.0), 0.5 * ab


def vertex_block(term: StretchStVK) -> VertexBlocks:
    """Hand the faces of the term to vertex block descent."""
    stencils = term.stencils
    return VertexBlocks(_add_block, stencils, np.ones_like(stencils), lambda: _arrays(term))


def constraint(term: StretchStVK) -> Constraints:
    """Hand the faces of the term to XPBD: C = (G00, G11, G01) of each."""
    return Constraints(_solve, lambda: (*_arrays(term), np.zeros((len(term.stencils), 3))))


def _arrays(term: StretchStVK) -> tuple:
    """Return faces, Dm^-1, areas, lambda and mu."""
    return term.stencils, term.Dm_inverse, term.areas, float(term.lam), float(term.mu)


@njit(cache=True, inline="always")
def hat(D, corner):
    """Return the gradient of the hat function of a corner in rest coordinates [1/m]."""
    if corner == 0:
        return -D[0, 0] - D[1, 0], -D[0, 1] - D[1, 1]
    return D[corner - 1, 0], D[corner - 1, 1]


@njit(cache=True, error_model="numpy", forceinline=True)
def _add_block(data, x, v, g, H, scratch):
    """Add A F S b to g and A [(b.S+ b) I + (lambda + mu) (F b)(F b)^T + mu |b|^2 F F^T] to H, of vertex v.

    S+ is S without compression.
    """
    first, corners, faces, Dm_inverse, areas, lam, mu = data
    fa, fb = scratch[0], scratch[1]
    for at in range(first[v], first[v + 1]):
        e = corners[at] // 3
        G00, G11, G01 = strain(x, faces[e], Dm_inverse[e], fa, fb)
        trace = lam * (G00 + G11)
        S00, S11, S01 = trace + 2.0 * mu * G00, trace + 2.0 * mu * G11, 2.0 * mu * G01
        b0, b1 = hat(Dm_inverse[e], corners[at] % 3)
        s0, s1 = S00 * b0 + S01 * b1, S01 * b0 + S11 * b1
        P00, P11, P01 = _drop_compression(S00, S11, S01)
        along = b0 * (P00 * b0 + P01 * b1) + b1 * (P01 * b0 + P11 * b1)
        bb = b0 * b0 + b1 * b1
        area = areas[e]
        for i in range(3):
            g[i] += area * (fa[i] * s0 + fb[i] * s1)
            Fi = fa[i] * b0 + fb[i] * b1
            H[i, i] += area * along
            for j in range(3):
                Fj = fa[j] * b0 + fb[j] * b1
                H[i, j] += area * ((lam + mu) * Fi * Fj + mu * bb * (fa[i] * fa[j] + fb[i] * fb[j]))
    return 0.0


@njit(cache=True, inline="always")
def _drop_compression(S00, S11, S01):
    """Return the symmetric matrix S without its negative eigenvalues."""
    mean, half = 0.5 * (S00 + S11), 0.5 * (S00 - S11)
    radius = np.sqrt(half * half + S01 * S01)
    if mean - radius >= 0.0:
        return S00, S11, S01
    if mean + radius <= 0.0:
        return 0.0, 0.0, 0.0
    scale = 0.5 * (mean + radius) / radius  # the larger eigenvalue times the projector on its direction
    return scale * (radius + half), scale * (radius - half), scale * S01


@njit(cache=True, error_model="numpy")
def _solve(data, x, w):
    """Solve the strains of one face after the other."""
    membrane, force = data[:5], data[5]
    fa, fb, D = np.empty(3), np.empty(3), np.empty((3, 3, 3))
    for e in range(len(force)):
        _solve_strain(x, w, e, membrane, force[e], fa, fb, D)
    return 0.0


@njit(cache=True, inline="always")
def _solve_strain(x, w, e, membrane, force, fa, fb, D):
    """Solve one triangle's three strains at once; D (3, 3, 3) holds dC_k/dx_c."""
    faces, Dm_inverse, areas, lam, mu = membrane
    face = faces[e]
    G00, G11, G01 = strain(x, face, Dm_inverse[e], fa, fb)
    for c in range(3):
        b0, b1 = hat(Dm_inverse[e], c)
        for i in range(3):
            D[0, c, i], D[1, c, i] = fa[i] * b0, fb[i] * b1
            D[2, c, i] = 0.5 * (fa[i] * b1 + fb[i] * b0)
    # K^-1 of the plane: [[p, q, 0], [q, p, 0], [0, 0, r]]
    scale = 1.0 / (areas[e] * 4.0 * mu * (lam + mu))
    p, q, r = scale * (lam + 2.0 * mu), -scale * lam, 1.0 / (4.0 * mu * areas[e])
    r0 = -G00 - p * force[0] - q * force[1]
    r1 = -G11 - q * force[0] - p * force[1]
    r2 = -G01 - r * force[2]
    a00, a11, a22, a01, a02, a12 = p, p, r, q, 0.0, 0.0
    for c in range(3):
        wc = w[face[c]]
        for i in range(3):
            d0, d1, d2 = D[0, c, i], D[1, c, i], D[2, c, i]
            a00 += wc * d0 * d0
            a11 += wc * d1 * d1
            a22 += wc * d2 * d2
            a01 += wc * d0 * d1
            a02 += wc * d0 * d2
            a12 += wc * d1 * d2
    c0, c1, c2 = a11 * a22 - a12 * a12, a12 * a02 - a01 * a22, a01 * a12 - a11 * a02
    inverse = 1.0 / (a00 * c0 + a01 * c1 + a02 * c2)
    s0 = inverse * (c0 * r0 + c1 * r1 + c2 * r2)
    s1 = inverse * (c1 * r0 + (a00 * a22 - a02 * a02) * r1 + (a01 * a02 - a00 * a12) * r2)
    s2 = inverse * (c2 * r0 + (a01 * a02 - a00 * a12) * r1 + (a00 * a11 - a01 * a01) * r2)
    force[0] += s0
    force[1] += s1
    force[2] += s2
    for c in range(3):
        for i in range(3):
            x[face[c], i] += w[face[c]] * (D[0, c, i] * s0 + D[1, c, i] * s1 + D[2, c, i] * s2)
