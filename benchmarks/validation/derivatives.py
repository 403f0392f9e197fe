"""Gradient against energy and Hessian against gradient, term by term, by differences of fourth order."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

import reference_sim as sim
from benchmarks.meshes import jittered_patch, random_rotation
from benchmarks.validation.case import known_answer
from benchmarks.validation.equilibrium import flat_cloth
from reference_sim import energies

DIRECTIONS = 4
STEP = 1e-3  # times a random direction of some hundredths of a metre
WEIGHTS = np.array([1, -8, 8, -1]) / 12  # at -2, -1, 1 and 2 steps


TERMS = ("strain", "spring", "bending", "gravity", "inertia", "collision")
DIFFERENTIATED = {"gradient": 0, "hessian": 1}  # the energy, or the gradient


@known_answer(
    {
        f"{kind}_of_{term}": {"kind": kind, "term": term}
        for kind in DIFFERENTIATED
        for term in TERMS
        if (kind, term) != ("hessian", "gravity")  # it is zero
    },
    expected=0.0, tolerance=1e-7, reason="round-off over a step of 1e-3, and its fourth power",
)  # fmt: skip
def error(kind: str, term: str) -> float:
    """Return the relative error of a term's gradient or Hessian beside differences of fourth order."""
    energy, x = _in_disorder(term)
    errors = []
    for direction in np.random.default_rng(1).normal(0, 0.03, (DIRECTIONS, *x.shape)):
        off, size = off_by(energy, x, direction, kind)
        if size < 1e-9:
            raise RuntimeError("a derivative of nothing proves nothing")
        errors.append(off / size)
    return max(errors)


def off_by(energy: energies.Energy, x: np.ndarray, d: np.ndarray, kind: str) -> tuple[float, float]:
    """Return the error of a gradient or Hessian at x (V,3) along d (V,3) [m], and the size due."""
    hessian = sim.Potential([energy]).hessian(x) if kind == "hessian" else None
    claimed = energy.value_and_gradient(x)[1].ravel() if hessian is None else hessian
    at = [energy.value_and_gradient(x + steps * STEP * d) for steps in (-2, -1, 1, 2)]
    values = [np.ravel(pair[DIFFERENTIATED[kind]]) for pair in at]
    difference = sum(weight * value for weight, value in zip(WEIGHTS, values)) / STEP
    return float(np.linalg.norm(claimed @ d.ravel() - difference)), float(np.linalg.norm(difference))


def _in_disorder(term: str) -> tuple[energies.Energy, np.ndarray]:
    cloth = flat_cloth(*jittered_patch(5))
    random = np.random.default_rng(0)
    x = cloth.rest_positions @ random_rotation(8).T + random.normal(0, 0.05, cloth.rest_positions.shape)
    make: dict[str, Callable[[], energies.Energy]] = {
        "strain": lambda: energies.StretchStVK(cloth),
        "spring": lambda: energies.StretchSpring(cloth),
        "bending": lambda: energies.BendHinge(cloth, rest_angles=0.3),
        "gravity": lambda: energies.Gravity(cloth),
        "inertia": lambda: energies.Inertia(cloth, 1 / 30),
        "collision": lambda: _all_in_contact(cloth, x, random),
    }
    return make[term](), x


def _all_in_contact(
    cloth: sim.Cloth, x: np.ndarray, random: np.random.Generator
) -> energies.ContactPenalty:
    """Return contact of every sample, deep in a margin of a metre, against a plane of its own."""
    contact = energies.ContactPenalty(cloth, margin=1.0, stiffness=1.0)
    samples = contact.sample_matrix @ x
    normals = random.normal(size=samples.shape)
    contact.normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    contact.points = samples - random.uniform(0.2, 0.8, (len(samples), 1)) * contact.normals
    return contact
