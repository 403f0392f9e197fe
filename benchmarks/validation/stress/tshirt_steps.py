"""One time step of a T-shirt of 300 vertices on a body, stressed as a case asks for."""

from __future__ import annotations

import dataclasses
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.validation.case import Measurement
from benchmarks.validation.solvers.convergence_check import StressStep, solve_and_check
from benchmarks.validation.stress.sheet_steps import DT, prepared
from benchmarks.validation.stress.sheet_steps import warm_up as warm_up  # that of its cases too
from reference_sim.cloth import Cloth
from reference_sim.energies.bend_hinge import BendHinge
from reference_sim.energies.contact_penalty import ContactPenalty
from reference_sim.energies.energy import Energy
from reference_sim.energies.gravity import Gravity
from reference_sim.energies.stretch_stvk import StretchStVK
from reference_sim.material import GRAVITY, Material
from reference_sim.obstacle import Obstacle
from snug.body.parametric_body import Body
from snug.garments.templates import find_template

if TYPE_CHECKING:
    from snug.garments.garment import Garment

VERTICES = 300
ARMS = 4.0  # [degrees] that both arms go down in an ordinary step
SHOULDERS = {"left_shoulder": -1.0, "right_shoulder": 1.0}


def solve_shirt(*, counted: bool = False, **options: Any) -> Measurement:
    """Solve the step of the shirt as a simulation does, and check it; options: see `shirt_step`."""
    return solve_and_check(shirt_step(**options), counted=counted)


def shirt_step(
    *,
    stiffness: float = 1.0,
    gravity: float = 1.0,
    dt: float = DT,
    noise: float = 2e-3,
    speed: float = 1.0,
    scale: float = 1.0,
    arms: float = ARMS,
    jump: float = 0.0,
    turn: float = 0.0,
) -> StressStep:
    """Make the step from the shirt's rest shape on a body in T-pose that moves its arms.

    Args:
        stiffness: factor on Young's modulus.
        gravity: factor on g.
        dt: [s].
        noise: scale [m] of the disorder of the start.
        speed: scale [m/s] of its velocities.
        scale: size of the shirt at the start about its centre; its rest shape stays.
        arms: degrees by which both arms go down within the step.
        jump: [m] by which the body moves sideways, while the guess leaves the shirt where it was; otherwise
            the guess carries the shirt along with the body.
        turn: degrees by which the body turns about its axis, with such a guess.
    """
    random = np.random.default_rng(11)
    body, garment = _dressed()
    material = dataclasses.replace(Material(), young_modulus=70e3 * stiffness)
    cloth = Cloth(garment.rest_positions, garment.faces, material)
    obstacle = _moving(body, arms, jump, turn)
    centre = cloth.rest_positions.mean(axis=0)
    x = centre + scale * (cloth.rest_positions - centre) + random.normal(0, noise, cloth.rest_positions.shape)
    v = random.normal(0, 1.0, x.shape) * speed
    energies: list[Energy] = [StretchStVK(cloth), BendHinge(cloth)]
    energies += [Gravity(cloth, acceleration=gravity * GRAVITY), ContactPenalty(cloth)]
    left_behind = jump or turn
    guess = x if left_behind else obstacle.transported(x, 1, cloth.rest_positions)
    return prepared(cloth, energies, dt, x, v, guess=guess, obstacle=obstacle, frame=1)


@lru_cache(maxsize=1)
def _dressed() -> tuple[Body, Garment]:

    body = Body.load()
    return body, find_template("tshirt").tailor(body, vertices=VERTICES)


def _moving(body: Body, arms: float, jump: float, turn: float) -> Obstacle:
    """Return the body in T-pose, then moved."""
    poses = np.zeros((2, len(body.parents), 3))
    for name, side in SHOULDERS.items():
        poses[1, body.joint_names.index(name), 2] = side * np.deg2rad(arms)
    poses[1, 0, 1] = np.deg2rad(turn)
    translations = np.array([[0.0, 0.0, 0.0], [jump, 0.0, 0.0]])
    return Obstacle(body.vertices(poses, translations), body.faces, rest_positions=body.shaped())
