"""Kernels of the contact penalty for solvers: float32 lanes, sweeps.

See kernels.float32_layout and kernels.fast_kernels for the layouts.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from reference_sim.contact.closest_point import halved
from reference_sim.kernels.fast_kernels import Constraints, VertexBlocks
from reference_sim.kernels.float32_layout import FAST, THREE, Float32Lanes, empty_state, lay_out, to_blocks
from reference_sim.kernels.float32_layout import LANES_FLOAT32 as L
from reference_sim.kernels.kernel_cache import njit

if TYPE_CHECKING:
    from reference_sim.energies.contact_penalty import ContactPenalty


def lanes(term: ContactPenalty) -> Float32Lanes:
    """Lay the samples of the term out, those of a block near each other; a step freezes planes and depths."""
    order = halved(term.rest_samples)
    stencils = term.stencils[order]
    vertices, constants = lay_out(stencils, term.weights[order], term.stiffness[order])
    weights = to_blocks(term.weights[order])  # in float64: a third of metres is no third in float32
    planes = empty_state(vertices, 4)

    def freeze(x0: np.ndarray) -> tuple:
        deepest = _depths(
            x0.ravel(), order, vertices, weights, term.points, term.normals, term.margin, planes
        )
        return deepest, vertices, constants, planes

    return Float32Lanes(contact_gradient, freeze, contact_stiffness, stencils)


@njit(cache=True)
def _depths(x, order, vertices, constants, points, normals, margin, state):
    """Write normals and depths of the samples at x (3V,) into state, in blocks.

    Returns the largest depth (B,) [m] of each block, below zero where none of its samples touches.
    """
    deepest = np.full(len(state), np.float32(-np.inf))
    for place in range(len(order)):
        s, block, lane = order[place], place // L, place % L
        i, j, k = vertices[block, lane], vertices[block, L + lane], vertices[block, 2 * L + lane]
        u, v, w = constants[block, lane], constants[block, L + lane], constants[block, 2 * L + lane]
        depth = margin
        for a in range(3):
            sample = u * x[i + a] + v * x[j + a] + w * x[k + a]
            depth -= normals[s, a] * (sample - points[s, a])
            state[block, a * L + lane] = normals[s, a]
        state[block, 3 * L + lane] = depth
        deepest[block] = max(deepest[block], np.float32(depth))
    return deepest


@njit(cache=True, inline="always", fastmath=FAST, error_model="numpy")
def _longest(u):
    """Return a bound on the longest of the displacements u (3V,) [m], rounding included."""
    most = np.float32(0.0)
    for i in range(0, len(u) - 2, 3):
        most = max(most, u[i] * u[i] + u[i + 1] * u[i + 1] + u[i + 2] * u[i + 2])
    return np.float32(1.00001) * np.sqrt(most) + np.float32(1e-7)


@njit(cache=True, fastmath=FAST, error_model="numpy")
def contact_gradient(data, u, gradient, s):
    """Return the energy [J] of the contact penalty and add to gradient (3V,) [N].

    deepest (B,): largest depth of a block at x_0 [m]. With L for LANES_FLOAT32: vertices (B, 3 L): 3 times
    the vertex. constants (B, 4 L): weights, stiffness [J/m^3]. planes (B, 4 L): normal, and the depth of x_0
    under the margin [m], below zero above it. No sample moves farther than the vertex that moves most, so a
    block that is higher than that is not visited.
    """
    deepest_at_start, vertices, constants, planes = data
    total, height = 0.0, -_longest(u)
    for b in range(len(planes)):
        if deepest_at_start[b] < height:
            continue
        at, c, n = vertices[b], constants[b], planes[b]
        for g in range(L):
            i, j, k = at[g], at[L + g], at[2 * L + g]
            for a in range(3):
                s[a * L + g] = u[i + a]
                s[(3 + a) * L + g] = u[j + a]
                s[(6 + a) * L + g] = u[k + a]
        deepest, energy = np.float32(0.0), np.float32(0.0)
        for g in range(L):
            w0, w1, w2 = c[g], c[L + g], c[2 * L + g]
            x = w0 * s[g] + w1 * s[3 * L + g] + w2 * s[6 * L + g]
            y = w0 * s[L + g] + w1 * s[4 * L + g] + w2 * s[7 * L + g]
            z = w0 * s[2 * L + g] + w1 * s[5 * L + g] + w2 * s[8 * L + g]
            depth = n[3 * L + g] - (n[g] * x + n[L + g] * y + n[2 * L + g] * z)
            depth = max(depth, np.float32(0.0))
            stiffness = c[3 * L + g] * depth * depth
            energy += stiffness * depth
            s[9 * L + g] = -THREE * stiffness
            deepest = max(deepest, depth)
        if deepest == np.float32(0.0):
            continue
        total += float(energy)
        for g in range(L):
            force = s[9 * L + g]
            if force == np.float32(0.0):
                continue
            for corner in range(3):
                part, i = force * c[corner * L + g], at[corner * L + g]
                for a in range(3):
                    gradient[i + a] += part * n[a * L + g]
    return total


@njit(cache=True, error_model="numpy")
def contact_stiffness(data, values):
    """Add the stiffness [N/m] of the samples that touch at x_0; returns 0."""
    deepest, _, constants, planes, places = data
    for b in np.flatnonzero(deepest > 0.0):
        for g in range(L):
            depth = planes[b, 3 * L + g]
            if depth <= 0.0:
                continue
            curvature = 6.0 * constants[b, 3 * L + g] * depth
            for i in range(3):
                for j in range(3):
                    place = places[b, (3 * i + j) * L + g]
                    if place >= 0:
                        weights = constants[b, i * L + g] * constants[b, j * L + g]
                        values[place] += curvature * weights
    return 0.0


@njit(cache=True, inline="always")
def sample_depth(x, stencil, weight, margin, c, n):
    """Return max(eps - n.(x_s - c), 0) of one contact sample [m]."""
    distance = 0.0
    for i in range(3):
        sample = weight[0] * x[stencil[0], i] + weight[1] * x[stencil[1], i] + weight[2] * x[stencil[2], i]
        distance += n[i] * (sample - c[i])
    return max(margin - distance, 0.0)


def vertex_block(term: ContactPenalty) -> VertexBlocks:
    """Hand the samples of the term to vertex block descent."""
    return VertexBlocks(_add_block, term.stencils, term.weights > 0.0, lambda: _arrays(term))


def constraint(term: ContactPenalty) -> Constraints:
    """Hand the samples of the term to XPBD: C = depth^(3/2) of each."""
    return Constraints(_solve, lambda: (*_arrays(term), np.zeros(len(term.stencils))))


def _arrays(term: ContactPenalty) -> tuple:
    """Return stencils, weights, stiffness, margin, points and normals, as the step has frozen them."""
    planes = np.ascontiguousarray(term.points), np.ascontiguousarray(term.normals)
    return term.stencils, term.weights, term.stiffness, term.margin, *planes


@njit(cache=True, error_model="numpy", forceinline=True)
def _add_block(data, x, v, g, H, scratch):
    """Add gradient and block of vertex v."""
    first, corners, stencils, shares, stiffness, margin, points, normals = data
    for at in range(first[v], first[v + 1]):
        e, corner = corners[at] // 3, corners[at] % 3
        d = sample_depth(x, stencils[e], shares[e], margin, points[e], normals[e])
        if d > 0.0:
            share = shares[e, corner]
            for i in range(3):
                g[i] -= 3.0 * stiffness[e] * d * d * share * normals[e, i]
                for j in range(3):
                    H[i, j] += 6.0 * stiffness[e] * d * share * share * normals[e, i] * normals[e, j]
    return 0.0


@njit(cache=True, error_model="numpy")
def _solve(data, x, w):
    """Solve one sample after the other."""
    stencils, shares, stiffness, margin, points, normals, force = data
    for e in range(len(stencils)):
        d = sample_depth(x, stencils[e], shares[e], margin, points[e], normals[e])
        if d > 0.0 or force[e] != 0.0:
            compliance = 1.0 / (2.0 * stiffness[e])
            slope = -1.5 * np.sqrt(d)  # of C along the normal
            total = compliance
            for c in range(3):
                total += w[stencils[e, c]] * (slope * shares[e, c]) ** 2
            change = -(d * np.sqrt(d) + compliance * force[e]) / total
            force[e] += change
            for c in range(3):
                for i in range(3):
                    x[stencils[e, c], i] += w[stencils[e, c]] * slope * shares[e, c] * normals[e, i] * change
    return 0.0
