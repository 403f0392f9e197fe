"""Extended position-based dynamics (Macklin et al. 2016) with constraints whose energies are ours, exactly.

Each element is a constraint C(x) (a vector for the membrane) with energy C . K C / 2:

    strain      C = (G00, G11, G01),  K = A [[l + 2 mu, l, 0], [l, l + 2 mu, 0], [0, 0, 4 mu]], l = lambda
    bending     C = theta - theta_0,  K = k
    collision   C = depth^(3/2),      K = 2 k a_s

so the sum over elements is StVK, hinges and the cubic penalty, to the last digit; the weight is in the
predicted positions x_hat + dt^2 g, where a step starts. A sweep solves one constraint after the other:

    (grad C M^-1 grad C^T + K^-1/dt^2) dlam = -C - K^-1/dt^2 lam,    x += M^-1 grad C^T dlam

What it does not do is find the potential's minimum: the positions keep the gradients of C from where each
dlam was found, and the second derivatives of C are left out. Its fixed point obeys lam = -dt^2 K C, but the
momentum equation only as far as grad C did not turn on the way from the prediction. It minimises the
potential where C is linear in x; elsewhere its limit for many sweeps is another configuration.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from reference_sim import Potential
from reference_sim.minimise import Result
from reference_sim.minimise.descent import Descent

from .elements import contacts, depth, fold, hat, hinges, membrane, runaway, strain, terms_of, weights


class XPBD:
    """A minimiser of sorts, bound to one potential.

    Args:
        max_iterations: sweeps over all constraints.

    Raises:
        ValueError: the potential has a term without a sweep, or no inertia.
    """

    def __init__(self, potential: Potential, *, max_iterations: int) -> None:
        self.potential, self.max_iterations = potential, max_iterations
        self._terms = terms = terms_of(potential, "XPBD")
        self._membrane, self._hinges = membrane(terms.strain), hinges(terms.bending)
        masses, self._dt = terms.inertia.masses, terms.inertia.dt
        self._inverse = np.where(potential.cloth.free, self._dt**2 / masses, 0.0)

    def minimise(self, x0: np.ndarray) -> Result:
        """Run from the predicted positions; of x0 (V, 3) [m] only the pinned vertices are read.

        The status is "max_iterations" or, where it runs away, "diverged".
        """
        run, terms = Descent(self.potential, x0), self._terms
        touching = contacts(terms.contact)
        x = terms.inertia.x_hat.copy()
        x[:, 1] -= self._inverse * weights(terms)
        x[terms.inertia.cloth.pins] = x0[terms.inertia.cloth.pins]
        pulls = tuple(np.zeros(shape) for shape in (
            (len(self._membrane[0]), 3), len(self._hinges[0]), len(touching[0])
        ))  # fmt: skip
        while run.iterations < self.max_iterations:
            _sweep(x, self._inverse, self._membrane, self._hinges, touching, *pulls)
            run.iterations += 1
            if runaway(x, x0):
                return run.result("diverged", f"sweep {run.iterations} threw a vertex far away")
        run.x = x
        run.value, run.g = run.evaluate(x)
        return run.result("max_iterations", f"{run.iterations} sweeps done")


# In the kernels lam is a force: the paper's lambda / dt^2. w = dt^2 / m takes its place in M^-1.
@njit(cache=True, error_model="numpy")
def _sweep(x, w, membrane, hinges, touching, strain_force, fold_force, contact_force):
    fa, fb = np.empty(3), np.empty(3)
    D, turn = np.empty((3, 3, 3)), np.empty((4, 3))
    for e in range(len(membrane[0])):
        _solve_strain(x, w, e, membrane, strain_force[e], fa, fb, D)
    for e in range(len(hinges[0])):
        hinge, k = hinges[0][e], hinges[1][e]
        angle = fold(x, hinge, hinges[2][e], turn)
        total = 1.0 / k
        for c in range(4):
            total += w[hinge[c]] * (turn[c, 0] ** 2 + turn[c, 1] ** 2 + turn[c, 2] ** 2)
        change = -(angle + fold_force[e] / k) / total
        fold_force[e] += change
        for c in range(4):
            for i in range(3):
                x[hinge[c], i] += w[hinge[c]] * turn[c, i] * change
    stencils, shares, stiffness, margin, points, normals = touching
    for e in range(len(stencils)):
        d = depth(x, stencils[e], shares[e], margin, points[e], normals[e])
        if d > 0.0 or contact_force[e] != 0.0:
            compliance = 1.0 / (2.0 * stiffness[e])
            slope = -1.5 * np.sqrt(d)  # of C along the normal
            total = compliance
            for c in range(3):
                total += w[stencils[e, c]] * (slope * shares[e, c]) ** 2
            change = -(d * np.sqrt(d) + compliance * contact_force[e]) / total
            contact_force[e] += change
            for c in range(3):
                for i in range(3):
                    x[stencils[e, c], i] += w[stencils[e, c]] * slope * shares[e, c] * normals[e, i] * change


@njit(cache=True, inline="always")
def _solve_strain(x, w, e, membrane, force, fa, fb, D):
    """One triangle's three strains at once; D (3, 3, 3) holds dC_k/dx_c."""
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
