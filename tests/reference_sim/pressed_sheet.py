"""A sheet pressed into a sphere, for solvers and sweeps."""

from __future__ import annotations

import numpy as np

from benchmarks.meshes import sphere, square_sheet
from reference_sim import Cloth, Material, Obstacle, Potential
from reference_sim.energies import BendHinge, ContactPenalty, Gravity, Inertia, Step, StretchStVK

DT = 1 / 30


def pressed(cells: int = 9) -> tuple[Potential, np.ndarray]:
    """All terms in the midst of a step, a moving, pinned sheet pressed into a sphere; its guess."""
    positions, faces = square_sheet(cells, 0.3)
    positions[:, 1] += 0.098
    cloth = Cloth(positions, faces, Material(), pins=(0, 6))
    bend = BendHinge(cloth, rest_angles=np.random.default_rng(1).uniform(-1, 1, len(cloth.hinges)))
    terms = [StretchStVK(cloth), bend, Gravity(cloth), ContactPenalty(cloth), Inertia(cloth, DT)]
    velocity = np.random.default_rng(2).normal(0, 0.2, positions.shape)
    velocity[cloth.pins] = 0.0
    guess = positions + DT * velocity
    potential = Potential(terms)
    potential.prepare(Step(positions, velocity, guess, DT, Obstacle(*sphere(0.1, 12))))
    return potential, guess
