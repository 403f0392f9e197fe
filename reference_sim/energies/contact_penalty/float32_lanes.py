"""The contact penalty in float32, LANES_FLOAT32 samples at a time: the kernel of early-stopped L-BFGS.

See kernels.float32_lanes for the layout.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from reference_sim.contact.closest_point import halved
from reference_sim.kernels.float32_layout import (
    FAST,
    LANES_FLOAT32,
    THREE,
    Float32Lanes,
    empty_state,
    lay_out,
    to_blocks,
)
from reference_sim.kernels.kernel_cache import njit

if TYPE_CHECKING:
    from reference_sim.energies.contact_penalty.definition import ContactPenalty


def lanes(term: ContactPenalty) -> Float32Lanes:
    """Lay the samples of the term out, those of a block near each other; a step freezes planes and depths."""
    order = halved(term.rest_samples)
    stencils = term.stencils[order]
    vertices, constants = lay_out(stencils, term.weights[order], term.stiffness[order])
    weights = to_blocks(term.weights[order])  # in float64: a third of metres is no third in float32
    planes = empty_state(vertices, 4)

    def freeze(x0: np.ndarray) -> tuple:
        near = _depths(
            x0.ravel(), order, vertices, weights, term.points, term.normals, term.margin, term.reach(), planes
        )
        return near, vertices, constants, planes

    return Float32Lanes(contact_gradient, freeze, contact_stiffness, stencils)


@njit(cache=True)
def _depths(x, order, vertices, constants, points, normals, margin, reach, state):
    """Write normals and depths of the samples at x (3V,) into state, in blocks.

    Returns the blocks (n,) with a sample whose plane is within reach (S,) [m].
    """
    near, count = np.empty(len(state), np.int64), 0
    for place in range(len(order)):
        s, block, lane = order[place], place // LANES_FLOAT32, place % LANES_FLOAT32
        i, j, k = (
            vertices[block, lane],
            vertices[block, LANES_FLOAT32 + lane],
            vertices[block, 2 * LANES_FLOAT32 + lane],
        )
        u, v, w = (
            constants[block, lane],
            constants[block, LANES_FLOAT32 + lane],
            constants[block, 2 * LANES_FLOAT32 + lane],
        )
        depth = margin
        for a in range(3):
            sample = u * x[i + a] + v * x[j + a] + w * x[k + a]
            depth -= normals[s, a] * (sample - points[s, a])
            state[block, a * LANES_FLOAT32 + lane] = normals[s, a]
        state[block, 3 * LANES_FLOAT32 + lane] = depth
        if margin - depth > reach[s] or (count > 0 and near[count - 1] == block):
            continue
        near[count] = block
        count += 1
    return near[:count]


@njit(cache=True, fastmath=FAST, error_model="numpy")
def contact_gradient(data, u, gradient, s):
    """Return the energy [J] of the contact penalty and add to gradient (3V,) [N].

    near: the blocks that are looked at. With L for LANES_FLOAT32: vertices (B, 3 L): 3 times the vertex.
    constants (B, 4 L): weights, stiffness [J/m^3]. planes (B, 4 L): normal, and the depth of x_0 under the
    margin [m], below zero above it.
    """
    near, vertices, constants, planes = data
    total = 0.0
    for b in near:
        at, c, n = vertices[b], constants[b], planes[b]
        for g in range(LANES_FLOAT32):
            i, j, k = at[g], at[LANES_FLOAT32 + g], at[2 * LANES_FLOAT32 + g]
            for a in range(3):
                s[a * LANES_FLOAT32 + g] = u[i + a]
                s[(3 + a) * LANES_FLOAT32 + g] = u[j + a]
                s[(6 + a) * LANES_FLOAT32 + g] = u[k + a]
        deepest, energy = np.float32(0.0), np.float32(0.0)
        for g in range(LANES_FLOAT32):
            w0, w1, w2 = c[g], c[LANES_FLOAT32 + g], c[2 * LANES_FLOAT32 + g]
            x = w0 * s[g] + w1 * s[3 * LANES_FLOAT32 + g] + w2 * s[6 * LANES_FLOAT32 + g]
            y = w0 * s[LANES_FLOAT32 + g] + w1 * s[4 * LANES_FLOAT32 + g] + w2 * s[7 * LANES_FLOAT32 + g]
            z = w0 * s[2 * LANES_FLOAT32 + g] + w1 * s[5 * LANES_FLOAT32 + g] + w2 * s[8 * LANES_FLOAT32 + g]
            depth = n[3 * LANES_FLOAT32 + g] - (
                n[g] * x + n[LANES_FLOAT32 + g] * y + n[2 * LANES_FLOAT32 + g] * z
            )
            depth = max(depth, np.float32(0.0))
            stiffness = c[3 * LANES_FLOAT32 + g] * depth * depth
            energy += stiffness * depth
            s[9 * LANES_FLOAT32 + g] = -THREE * stiffness
            deepest = max(deepest, depth)
        if deepest == np.float32(0.0):
            continue
        total += float(energy)
        for g in range(LANES_FLOAT32):
            force = s[9 * LANES_FLOAT32 + g]
            if force == np.float32(0.0):
                continue
            for corner in range(3):
                part, i = force * c[corner * LANES_FLOAT32 + g], at[corner * LANES_FLOAT32 + g]
                for a in range(3):
                    gradient[i + a] += part * n[a * LANES_FLOAT32 + g]
    return total


@njit(cache=True, error_model="numpy")
def contact_stiffness(data, values):
    """Add the stiffness [N/m] of the samples that touch at x_0; returns 0."""
    near, _, constants, planes, places = data
    for b in near:
        for g in range(LANES_FLOAT32):
            depth = planes[b, 3 * LANES_FLOAT32 + g]
            if depth <= 0.0:
                continue
            curvature = 6.0 * constants[b, 3 * LANES_FLOAT32 + g] * depth
            for i in range(3):
                for j in range(3):
                    place = places[b, (3 * i + j) * LANES_FLOAT32 + g]
                    if place >= 0:
                        weights = constants[b, i * LANES_FLOAT32 + g] * constants[b, j * LANES_FLOAT32 + g]
                        values[place] += curvature * weights
    return 0.0
