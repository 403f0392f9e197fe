"""One time step of a small sheet in a state that breaks solvers: 0.4 m wide, 81 vertices, unless said.

A step has initial positions and velocities (`initial_conditions.py`), and factors on the material, the weight
and the time step. What stands in a case's options is all that differs from an ordinary step at 1/30 s.
"""

from __future__ import annotations

import dataclasses
from functools import cache
from typing import Any

import numpy as np

from benchmarks.meshes import sphere, square_sheet
from benchmarks.validation.case import Measurement
from benchmarks.validation.solvers.convergence_check import (
    StressStep,
    check_result,
    lbfgs_then_newton,
    solve_and_check,
)
from benchmarks.validation.stress.initial_conditions import INITIAL_POSITIONS, REST_SHAPES, initial_velocities
from reference_sim.cloth import Cloth
from reference_sim.energies.area_barrier import AreaBarrier
from reference_sim.energies.bend_hinge import BendHinge
from reference_sim.energies.contact_penalty import ContactPenalty
from reference_sim.energies.energy import Energy, Step
from reference_sim.energies.gravity import Gravity
from reference_sim.energies.inertia import Inertia
from reference_sim.energies.stretch_stvk import StretchStVK
from reference_sim.material import GRAVITY, Material
from reference_sim.obstacle import Obstacle
from reference_sim.potential import Potential

CELLS, SIZE, DT = 8, 0.4, 1.0 / 30.0
PINS = {"corners": (0, CELLS), "none": (), "side": tuple(range(CELLS + 1))}
MARGIN = 4e-3  # [m] of the contact penalty


def solve_sheet(*, counted: bool = False, **options: Any) -> Measurement:
    """Solve the step of a sheet as a simulation does, and check it; options: see `sheet_step`."""
    return solve_and_check(sheet_step(**options), counted=counted)


@cache
def warm_up() -> None:
    """Compile the kernels of all steps, however long that takes."""
    step = sheet_step(body="ball", terms="membrane+bending+area")
    check_result(step, lbfgs_then_newton(step.potential, step.guess))


def sheet_step(
    *,
    stiffness: float = 1.0,
    bending: float = 1.0,
    ratio: float | None = None,
    mass: float = 1.0,
    gravity: float = 1.0,
    dt: float | None = DT,
    pins: str = "corners",
    start: str = "noisy",
    speed: float | str = 1.0,
    scaling: str = "length_area",
    rest_angles: float | str = 0.0,
    shape: str = "even",
    size: float = 1.0,
    terms: str = "membrane+bending",
    body: str = "",
    contact: float = 1.0,
) -> StressStep:
    """Make a step of a sheet.

    Args:
        stiffness: factor on Young's modulus.
        bending: factor on the hinge stiffness.
        mass: factor on the density.
        gravity: factor on g.
        contact: factor on the contact stiffness.
        scaling: of the hinges, see BendHinge.
        ratio: hinge stiffness over membrane modulus and squared mean edge, instead of `bending`.
        dt: time step [s]; None leaves inertia out.
        pins: "corners", "side" or "none".
        start: name in `INITIAL_POSITIONS`.
        speed: scale [m/s] of random velocities, or the name of a field in `VELOCITIES`.
        rest_angles: [rad] of every hinge, or "random" within half a turn.
        shape: name in `REST_SHAPES`: how the mesh at rest differs from an even one.
        size: factor on the width of the sheet.
        terms: which of "membrane", "bending" and "area" (the barrier against collapse), joined by "+".
        body: name in `BODIES`; "" for none.
    """
    random = np.random.default_rng(11)
    rest, faces = square_sheet(CELLS, SIZE)
    rest = size * REST_SHAPES[shape](rest)
    material = dataclasses.replace(
        Material(), young_modulus=70e3 * stiffness, bending_stiffness=3.96e-5 * bending, density=426.0 * mass
    )
    cloth = Cloth(rest, faces, material, pins=PINS[pins])
    if ratio is not None:
        hinge = ratio * material.membrane_modulus * float(cloth.edge_lengths.mean()) ** 2
        cloth = dataclasses.replace(cloth, material=dataclasses.replace(material, bending_stiffness=hinge))
    x = INITIAL_POSITIONS[start](rest.copy(), random)
    v = initial_velocities(speed, x, rest, random)
    x[cloth.pins], v[cloth.pins] = rest[cloth.pins], 0.0
    energies: list[Energy] = [StretchStVK(cloth)] if "membrane" in terms else []
    if "bending" in terms:
        angles = random.uniform(-np.pi, np.pi, len(cloth.hinges)) if rest_angles == "random" else rest_angles
        energies.append(BendHinge(cloth, scaling=scaling, rest_angles=angles))
    if "area" in terms:
        energies.append(AreaBarrier(cloth, stiffness=100.0 * stiffness))
    energies.append(Gravity(cloth, acceleration=gravity * GRAVITY))
    if body:
        energies.append(ContactPenalty(cloth, stiffness=contact * 3.4e6, margin=MARGIN))
    return prepared(cloth, energies, dt, x, v, obstacle=BODIES[body]() if body else None)


def prepared(
    cloth: Cloth,
    energies: list[Energy],
    dt: float | None,
    previous: np.ndarray,
    velocity: np.ndarray,
    *,
    guess: np.ndarray | None = None,
    obstacle: Obstacle | None = None,
    frame: int = 0,
) -> StressStep:
    """Make the step from `previous` with `velocity`; the guess is the previous positions unless given."""
    guess = previous if guess is None else guess
    potential = Potential([*energies, Inertia(cloth, dt)] if dt else energies)
    potential.prepare(Step(previous, velocity, guess, dt or DT, obstacle, frame))
    return StressStep(potential, guess, np.asarray(cloth.pins), float(cloth.masses.mean() * GRAVITY))


def _ball(radius: float, *, centre: tuple[float, float, float], cells: int = 10) -> Obstacle:
    points, faces = sphere(radius, cells)
    return Obstacle(points + np.array(centre), faces)


def _box(half: tuple[float, float, float], centre: tuple[float, float, float]) -> Obstacle:
    """Return a box with edges of the given half lengths: sharp edges, and thin where one is small."""
    points, faces = sphere(1.0, 6)
    points = points / np.abs(points).max(axis=1, keepdims=True)
    return Obstacle(points * np.array(half) + np.array(centre), faces)


BODIES = {
    "ball": lambda: _ball(0.08, centre=(0.003, -0.02, 0.002)),  # vertices start up to 6 cm deep
    "big ball": lambda: _ball(1.0, centre=(0.05, 0.05, 0.02)),  # the whole sheet is deep inside
    "pea": lambda: _ball(0.006, centre=(0.003, 0.0, 0.002), cells=6),  # an eighth of a cell wide
    "plate": lambda: _box((0.3, 0.002, 0.3), (0.01, 0.0, 0.013)),  # thinner than the contact margin
    "blade": lambda: _box((0.001, 0.1, 0.3), (0.012, -0.02, 0.0)),  # an edge across the sheet
    "ball far below": lambda: _ball(0.08, centre=(0.003, -3.0, 0.002)),  # reached within one fast step
}
