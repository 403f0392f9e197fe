"""A sheet at rest on a plane: the depth and the force of the penalty are known."""

from __future__ import annotations

import numpy as np

from benchmarks.meshes import in_space, jittered_patch, lying
from benchmarks.validation.convergence import demand_converged
from reference_sim.cloth import Cloth
from reference_sim.energies.contact_penalty import DEFAULT_STIFFNESS, ContactPenalty
from reference_sim.energies.energy import Step
from reference_sim.energies.gravity import Gravity
from reference_sim.energies.stretch_stvk import StretchStVK
from reference_sim.material import GRAVITY, Material
from reference_sim.minimise.minimisers import minimise
from reference_sim.obstacle import Obstacle
from reference_sim.potential import Potential


def penalty_depth() -> float:
    """Return the mean depth into the margin over sqrt(rho_a g / (3 k)), contact on vertices.

    A vertex of area a carries rho_a a g and is pushed by 3 k a depth^2: the area cancels.
    """
    contact, x, areal_density = _sheet_at_rest("vertices")
    exact = np.sqrt(areal_density * GRAVITY / (3 * DEFAULT_STIFFNESS))
    return float(((contact.margin - x[:, 1]) / exact).mean())


def sampled_area() -> float:
    """Return the area of all contact samples of a sheet over its own: each kind carries it once."""
    points, faces = jittered_patch(8)
    contact = ContactPenalty(Cloth(in_space(points), faces, Material()))
    return float(contact.sample_areas.sum())  # the sheet has unit area


def contact_force() -> float:
    """Return the total upward contact force over the weight of the sheet, all contact samples on."""
    contact, x, areal_density = _sheet_at_rest("all")
    upward = -contact.value_and_gradient(x)[1][:, 1].sum()
    return float(upward / (areal_density * GRAVITY))  # the sheet has unit area


def _sheet_at_rest(samples: str) -> tuple[ContactPenalty, np.ndarray, float]:
    points, faces = jittered_patch(8)
    material = Material()
    rest = lying(points) - [0.5, 0.0, 0.5]
    cloth = Cloth(rest, faces[:, ::-1], material)
    floor = Obstacle(*box())
    contact = ContactPenalty(cloth, samples=samples)
    start = rest + np.array([0.0, 0.002, 0.0])
    still = np.zeros_like(start)
    contact.prepare(Step(previous=start, velocity=still, guess=start, dt=1 / 30, obstacle=floor))
    potential = Potential([StretchStVK(cloth), Gravity(cloth), contact])
    result = demand_converged(minimise(potential, start), "the sheet")
    return contact, result.positions, material.areal_density


def box() -> tuple[np.ndarray, np.ndarray]:
    """Return a closed box under the plane y = 0, 2 m to each side and 1 m deep; outward faces."""
    corners = np.array([[x, y, z] for x in (-2.0, 2.0) for y in (-1.0, 0.0) for z in (-2.0, 2.0)])
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))])
    return corners, faces
