"""Stiff and extreme steps of a small sheet: each converges truly, or fails and says so.

The energy may not rise, everything is finite, and a claim of convergence is true by a path that shares no
kernel with the solver (convergence_check.py). A false claim, a NaN, a crash and a hang are failed rows;
an honest "stalled", "diverged" or "timeout" keeps that name and its reason. A case's options are what
differs from an ordinary step of 1/30 s of a sheet 0.4 m wide, 81 vertices, held at two corners.

Starts that are symmetric to the last bit are saddles of the energy: they are perturbed by a micrometre,
but for `flat` and `point`, which are saddles on purpose.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial
from typing import Any

import numpy as np

import reference_sim as sim
from benchmarks.meshes import sphere, square_sheet
from benchmarks.validation.case import Measurement, known_answer
from benchmarks.validation.convergence_check import RELATIVE_RESIDUAL, solve_and_check
from reference_sim import energies

CELLS, SIZE, DT = 8, 0.4, 1.0 / 30.0
PINS = {"corners": (0, CELLS), "none": (), "side": tuple(range(CELLS + 1))}
MARGIN = 4e-3  # [m] of the contact penalty
NOISE = 2e-3  # [m] of a noisy start
DEADLINE = 60.0  # [s] for one step, after which its process is ended

Start = Callable[[np.ndarray, np.random.Generator], np.ndarray]  # of positions (V, 3) [m]


def perturb(x: np.ndarray, random: np.random.Generator, size: float = 1e-6) -> np.ndarray:
    """Return positions with noise of that size [m]; a micrometre leaves a saddle."""
    return x + random.normal(0, size, x.shape)


def fold(x: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Return the half x > 0 turned up about the z axis by half a turn, perturbed."""
    arm = np.maximum(x[:, 0], 0.0)
    x[:, 0] -= 2.0 * arm
    x[:, 1] += arm * np.sin(np.pi)
    return perturb(x, random)


def twist(x: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Return positions turned about the x axis, by more and more along it up to two turns, perturbed."""
    angle = 2 * np.pi * 2.0 * (x[:, 0] / np.ptp(x[:, 0]) + 0.5)
    x[:, 1], x[:, 2] = x[:, 2] * np.sin(angle), x[:, 2] * np.cos(angle)
    return perturb(x, random)


def collapsed_triangle(x: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Return a noisy start with two neighbours at one place: their hinges have no angle."""
    x = perturb(x, random, NOISE)
    x[41] = x[40]
    return x


STARTS: dict[str, Start] = {  # of the rest positions of a horizontal sheet about the origin
    "noisy": partial(perturb, size=NOISE),
    "flat": lambda x, random: x,
    "point": lambda x, random: np.zeros_like(x),
    "anywhere in 0.4 m": lambda x, random: random.uniform(-0.2, 0.2, x.shape),
    "anywhere in 40 m": lambda x, random: random.uniform(-20.0, 20.0, x.shape),
    "squeezed to 30 %": lambda x, random: perturb(x * [0.3, 1.0, 1.0], random),
    "mirrored": lambda x, random: perturb(x * [-1.0, 1.0, 1.0], random),
    "folded by 180": fold,
    "twisted": twist,
    "collapsed triangle": collapsed_triangle,
}
VELOCITIES: dict[
    str, Callable[[np.ndarray, np.ndarray], np.ndarray]
] = {  # of positions and rest positions
    "falling at 90 m/s": lambda x, rest: np.tile([0.0, -90.0, 0.0], (len(x), 1)),
    "spinning at 500 rad/s": lambda x, rest: 500.0 * np.cross([0.0, 1.0, 0.0], x),
    "closing at 30 rad/s": lambda x, rest: np.outer(-30.0 * np.maximum(rest[:, 0], 0.0), [0.0, 1.0, 0.0]),
}


def sliver_row(x: np.ndarray) -> np.ndarray:
    """Return the sheet with one row of cells of aspect 1e4 between even ones."""
    width = np.ptp(x[:, 0]) / CELLS
    column = np.round(x[:, 0] / width) + CELLS // 2
    x[column == 4, 0] = 1e-4 * width - width
    x[column == 3, 0] = -width
    return x


REST_SHAPES: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "even": lambda x: x,
    "slivers": lambda x: x * [1.0, 1.0, 1e-4],
    "sliver row": sliver_row,
}


def ball(radius: float, *centre: float) -> sim.Obstacle:
    """Return a sphere of that radius and centre [m]."""
    points, faces = sphere(radius, 10)
    return sim.Obstacle(points + np.array(centre), faces)


def blade() -> sim.Obstacle:
    """Return a box of 2 mm with an edge across the sheet."""
    points, faces = sphere(1.0, 6)
    points = points / np.abs(points).max(axis=1, keepdims=True)
    return sim.Obstacle(points * np.array((0.001, 0.1, 0.3)) + np.array((0.012, -0.02, 0.0)), faces)


BODIES: dict[str, Callable[[], sim.Obstacle]] = {
    "ball": partial(ball, 0.08, 0.003, -0.02, 0.002),  # vertices start up to 6 cm deep
    "big ball": partial(ball, 1.0, 0.05, 0.05, 0.02),  # the whole sheet is deep inside
    "blade": blade,
    "ball far below": partial(ball, 0.08, 0.003, -3.0, 0.002),  # reached within one fast step
}

STIFF_HINGE = {"start": "folded by 180", "speed": "closing at 30 rad/s", "bending": 1e4}
ONE_POINT = {"start": "point", "terms": "membrane", "pins": "none", "speed": 0.0}
SMOKE: dict[str, dict[str, Any]] = {  # what `{smoke}` of a study means
    "stiffness_x1000": {"stiffness": 1e3},
    "time_step_1s": {"dt": 1.0},
    "squeezed_70": {"start": "squeezed to 30 %", "speed": 0.0},
    "random_start": {"start": "anywhere in 0.4 m"},
    "one_point_weightless": {**ONE_POINT, "gravity": 0.0},
    "body_teleport": {"body": "ball"},
}
FURTHER: dict[str, dict[str, Any]] = {
    "stiffness_x0.001": {"stiffness": 1e-3},
    "stiffness_x1000000": {"stiffness": 1e6},
    "stiff_board": {"stiffness": 1e3, "bending": 1e3},
    "membrane_alone": {"terms": "membrane"},
    "time_step_0.1ms": {"dt": 1e-4},
    "time_step_0.1ms_stiff": {"dt": 1e-4, "stiffness": 1e6},
    "no_inertia": {"dt": None},
    "speed_100": {"speed": 100.0},
    "spinning": {"speed": "spinning at 500 rad/s", "pins": "none"},
    "gravity_x1000": {"gravity": 1000.0},
    "flat_saddle": {"start": "flat", "gravity": 0.0, "speed": 0.0},
    "mirrored": {"start": "mirrored"},
    "folded_180": {"start": "folded by 180", "speed": 0.0},
    "twisted": {"start": "twisted"},
    "random_start_40m": {"start": "anywhere in 40 m"},
    "one_point": ONE_POINT,
    "collapsed_triangle": {"start": "collapsed triangle"},
    "hinge_stiff_through_pi": STIFF_HINGE,
    "rest_angles_random": {"rest_angles": "random", "bending": 100.0},
    "slivers": {"shape": "slivers"},
    "sliver_row": {"shape": "sliver row", "start": "flat"},
    "start_inside": {"body": "big ball"},
    "body_blade": {"body": "blade", "pins": "none"},
    "body_at_90": {"body": "ball far below", "pins": "none", "speed": "falling at 90 m/s"},
}
OUTCOME: dict[str, Any] = {
    "suite": "extremes", "metric": "outcome", "expected": 0.0, "tolerance": RELATIVE_RESIDUAL,
    "seconds": DEADLINE,
}  # fmt: skip


@known_answer(SMOKE, **OUTCOME)
@known_answer(FURTHER, smoke=False, **OUTCOME)
def solve_sheet(**options: Any) -> Measurement:
    """Return the relative residual at the end of an extreme step, solved as in a simulation and checked.

    options: see `sheet_step`.
    """
    return solve_and_check(*sheet_step(**options))


@cache
def warm_up() -> None:
    """Compile the kernels of all steps, however long that takes."""
    solve_and_check(*sheet_step(body="ball"))


def sheet_step(
    *,
    stiffness: float = 1.0,
    bending: float = 1.0,
    gravity: float = 1.0,
    dt: float | None = DT,
    pins: str = "corners",
    start: str = "noisy",
    speed: float | str = 1.0,
    rest_angles: float | str = 0.0,
    shape: str = "even",
    terms: str = "membrane+bending",
    body: str = "",
) -> tuple[sim.Potential, np.ndarray]:
    """Return the prepared potential of a step of a sheet, and the guess (V, 3) [m] to start from.

    Args:
        stiffness: factor on Young's modulus.
        bending: factor on the hinge stiffness.
        gravity: factor on g.
        dt: time step [s]; None leaves inertia out.
        pins: "corners", "side" or "none".
        start: name in `STARTS`.
        speed: scale [m/s] of random velocities, or the name of a field in `VELOCITIES`.
        rest_angles: [rad] of every hinge, or "random" within half a turn.
        shape: name in `REST_SHAPES`: how the mesh at rest differs from an even one.
        terms: which of "membrane" and "bending", joined by "+".
        body: name in `BODIES`; "" for none.
    """
    random = np.random.default_rng(11)
    rest, faces = square_sheet(CELLS, SIZE)
    rest = REST_SHAPES[shape](rest)
    material = sim.Material(young_modulus=70e3 * stiffness, bending_stiffness=3.96e-5 * bending)
    cloth = sim.Cloth(rest, faces, material, pins=PINS[pins])
    x = STARTS[start](rest.copy(), random)
    v = VELOCITIES[speed](x, rest) if isinstance(speed, str) else random.normal(0, 1.0, x.shape) * speed
    x[cloth.pins], v[cloth.pins] = rest[cloth.pins], 0.0
    declared: list[energies.Energy] = [energies.StretchStVK(cloth)] if "membrane" in terms else []
    if "bending" in terms:
        angles = (
            random.uniform(-np.pi, np.pi, len(cloth.hinges)) if rest_angles == "random" else rest_angles
        )
        declared.append(energies.BendHinge(cloth, rest_angles=angles))
    declared.append(energies.Gravity(cloth, acceleration=gravity * sim.GRAVITY))
    if body:
        declared.append(energies.ContactPenalty(cloth, margin=MARGIN))
    if dt:
        declared.append(energies.Inertia(cloth, dt))
    potential = sim.Potential(declared)
    potential.prepare(energies.Step(x, v, x, dt or DT, BODIES[body]() if body else None, 0))
    return potential, x
