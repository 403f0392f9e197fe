"""Dead load: a constant force, the term that loads a structure in a check."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

import reference_sim as sim
from reference_sim import energies

if TYPE_CHECKING:
    from torch import Tensor


class DeadLoad(energies.Energy):
    """Dead load of each vertex, E = -f . x with constant forces f (V, 3) [N]."""

    name = "load"

    def __init__(self, cloth: sim.Cloth, forces: np.ndarray) -> None:
        self.cloth = cloth
        self.stencils = np.arange(cloth.vertex_count)[:, None]
        self.forces = forces

    def element_energy(self, u: Tensor) -> Tensor:
        """Return -f . u of each vertex, in torch."""
        import torch

        return -(torch.as_tensor(self.forces).to(u) * u[..., 0, :]).sum(-1)

    def value_and_gradient(self, x: np.ndarray) -> tuple[float, np.ndarray]:
        """Return the energy [J] and its gradient -f (V, 3) [N]."""
        return -float(np.vdot(self.forces, x)), -self.forces
