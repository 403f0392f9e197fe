"""Gradient against energy and Hessian against gradient, term by term, by differences of fourth order."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from benchmarks.meshes import in_space, jittered_patch, random_rotation
from reference_sim.cloth import Cloth
from reference_sim.energies.area_barrier import AreaBarrier
from reference_sim.energies.bend_hinge import BendHinge
from reference_sim.energies.contact_penalty import ContactPenalty
from reference_sim.energies.energy import Energy
from reference_sim.energies.gravity import Gravity
from reference_sim.energies.inertia import Inertia
from reference_sim.energies.stretch_spring import StretchSpring
from reference_sim.energies.stretch_stvk import StretchStVK
from reference_sim.material import Material
from reference_sim.potential import Potential

DIRECTIONS = 4
STEP = 1e-3  # times a random direction of some hundredths of a metre
WEIGHTS = np.array([1, -8, 8, -1]) / 12  # at -2, -1, 1 and 2 steps


def error(kind: str, term: str) -> float:
    """Return the largest relative error of the "gradient" or the "hessian" along random directions."""
    energy, x = _in_disorder(term)
    claimed = Potential([energy]).hessian(x) if kind == "hessian" else energy.value_and_gradient(x)[1].ravel()
    of = 1 if kind == "hessian" else 0  # differences are of the gradient, or of the energy

    def differentiated(at: np.ndarray) -> np.ndarray:
        return np.ravel(energy.value_and_gradient(at)[of])

    return max(_error(differentiated, x, d, claimed @ d.ravel()) for d in _directions(x))


def _error(
    function: Callable[[np.ndarray], np.ndarray], x: np.ndarray, d: np.ndarray, claimed: np.ndarray
) -> float:
    at = [function(x + steps * STEP * d) for steps in (-2, -1, 1, 2)]
    difference = sum(weight * value for weight, value in zip(WEIGHTS, at)) / STEP
    size = float(np.linalg.norm(difference))
    if size < 1e-9:
        raise RuntimeError("a derivative of nothing proves nothing")
    return float(np.linalg.norm(claimed - difference)) / size


def _directions(x: np.ndarray) -> np.ndarray:
    return np.random.default_rng(1).normal(0, 0.03, (DIRECTIONS, *x.shape))


def _in_disorder(term: str) -> tuple[Energy, np.ndarray]:
    points, faces = jittered_patch(5)
    cloth = Cloth(in_space(points), faces, Material())
    random = np.random.default_rng(0)
    x = cloth.rest_positions @ random_rotation(8).T + random.normal(0, 0.05, cloth.rest_positions.shape)
    if term == "area_barrier":
        x = 0.4 * x  # a sixth of the area: the barrier holds
    if term == "inertia":
        energy: Energy = Inertia(cloth, 1 / 30)
    elif term == "collision":
        energy = _all_in_contact(cloth, x, random)
    elif term == "bending":
        energy = BendHinge(cloth, rest_angles=0.3)
    else:
        plain = {
            "strain": StretchStVK, "spring": StretchSpring, "gravity": Gravity, "area_barrier": AreaBarrier,
        }  # fmt: skip
        energy = plain[term](cloth)
    return energy, x


def _all_in_contact(cloth: Cloth, x: np.ndarray, random: np.random.Generator) -> ContactPenalty:
    """Return contact of every sample, deep in a margin of a metre, against a plane of its own."""
    contact = ContactPenalty(cloth, margin=1.0, stiffness=1.0)
    samples = contact.sample_matrix @ x
    normals = random.normal(size=samples.shape)
    contact.normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    contact.points = samples - random.uniform(0.2, 0.8, (len(samples), 1)) * contact.normals
    return contact
