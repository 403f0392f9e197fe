"""A uniform wind along z: E = -p a_i z_i for each vertex i with its share a_i of the rest area, p in Pa."""

import numpy as np
import torch

from reference_sim import Cloth
from reference_sim.energies import Energy


class Wind(Energy):
    """Work of the wind [J]."""

    name = "wind"

    def __init__(self, cloth: Cloth, *, pressure: float = 0.5) -> None:
        self.cloth = cloth
        self.stencils = np.arange(cloth.vertex_count)[:, None]
        self.forces = pressure * cloth.vertex_areas

    def element_energy(self, u: torch.Tensor) -> torch.Tensor:
        """Return the energy of each vertex [J]: u (..., V, 1, 3) [m] -> (..., V)."""
        return -torch.as_tensor(self.forces).to(u) * u[..., 0, 2]
