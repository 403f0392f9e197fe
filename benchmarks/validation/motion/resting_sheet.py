"""A sheet at rest on a plane: the depth and the force of the penalty are known."""

from __future__ import annotations

import numpy as np

import reference_sim as sim
from benchmarks.meshes import in_space, jittered_patch, lying
from benchmarks.validation.case import known_answer
from benchmarks.validation.convergence import demand_converged
from reference_sim import energies


@known_answer(expected=1.0, tolerance=1e-3, reason="the depth follows the load by a square root")
def penalty_depth() -> float:
    """Return the resting depth of a sheet in the margin of a plane, mean, over sqrt(rho_a g / (3 k)).

    A vertex of area a carries rho_a a g and is pushed by 3 k a depth^2: the area cancels.
    """
    from reference_sim.energies.contact_penalty import DEFAULT_STIFFNESS

    contact, x, areal_density = _sheet_at_rest("vertices")
    exact = np.sqrt(areal_density * sim.GRAVITY / (3 * DEFAULT_STIFFNESS))
    return float(((contact.margin - x[:, 1]) / exact).mean())


@known_answer(expected=3.0, tolerance=1e-12, reason="vertices, edges and faces carry it once each; round-off")
def contact_sampled_area() -> float:
    """Return the area of all contact samples of a sheet over its own: each kind carries it once."""
    points, faces = jittered_patch(8)
    contact = energies.ContactPenalty(sim.Cloth(in_space(points), faces, sim.Material()))
    return float(contact.sample_areas.sum())  # the sheet has unit area


@known_answer(expected=1.0, tolerance=2e-6, reason="the residual gradient that the solver may leave")
def contact_force_is_weight() -> float:
    """Return the total contact force over the weight of a sheet at rest on a plane, all samples on."""
    contact, x, areal_density = _sheet_at_rest("all")
    upward = -contact.value_and_gradient(x)[1][:, 1].sum()
    return float(upward / (areal_density * sim.GRAVITY))  # the sheet has unit area


def _sheet_at_rest(samples: str) -> tuple[energies.ContactPenalty, np.ndarray, float]:
    points, faces = jittered_patch(8)
    material = sim.Material()
    rest = lying(points) - [0.5, 0.0, 0.5]
    cloth = sim.Cloth(rest, faces[:, ::-1], material)
    floor = sim.Obstacle(*box())
    contact = energies.ContactPenalty(cloth, samples=samples)
    start = rest + np.array([0.0, 0.002, 0.0])
    still = np.zeros_like(start)
    contact.prepare(energies.Step(previous=start, velocity=still, guess=start, dt=1 / 30, obstacle=floor))
    potential = sim.Potential([energies.StretchStVK(cloth), energies.Gravity(cloth), contact])
    result = demand_converged(sim.minimise(potential, start), "the sheet")
    return contact, result.positions, material.areal_density


def box() -> tuple[np.ndarray, np.ndarray]:
    """Return a closed box under the plane y = 0, 2 m to each side and 1 m deep; outward faces."""
    corners = np.array([[x, y, z] for x in (-2.0, 2.0) for y in (-1.0, 0.0) for z in (-2.0, 2.0)])
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))])
    return corners, faces
