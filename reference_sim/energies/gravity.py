"""Weight: E = m g (y - y0) for each vertex, y up (SNUG, eq. 12). y0 only moves the zero of the energy."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from reference_sim.cloth import Cloth
from reference_sim.energies.energy import Energy
from reference_sim.material import GRAVITY

if TYPE_CHECKING:
    from torch import Tensor

    from reference_sim.kernels.fast_kernels import BatchKernel


def batch(term: Gravity) -> BatchKernel:
    """Return the kernel of training on a CPU."""
    weights = term.weights.astype(np.float32)
    zero = np.float32(term.weights.sum() * term.origin_height)

    def run(x: np.ndarray, gradients: np.ndarray) -> np.ndarray:
        gradients[:, :, 1] += weights[:, None]
        return weights @ x[:, :, 1] - zero

    return run


class Gravity(Energy):
    """Potential energy of the weight [J] of each vertex of `cloth`; y0 [m], acceleration g [m/s^2]."""

    name = "gravity"
    constant = (3,)
    kernels: ClassVar = {"vertex_weights": lambda term: term.weights, "training_batch": batch}

    def __init__(
        self, cloth: Cloth, origin_height: float = 0.0, *, acceleration: float = GRAVITY
    ) -> None:
        self.cloth = cloth
        self.stencils = np.arange(cloth.vertex_count)[:, None]
        self.weights = cloth.masses * acceleration
        self.origin_height = float(origin_height)

    def parameters(self) -> dict[str, Any]:
        """Return y0 [m] and the total weight [N]."""
        return {"origin_height_m": self.origin_height, "total_weight_N": float(self.weights.sum())}

    def arrays(self) -> dict[str, np.ndarray]:
        """Return vertices (V, 1) and their weights (V,) [N]."""
        return {"vertices": self.stencils, "weights_N": self.weights}

    def element_energy(self, u: Tensor) -> Tensor:
        """Return E [J] of each vertex: u (..., N, 1, 3) [m] -> (..., N)."""
        import torch

        return torch.as_tensor(self.weights).to(u) * (u[..., 0, 1] - self.origin_height)

    def value_and_gradient(self, x: np.ndarray) -> tuple[float, np.ndarray]:
        """Return the sum of E [J] and its gradient (V, 3) [N] at x (V, 3) [m]."""
        x = self.check_positions(x)
        gradient = np.zeros_like(x)
        gradient[:, 1] = self.weights
        return float(self.weights @ (x[:, 1] - self.origin_height)), gradient

    def active_hessian_blocks(self, x: np.ndarray, convexity: float) -> tuple[np.ndarray, np.ndarray]:
        """Return no blocks: the energy is linear."""
        return np.arange(0), np.zeros((0, 3, 3))
