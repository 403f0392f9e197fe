"""L-BFGS stopped after some iterations, as one compiled function.

It holds evaluation, two-loop recursion, solves and line search. The kernels of the terms are arguments of it.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from reference_sim.kernels.float32_layout import FAST, HALF
from reference_sim.kernels.kernel_argument import call_each
from reference_sim.kernels.kernel_cache import njit
from reference_sim.minimise.compiled.scalar_factor import factorise, solve
from reference_sim.minimise.descent import SUFFICIENT_DECREASE
from reference_sim.minimise.lbfgs_history import LEAST_CURVATURE

HALVINGS = 12  # of a step before its direction is given up
INERTIA, WEIGHT, ELEMENTS = range(3)  # places of energies: the terms of elements come last, in their order

# What is constant of the vertices: inertia [N/m] and weights [N] (V,); pinned: 3 times the vertex.
Vertices = namedtuple("Vertices", "inertia weights pinned")
# The preconditioner: constant values (nnz,), the pattern and the factor.
Factor = namedtuple(
    "Factor",
    "constant order row_starts row_columns factor_rows factor_columns starts rows values L D y filled b",
)
Memory = namedtuple("Memory", "S Y rho")  # of steps (m, 3V) [m] and changes of the gradient (m, 3V) [N]


@njit(cache=True, fastmath=FAST, error_model="numpy")
def vertex_gradient(u, inertia, target, weights, gradient):
    """Return the energies [J] of inertia and weight, and set gradient (3V,) [N].

    inertia (V,) [N/m] pulls towards target (3V,) [m]; the energy of weights (V,) [N] is counted from x_0 on.
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


@njit(cache=True)
def evaluate(u, target, vertices, terms, gradient, scratch, energies):
    """Return the sum of the energies [J] at u (3V,), and set its gradient (3V,) [N], zero at pinned vertices.

    terms: (kernel, data) of each term of elements, as `call_each` takes them. energies (2 + terms,) [J].
    """
    energies[INERTIA], energies[WEIGHT] = vertex_gradient(
        u, vertices.inertia, target, vertices.weights, gradient
    )
    call_each(terms, energies[ELEMENTS:], u, gradient, scratch)
    for i in vertices.pinned:
        for a in range(3):
            gradient[i + a] = np.float32(0.0)
    return energies.sum()


@njit(cache=True, error_model="numpy")
def precondition(stiffening, factor):
    """Factorise the constant stiffness plus that which terms ((kernel, data), ...) have in this step."""
    values = factor.values
    values[:] = factor.constant
    call_each(stiffening, np.empty(len(stiffening)), values)
    return factorise(
        values, factor.row_starts, factor.row_columns, factor.factor_rows, factor.factor_columns,
        factor.starts, factor.rows, factor.L, factor.D, factor.y, factor.filled,
    )  # fmt: skip


@njit(cache=True, fastmath=FAST)
def dot(a, b):
    """Return the inner product of a and b (n,), in float32."""
    total = np.float32(0.0)
    for i in range(len(a)):
        total += a[i] * b[i]
    return total


@njit(cache=True, fastmath=FAST)
def add_scaled(a, scale, b):
    """Add scale times b to a (n,)."""
    for i in range(len(a)):
        a[i] += scale * b[i]


@njit(cache=True)
def apply_inverse(q, factor):
    """Replace q (3V,) by the preconditioner's inverse times q."""
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
    u, target, vertices, terms, factor, memory, iterations, tolerance, first_step, work, scratch, energies,
    counts,
):  # fmt: skip
    """Run L-BFGS from u (3V,), which becomes the end.

    tolerance: [N] of the largest component of the gradient. first_step: share of the first direction that is
    tried first. work (4, 3V): room. counts: becomes iterations and first share taken; returns the largest
    component of the gradient at the end [N].
    """
    gradient, trial_gradient, trial, p = work[0], work[1], work[2], work[3]
    value = evaluate(u, target, vertices, terms, gradient, scratch, energies)
    counts[0], counts[1] = 0.0, first_step
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
        slope, share, accepted, trial_value = dot(gradient, p), np.float32(1.0), False, value
        if counts[0] == 0:
            share = np.float32(first_step)
        for _ in range(HALVINGS if slope < 0 else 0):
            trial[:] = u
            add_scaled(trial, share, p)
            trial_value = evaluate(trial, target, vertices, terms, trial_gradient, scratch, trial_energies)
            if np.isfinite(trial_value) and trial_value <= value + SUFFICIENT_DECREASE * share * slope:
                accepted = True
                break
            share *= np.float32(0.5)
        if not accepted:
            if held == 0:
                break
            held = 0
            continue
        if counts[0] == 0:
            counts[1] = share
        for i in range(
            len(u)
        ):  # the direction has done its work: it becomes the step, the gradient its change
            p[i] = trial[i] - u[i]
            gradient[i] = trial_gradient[i] - gradient[i]
        curvature = dot(p, gradient)
        if curvature > LEAST_CURVATURE * np.sqrt(dot(p, p) * dot(gradient, gradient)):
            newest, held = (newest + 1) % most, min(held + 1, most)
            memory.S[newest], memory.Y[newest], memory.rho[newest] = p, gradient, np.float32(1.0) / curvature
        u[:] = trial
        gradient[:] = trial_gradient
        energies[:] = trial_energies
        value = trial_value
        counts[0] += 1
    return np.abs(gradient).max()
