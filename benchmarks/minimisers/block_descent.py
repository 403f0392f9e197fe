"""Vertex block descent (Chen et al. 2024) on the energies of reference_sim.

One sweep visits the free vertices one after the other. Each takes a Newton step of its own three coordinates,
all others held still:

    x_i <- x_i - H_ii^-1 g_i,    g_i, H_ii: gradient and 3 x 3 block of the whole step's potential

with H_ii made positive definite as in the simulator (compressive stress and the hinge's second derivative
left out). So it minimises exactly the potential that Newton minimises, and a vertex at rest for all sweeps is
a stationary point of it. On one core a sweep in the order of the mesh needs no colours. As in the paper there
is no line search; its guess and its Chebyshev acceleration are left out: all solvers start alike here.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from reference_sim import Potential
from reference_sim.minimise import Result
from reference_sim.minimise.descent import Descent

from .elements import contacts, depth, fold, hat, hinges, membrane, runaway, strain, terms_of, weights


class VertexBlockDescent:
    """A minimiser bound to one potential.

    Args:
        max_iterations: sweeps over all free vertices.

    Raises:
        ValueError: the potential has a term without a sweep, or no inertia.
    """

    def __init__(self, potential: Potential, *, max_iterations: int) -> None:
        self.potential, self.max_iterations = potential, max_iterations
        self._terms = terms = terms_of(potential, "vertex block descent")
        self._free = np.flatnonzero(potential.cloth.free)
        self._membrane, self._hinges = membrane(terms.strain), hinges(terms.bending)
        _, sample_weights, *_ = touching = contacts(terms.contact)
        vertices = potential.cloth.vertex_count
        self._around = (
            *incidence(self._membrane[0], np.ones_like(self._membrane[0]), vertices),
            *incidence(self._hinges[0], np.ones_like(self._hinges[0]), vertices),
            *incidence(touching[0], sample_weights > 0.0, vertices),
        )

    def minimise(self, x0: np.ndarray) -> Result:
        """Run from x0 (V, 3) [m]. The status is "max_iterations" or, where it runs away, "diverged"."""
        run, terms = Descent(self.potential, x0), self._terms
        inertia = terms.inertia.masses / terms.inertia.dt**2, terms.inertia.x_hat, weights(terms)
        touching = contacts(terms.contact)
        x = run.x.copy()
        while run.iterations < self.max_iterations:
            _sweep(x, self._free, inertia, self._membrane, self._hinges, touching, self._around)
            run.iterations += 1
            if runaway(x, x0):
                return run.result("diverged", f"sweep {run.iterations} threw a vertex far away")
        run.x = x
        run.value, run.g = run.evaluate(x)
        return run.result("max_iterations", f"{run.iterations} sweeps done")


def incidence(stencils: np.ndarray, used: np.ndarray, vertices: int) -> tuple[np.ndarray, np.ndarray]:
    """Elements around each vertex: corner c of element e is e * k + c, for the corners marked used (N, k).

    Returns first (V + 1,) and corners (M,): those of vertex v are corners[first[v] : first[v + 1]].
    """
    corners = np.flatnonzero(used)
    owner = stencils.ravel()[corners]
    first = np.concatenate([[0], np.cumsum(np.bincount(owner, minlength=vertices))])
    return first, corners[np.argsort(owner, kind="stable")]


@njit(cache=True, error_model="numpy")
def _sweep(x, free, inertia, membrane, hinges, touching, around):
    g, H = np.empty(3), np.empty((3, 3))
    fa, fb, turn = np.empty(3), np.empty(3), np.empty((4, 3))
    for v in free:
        block(x, v, inertia, membrane, hinges, touching, around, g, H, fa, fb, turn)
        _newton(x, v, g, H)


@njit(cache=True, error_model="numpy")
def block(x, v, inertia, membrane, hinges, touching, around, g, H, fa, fb, turn):
    """Writes the gradient g (3,) and the convex block H (3, 3) of vertex v; fa, fb and turn are scratch."""
    mass, x_hat, weight = inertia
    for i in range(3):
        g[i] = mass[v] * (x[v, i] - x_hat[v, i])
        for j in range(3):
            H[i, j] = mass[v] if i == j else 0.0
    g[1] += weight[v]
    first, corners = around[0], around[1]
    for at in range(first[v], first[v + 1]):
        _add_strain(x, corners[at] // 3, corners[at] % 3, membrane, g, H, fa, fb)
    first, corners = around[2], around[3]
    for at in range(first[v], first[v + 1]):
        e, corner = corners[at] // 4, corners[at] % 4
        angle = fold(x, hinges[0][e], hinges[2][e], turn)
        for i in range(3):
            pull = hinges[1][e] * turn[corner, i]
            g[i] += pull * angle
            for j in range(3):
                H[i, j] += pull * turn[corner, j]
    first, corners = around[4], around[5]
    stencils, shares, stiffness, margin, points, normals = touching
    for at in range(first[v], first[v + 1]):
        e, corner = corners[at] // 3, corners[at] % 3
        d = depth(x, stencils[e], shares[e], margin, points[e], normals[e])
        if d > 0.0:
            share = shares[e, corner]
            for i in range(3):
                g[i] -= 3.0 * stiffness[e] * d * d * share * normals[e, i]
                for j in range(3):
                    H[i, j] += 6.0 * stiffness[e] * d * share * share * normals[e, i] * normals[e, j]


@njit(cache=True, inline="always")
def _add_strain(x, e, corner, membrane, g, H, fa, fb):
    """A F S b and A [(b.S+ b) I + (lambda + mu) (F b)(F b)^T + mu |b|^2 F F^T], S+ without compression."""
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
    """The symmetric matrix S without its negative eigenvalues."""
    mean, half = 0.5 * (S00 + S11), 0.5 * (S00 - S11)
    radius = np.sqrt(half * half + S01 * S01)
    if mean - radius >= 0.0:
        return S00, S11, S01
    if mean + radius <= 0.0:
        return 0.0, 0.0, 0.0
    scale = 0.5 * (mean + radius) / radius  # the larger eigenvalue times the projector on its direction
    return scale * (radius + half), scale * (radius - half), scale * S01


@njit(cache=True, inline="always", error_model="numpy")
def _newton(x, v, g, H):
    """x_v -= H^-1 g by the adjugate; H is positive definite, for a mass is on its diagonal."""
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
