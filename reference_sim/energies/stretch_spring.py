"""Mass-spring stretch on edges: E = k (l - l0)^2, the membrane of PBNS (Bertiche et al. 2021), k = 15 N/m."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from reference_sim.cloth import Cloth
from reference_sim.energies.energy import Energy, demand_positive
from reference_sim.kernels.kernel_cache import njit

if TYPE_CHECKING:
    from torch import Tensor


class StretchSpring(Energy):
    """Spring energy [J] of each edge of `cloth`; stiffness k [N/m], at least 0, of all edges alike."""

    name = "spring"
    constant = (1,)

    def __init__(self, cloth: Cloth, *, stiffness: float = 15.0) -> None:
        demand_positive("StretchSpring", or_zero=True, stiffness=stiffness)
        self.cloth = cloth
        self.stencils = cloth.edges
        self.rest_lengths = cloth.edge_lengths
        self.stiffness = float(stiffness)

    def parameters(self) -> dict[str, Any]:
        """Return the stiffness [N/m]."""
        return {"stiffness_N_per_m": self.stiffness}

    def arrays(self) -> dict[str, np.ndarray]:
        """Return vertices (E, 2) and rest lengths (E,) [m] of the springs."""
        return {"vertices": self.stencils, "rest_lengths_m": self.rest_lengths}

    def element_energy(self, u: Tensor) -> Tensor:
        """Return E [J] of each edge: u (..., N, 2, 3) [m] -> (..., N)."""
        import torch

        length = torch.linalg.vector_norm(u[..., 1, :] - u[..., 0, :], dim=-1)
        return self.stiffness * (length - torch.as_tensor(self.rest_lengths).to(u)) ** 2

    def value_and_gradient(self, x: np.ndarray) -> tuple[float, np.ndarray]:
        """Return the sum of E [J] and its gradient (V, 3) [N] at x (V, 3) [m]."""
        x = self.check_positions(x)
        gradient = np.zeros_like(x)
        return _gradient(x, self.stencils, self.rest_lengths, self.stiffness, gradient), gradient

    def active_hessian_blocks(self, x: np.ndarray, convexity: float) -> tuple[np.ndarray, np.ndarray]:
        """Return +-2k [n n^T + (1 - l0/l)(I - n n^T)], see Energy.

        A spring shorter than l0 is negative across itself.
        """
        d = x[self.stencils[:, 1]] - x[self.stencils[:, 0]]
        length = np.linalg.norm(d, axis=1)
        n = d / length[:, None]
        outer = n[:, :, None] * n[:, None, :]
        slack = (1 - self.rest_lengths / length)[:, None, None]
        slack = np.where(slack < 0, (1 - convexity) * slack, slack)
        block = 2 * self.stiffness * (outer + slack * (np.eye(3) - outer))
        return np.arange(len(block)), np.block([[block, -block], [-block, block]])

    def scalar_stiffness(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the edges (N,) and their stiffness (N, 2, 2) [N/m] along themselves, in every direction."""
        block = 2 * self.stiffness * np.array([[1.0, -1.0], [-1.0, 1.0]])
        return np.arange(len(self.stencils)), np.broadcast_to(block, (len(self.stencils), 2, 2))


@njit(cache=True, error_model="numpy")
def _gradient(x, edges, rest_lengths, stiffness, gradient):
    total = 0.0
    for e in range(edges.shape[0]):
        a, b = edges[e]
        dx, dy, dz = x[b, 0] - x[a, 0], x[b, 1] - x[a, 1], x[b, 2] - x[a, 2]
        length = np.sqrt(dx * dx + dy * dy + dz * dz)
        stretch = length - rest_lengths[e]
        total += stiffness * stretch * stretch
        s = 2 * stiffness * stretch / length
        gradient[a, 0] -= s * dx
        gradient[a, 1] -= s * dy
        gradient[a, 2] -= s * dz
        gradient[b, 0] += s * dx
        gradient[b, 1] += s * dy
        gradient[b, 2] += s * dz
    return total
