"""StVK of one face at a time: the kernels of vertex block descent and XPBD.

See kernels.element_sweeps for the layout.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from reference_sim.energies.stretch_stvk.definition import strain
from reference_sim.kernels.element_sweeps import Constraints, VertexBlocks
from reference_sim.kernels.kernel_cache import njit

if TYPE_CHECKING:
    from reference_sim.energies.stretch_stvk.definition import StretchStVK


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
    """Add gradient and convex block of vertex v."""
    first, corners, membrane = data[0], data[1], data[2:]
    fa, fb = scratch[0], scratch[1]
    for at in range(first[v], first[v + 1]):
        _add_strain(x, corners[at] // 3, corners[at] % 3, membrane, g, H, fa, fb)
    return 0.0


@njit(cache=True, inline="always")
def _add_strain(x, e, corner, membrane, g, H, fa, fb):
    """Add A F S b to g and A [(b.S+ b) I + (lambda + mu) (F b)(F b)^T + mu |b|^2 F F^T] to H.

    S+ is S without compression.
    """
    faces, Dm_inverse, areas, lam, mu = membrane
    G00, G11, G01 = strain(x, faces[e], Dm_inverse[e], fa, fb)
    trace = lam * (G00 + G11)
    S00, S11, S01 = trace + 2.0 * mu * G00, trace + 2.0 * mu * G11, 2.0 * mu * G01
    b0, b1 = hat(Dm_inverse[e], corner)
    s0, s1 = S00 * b0 + S01 * b1, S01 * b0 + S11 * b1
    P00, P11, P01 = _stretched(S00, S11, S01)
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


@njit(cache=True, inline="always")
def _stretched(S00, S11, S01):
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
