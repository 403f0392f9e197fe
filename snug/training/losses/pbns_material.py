"""The material of PBNS itself (Bertiche et al. 2021): springs, hinges, uniform mass, squared contact.

    edges    15 (l - l0)^2                  [J]  reference_sim's StretchSpring, exactly
    bending  5e-5 |n0 - n1|^2               [J]  reference_sim's BendHinge, 5e-5 theta^2: the nearest there is
    gravity  m g y, m = 0.3 kg/m^2 A / V    [J]  the same mass for every vertex
    contact  25 max(4 mm - n.(x - c), 0)^2  [J]  on vertices, with the contact planes of all our training

|n0 - n1|^2 = 4 sin^2(theta/2) = theta^2 - theta^4/12 + ...: the hinge has 3 % more at 0.6 rad, and goes on
growing where a folded edge no longer resists. Constants as in the authors' own training. No inertia: a static
method, on the mean body.
"""

from __future__ import annotations

import numpy as np

from reference_sim.cloth import Cloth
from reference_sim.energies import BendHinge, ContactPenalty, Gravity, StretchSpring
from reference_sim.energies.energy import Energy
from reference_sim.material import GRAVITY, Material

BENDING = 5e-5  # [J]
AREAL_DENSITY = 0.3  # [kg/m^2]
CONTACT_STIFFNESS = 25.0  # [J/m^2] on each vertex
MARGIN = 4e-3  # [m]


def spring_terms(cloth: Cloth) -> tuple[Energy, Energy, Energy]:
    """Return membrane, bending and gravity of PBNS for the rest state of `cloth`, whatever its material."""
    hinges = Material(bending_stiffness=2 * BENDING)
    springs = Cloth(cloth.rest_positions, cloth.faces, hinges, pins=cloth.pins, rest_uv=cloth.rest_uv)
    gravity = Gravity(springs)
    uniform = AREAL_DENSITY * cloth.areas.sum() / cloth.vertex_count
    gravity.weights = np.full(cloth.vertex_count, uniform * GRAVITY)
    return StretchSpring(springs), BendHinge(springs, scaling="none"), gravity


class SquaredContact(ContactPenalty):
    """Contact energy k max(eps - d, 0)^2 [J] of each vertex, with the planes and samples of ContactPenalty.

    For training alone: its derivatives are those of automatic differentiation.
    """

    power = 2
    value_and_gradient, add_hessian = Energy.value_and_gradient, Energy.add_hessian
    scalar_stiffness = Energy.scalar_stiffness

    def __init__(self, cloth: Cloth) -> None:
        super().__init__(cloth, samples="vertices", margin=MARGIN, per_sample_stiffness=CONTACT_STIFFNESS)
