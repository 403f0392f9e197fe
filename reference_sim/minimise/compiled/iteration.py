"""L-BFGS stopped after some iterations, as one compiled function: evaluation, two-loop recursion, solves,
line search.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from reference_sim.kernels.kernel_cache import njit
from reference_sim.minimise.compiled.elements import (
    FAST,
    LANES,
    contact_gradient,
    hinge_gradient,
    membrane_gradient,
    vertex_gradient,
)
from reference_sim.minimise.compiled.scalar_factor import factorise, solve
from reference_sim.minimise.descent import SUFFICIENT_DECREASE
from reference_sim.minimise.lbfgs_history import LEAST_CURVATURE

HALVINGS = 12  # of a step before its direction is given up
ENERGIES = ("inertia", "gravity", "strain", "bending", "collision")  # by their places
INERTIA, GRAVITY, STRAIN, BENDING, COLLISION = range(len(ENERGIES))

# What is constant of a potential. Vertices: inertia [N/m] and weights [N] (V,); pinned: 3 times the vertex.
Vertices = namedtuple("Vertices", "inertia weights pinned")
# vertices, constants, and per step the edges of x_0 or the planes; see elements. near: blocks (n,) of contact
# samples that may touch in this step.
Elements = namedtuple("Elements", "vertices constants state")
Contact = namedtuple("Contact", "near vertices constants state")
Lame = namedtuple("Lame", "lam mu")
# The preconditioner: constant values (nnz,), where a contact sample (B, 9 LANES) adds to them, the pattern
# and the factor.
Factor = namedtuple(
    "Factor",
    "constant contact_places order row_starts row_columns factor_rows factor_columns starts rows values L D "
    "y filled b",
)
Memory = namedtuple("Memory", "S Y rho")  # of steps (m, 3V) [m] and changes of the gradient (m, 3V) [N]


@njit(cache=True)
def evaluate(u, target, vertices, membrane, lame, hinges, contact, gradient, scratch, energies):
    """Sum of the energies [J] at u (3V,), and its gradient (3V,) [N], zero at pinned vertices."""
    energies[INERTIA], energies[GRAVITY] = vertex_gradient(
        u, vertices.inertia, target, vertices.weights, gradient
    )
    energies[STRAIN] = membrane_gradient(
        u, membrane.vertices, membrane.constants, membrane.state, lame.lam, lame.mu, gradient, scratch
    )
    energies[BENDING] = hinge_gradient(u, hinges.vertices, hinges.constants, hinges.state, gradient, scratch)
    energies[COLLISION] = contact_gradient(
        u, contact.near, contact.vertices, contact.constants, contact.state, gradient, scratch
    )
    for i in vertices.pinned:
        for a in range(3):
            gradient[i + a] = np.float32(0.0)
    return energies.sum()


@njit(cache=True, error_model="numpy")
def precondition(contact, factor):
    """Factorise the constant stiffness plus that of the samples that touch at x_0."""
    values = factor.values
    values[:] = factor.constant
    for b in contact.near:
        for g in range(LANES):
            depth = contact.state[b, 3 * LANES + g]
            if depth <= 0.0:
                continue
            curvature = 6.0 * contact.constants[b, 3 * LANES + g] * depth
            for i in range(3):
                for j in range(3):
                    place = factor.contact_places[b, (3 * i + j) * LANES + g]
                    if place >= 0:
                        weights = contact.constants[b, i * LANES + g] * contact.constants[b, j * LANES + g]
                        values[place] += curvature * weights
    return factorise(
        values, factor.row_starts, factor.row_columns, factor.factor_rows, factor.factor_columns,
        factor.starts, factor.rows, factor.L, factor.D, factor.y, factor.filled,
    )  # fmt: skip


@njit(cache=True, fastmath=FAST)
def dot(a, b):
    total = np.float32(0.0)
    for i in range(len(a)):
        total += a[i] * b[i]
    return total


@njit(cache=True, fastmath=FAST)
def add_scaled(a, scale, b):
    for i in range(len(a)):
        a[i] += scale * b[i]


@njit(cache=True)
def apply_inverse(q, factor):
    """q (3V,) becomes the preconditioner's inverse times q."""
    b, order = factor.b, factor.order
    for k in range(len(order)):
        i = 3 * order[k]
        b[k, 0], b[k, 1], b[k, 2] = q[i], q[i + 1], q[i + 2]
    solve(factor.starts, factor.rows, factor.L, factor.D, b)
    for k in range(len(order)):
        i = 3 * order[k]
        q[i], q[i + 1], q[i + 2] = b[k, 0], b[k, 1], b[k, 2]


@njit(cache=True, error_model="numpy")
def descend(
    u, target, vertices, membrane, lame, hinges, contact, factor, memory, iterations, tolerance, first_step,
    work, scratch, energies, counts,
):  # fmt: skip
    """L-BFGS from u (3V,), which becomes the end.

    tolerance: [N] of the largest component of the gradient. first_step: share of the first direction that is
    tried first. work (4, 3V): room. counts: becomes iterations, evaluations, first share taken; returns the
    largest component of the gradient at the end [N].
    """
    gradient, trial_gradient, trial, p = work[0], work[1], work[2], work[3]
    value = evaluate(u, target, vertices, membrane, lame, hinges, contact, gradient, scratch, energies)
    counts[0], counts[1], counts[2] = 0.0, 1.0, first_step
    trial_energies = np.empty_like(energies)
    most, held, newest = len(memory.rho), 0, -1
    alphas = np.empty(most, np.float32)
    while counts[0] < iterations and np.abs(gradient).max() > tolerance and np.isfinite(value):
        p[:] = -gradient
        for back in range(held):
            k = (newest - back) % most
            alphas[k] = memory.rho[k] * dot(memory.S[k], p)
            add_scaled(p, -alphas[k], memory.Y[k])
        apply_inverse(p, factor)
        for back in range(held - 1, -1, -1):
            k = (newest - back) % most
            add_scaled(p, alphas[k] - memory.rho[k] * dot(memory.Y[k], p), memory.S[k])
        slope, share, found, there = dot(gradient, p), np.float32(1.0), False, value
        if counts[0] == 0:
            share = np.float32(first_step)
        for _ in range(HALVINGS if slope < 0 else 0):
            trial[:] = u
            add_scaled(trial, share, p)
            there = evaluate(
                trial, target, vertices, membrane, lame, hinges, contact, trial_gradient, scratch,
                trial_energies,
            )  # fmt: skip
            counts[1] += 1
            if np.isfinite(there) and there <= value + SUFFICIENT_DECREASE * share * slope:
                found = True
                break
            share *= np.float32(0.5)
        if not found:
            if held == 0:
                break
            held = 0
            continue
        if counts[0] == 0:
            counts[2] = share
        newest = (newest + 1) % most
        s, y = memory.S[newest], memory.Y[newest]
        for i in range(len(u)):
            s[i] = trial[i] - u[i]
            y[i] = trial_gradient[i] - gradient[i]
        curvature = dot(s, y)
        if curvature > LEAST_CURVATURE * np.sqrt(dot(s, s) * dot(y, y)):
            memory.rho[newest] = np.float32(1.0) / curvature
            held = min(held + 1, most)
        else:
            newest = (newest - 1) % most
        u[:] = trial
        gradient[:] = trial_gradient
        energies[:] = trial_energies
        value = there
        counts[0] += 1
    return np.abs(gradient).max()
