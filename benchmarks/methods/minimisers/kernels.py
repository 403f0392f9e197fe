"""Sweeps over vertices and over constraints, with the kernels of the terms as arguments.

See reference_sim.kernels.fast_kernels for the kernels.
"""

from __future__ import annotations

import numpy as np

from reference_sim.kernels.fast_kernels import SCRATCH_SHAPE
from reference_sim.kernels.kernel_cache import call_each, njit


@njit(cache=True, error_model="numpy")
def sweep_vertices(x, free, inertia, terms):
    """Take a Newton step of one free vertex after the other; x (V, 3) [m] is moved in place.

    inertia: m / dt^2 (V,) [N/m], x_hat (V, 3) [m] and weights (V,) [N]. terms: (kernel, data) of each.
    """
    g, H = np.empty(3), np.empty((3, 3))
    scratch, out = np.empty(SCRATCH_SHAPE), np.empty(len(terms))
    for v in free:
        block(x, v, inertia, terms, g, H, scratch, out)
        _newton(x, v, g, H)


@njit(cache=True, error_model="numpy", forceinline=True)
def block(x, v, inertia, terms, g, H, scratch, out):
    """Write the gradient g (3,) and the convex block H (3, 3) of vertex v.

    scratch and out (terms,) are room for the kernels.
    """
    mass, x_hat, weight = inertia
    for i in range(3):
        g[i] = mass[v] * (x[v, i] - x_hat[v, i])
        for j in range(3):
            H[i, j] = mass[v] if i == j else 0.0
    g[1] += weight[v]
    call_each(terms, out, x, v, g, H, scratch)


@njit(cache=True, inline="always", error_model="numpy")
def _newton(x, v, g, H):
    """Subtract H^-1 g, by the adjugate, from x_v; H is positive definite, for a mass is on its diagonal."""
    c0 = H[1, 1] * H[2, 2] - H[1, 2] * H[2, 1]
    c1 = H[1, 2] * H[2, 0] - H[1, 0] * H[2, 2]
    c2 = H[1, 0] * H[2, 1] - H[1, 1] * H[2, 0]
    scale = 1.0 / (H[0, 0] * c0 + H[0, 1] * c1 + H[0, 2] * c2)
    d0 = H[0, 2] * H[2, 1] - H[0, 1] * H[2, 2]
    d1 = H[0, 0] * H[2, 2] - H[0, 2] * H[2, 0]
    d2 = H[0, 1] * H[2, 0] - H[0, 0] * H[2, 1]
    f0 = H[0, 1] * H[1, 2] - H[0, 2] * H[1, 1]
    f1 = H[0, 2] * H[1, 0] - H[0, 0] * H[1, 2]
    f2 = H[0, 0] * H[1, 1] - H[0, 1] * H[1, 0]
    x[v, 0] -= scale * (c0 * g[0] + d0 * g[1] + f0 * g[2])
    x[v, 1] -= scale * (c1 * g[0] + d1 * g[1] + f1 * g[2])
    x[v, 2] -= scale * (c2 * g[0] + d2 * g[1] + f2 * g[2])


@njit(cache=True, error_model="numpy")
def sweep_constraints(x, w, terms):
    """Solve the constraints of one term after the other; x (V, 3) [m] is moved in place.

    w: dt^2 over the mass (V,) [m/N]. terms: (kernel, data) of each.
    """
    call_each(terms, np.empty(len(terms)), x, w)
