"""Gradient against energy and Hessian against gradient, term by term, by differences of fourth order."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

import reference_sim as sim
from benchmarks.meshes import in_space, jittered_patch, random_rotation
from benchmarks.validation.case import known_answer
from reference_sim import energies

DIRECTIONS = 4
STEP = 1e-3  # times a random direction of some hundredths of a metre
WEIGHTS = np.array([1, -8, 8, -1]) / 12  # at -2, -1, 1 and 2 steps


TERMS = ("strain", "spring", "bending", "gravity", "inertia", "collision", "area_barrier")


@known_answer(
    {
        f"{kind}_of_{term}": {"kind": kind, "term": term}
        for kind in ("gradient", "hessian")
        for term in TERMS
        if (kind, term) != ("hessian", "gravity")  # it is zero
    },
    expected=0.0, tolerance=1e-7, reason="round-off over a step of 1e-3, and its fourth power",
)  # fmt: skip
def error(kind: str, term: str) -> float:
    """Return the relative error of a term's gradient or Hessian beside differences of fourth order."""
    energy, x = _in_disorder(term)
    claimed = (
        sim.Potential([energy]).hessian(x) if kind == "hessian" else energy.value_and_gradient(x)[1].ravel()
    )
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


def _in_disorder(term: str) -> tuple[energies.Energy, np.ndarray]:
    points, faces = jittered_patch(5)
    cloth = sim.Cloth(in_space(points), faces, sim.Material())
    random = np.random.default_rng(0)
    x = cloth.rest_positions @ random_rotation(8).T + random.normal(0, 0.05, cloth.rest_positions.shape)
    if term == "area_barrier":
        x = 0.4 * x  # a sixth of the area: the barrier holds
    if term == "inertia":
        energy: energies.Energy = energies.Inertia(cloth, 1 / 30)
    elif term == "collision":
        energy = _all_in_contact(cloth, x, random)
    elif term == "bending":
        energy = energies.BendHinge(cloth, rest_angles=0.3)
    else:
        plain = {"strain": "StretchStVK", "spring": "StretchSpring", "gravity": "Gravity"}
        energy = getattr(energies, plain.get(term, "AreaBarrier"))(cloth)
    return energy, x


def _all_in_contact(cloth: sim.Cloth, x: np.ndarray, random: np.random.Generator) -> energies.ContactPenalty:
    """Return contact of every sample, deep in a margin of a metre, against a plane of its own."""
    contact = energies.ContactPenalty(cloth, margin=1.0, stiffness=1.0)
    samples = contact.sample_matrix @ x
    normals = random.normal(size=samples.shape)
    contact.normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    contact.points = samples - random.uniform(0.2, 0.8, (len(samples), 1)) * contact.normals
    return contact
