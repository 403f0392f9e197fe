"""The contact penalty of one sample at a time: the kernels of vertex block descent and XPBD.

See kernels.element_sweeps for the layout.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from reference_sim.energies.contact_penalty.definition import sample_depth
from reference_sim.kernels.element_sweeps import Constraints, VertexBlocks
from reference_sim.kernels.kernel_cache import njit

if TYPE_CHECKING:
    from reference_sim.energies.contact_penalty.definition import ContactPenalty


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
