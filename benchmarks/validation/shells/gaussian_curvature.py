"""Gaussian curvature as an energy: the part of a plate's bending that Poisson's ratio decides.

Kirchhoff's plate has the energy D/2 [tr(S)^2 - 2 (1 - nu) det(S)] per area, S the curvature tensor. So plates
of one D that differ in nu differ by a multiple of the total curvature, the integral of K = det(S). On a mesh
that is the sum of the angle defects of inner vertices (Descartes), and therefore a function of the border
alone (Gauss and Bonnet):

    sum of defects = 2 pi (inner vertices) - pi (faces) + sum of the face angles at border vertices
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

import reference_sim as sim
from benchmarks.validation.shells.plates import NU
from reference_sim import energies
from reference_sim.geometry.topology import boundary_loops, corner_angles

if TYPE_CHECKING:
    from torch import Tensor


class GaussianCurvature(energies.Energy):
    """Energy E = c (total curvature - that of the flat rest state), summed over the corners on the border.

    Args:
        cloth: the rest state; it has to be flat.
        stiffness: c [J].
    """

    name = "gaussian_curvature"

    def __init__(self, cloth: sim.Cloth, stiffness: float) -> None:
        self.cloth = cloth
        corners = np.stack([np.roll(cloth.faces, -k, axis=1) for k in range(3)], axis=1)  # tip, next, last
        on_border = np.isin(cloth.faces, np.concatenate(boundary_loops(cloth.faces)))
        self.stencils = corners[on_border]
        self.stiffness = stiffness
        self.rest_angles = corner_angles(cloth.rest_positions, cloth.faces)[on_border]

    @classmethod
    def without_poisson_effect(cls, cloth: sim.Cloth, D: float) -> GaussianCurvature:
        """Return the term that makes a plate of nu = 0 of hinges on equilateral triangles, D [J] their C11.

        The two energies differ by D (nu_0 - nu) det(S) per area, nu_0 = 0 and nu that of the hinges.
        """
        return cls(cloth, -NU * D)

    def parameters(self) -> dict[str, Any]:
        """Return the stiffness [J]."""
        return {"stiffness_J": self.stiffness}

    def element_energy(self, u: Tensor) -> Tensor:
        """Return E [J] of each corner: u (..., N, 3, 3) [m] -> (..., N)."""
        import torch

        a, b = u[..., 1, :] - u[..., 0, :], u[..., 2, :] - u[..., 0, :]
        sine = torch.linalg.vector_norm(torch.linalg.cross(a, b), dim=-1)
        angles = torch.atan2(sine, (a * b).sum(-1))
        return self.stiffness * (angles - torch.as_tensor(self.rest_angles).to(u))
