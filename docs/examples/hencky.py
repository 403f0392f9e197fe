"""Springs with a logarithmic strain (Hencky): E = k l0 / 2 ln(l / l0)^2 [J] of each edge, k in N."""

from typing import ClassVar

import numpy as np
import torch

from reference_sim import Cloth
from reference_sim.energies import Energy
from reference_sim.kernels.kernel_cache import njit
from reference_sim.kernels.lanes import (
    FAST,
    LANES,
    TINY,
    Float32Lanes,
    empty_state,
    lay_out,
    set_edges,
)


@njit(cache=True, fastmath=FAST, error_model="numpy")
def spring_gradient(data, u, gradient, scratch):
    """Add the gradient at displacements u to `gradient`; return the energy."""
    vertices, constants, edges = data
    L, half, total = LANES, np.float32(0.5), 0.0
    for b in range(len(vertices)):
        for g in range(L):
            i, j = vertices[b, g], vertices[b, L + g]
            dx = edges[b, g] + u[j] - u[i]
            dy = edges[b, L + g] + u[j + 1] - u[i + 1]
            dz = edges[b, 2 * L + g] + u[j + 2] - u[i + 2]
            square = dx * dx + dy * dy + dz * dz + TINY
            rest = constants[b, L + g] ** 2 + TINY
            strain = half * np.log(square / rest)
            total += half * constants[b, g] * strain * strain
            force = constants[b, g] * strain / square
            scratch[g], scratch[L + g], scratch[2 * L + g] = force * dx, force * dy, force * dz
        for g in range(L):
            i, j = vertices[b, g], vertices[b, L + g]
            for axis in range(3):
                gradient[j + axis] += scratch[axis * L + g]
                gradient[i + axis] -= scratch[axis * L + g]
    return total


def lanes(term: "HenckySpring") -> Float32Lanes:
    """Return the gradient in float32, which takes several edges at once."""
    vertices, constants = lay_out(term.stencils, term.stiffness, term.lengths)
    edges = empty_state(vertices, 3)

    def freeze(x0: np.ndarray) -> tuple:
        set_edges(x0, vertices, 1, edges)
        return vertices, constants, edges

    return Float32Lanes(spring_gradient, freeze)


class HenckySpring(Energy):
    """Springs along the edges of the mesh; `stiffness` k in N."""

    name = "hencky"
    kernels: ClassVar = {"float32_lanes": lanes}

    def __init__(self, cloth: Cloth, *, stiffness: float = 10.0) -> None:
        self.cloth, self.stencils, self.lengths = cloth, cloth.edges, cloth.edge_lengths
        self.stiffness = stiffness * self.lengths

    def element_energy(self, u: torch.Tensor) -> torch.Tensor:
        """Return the energy (N,) [J] of edges from their ends u (N, 2, 3) [m]."""
        length = torch.linalg.vector_norm(u[..., 1, :] - u[..., 0, :], dim=-1)
        strain = torch.log(length / torch.as_tensor(self.lengths).to(u))
        return 0.5 * torch.as_tensor(self.stiffness).to(u) * strain**2
