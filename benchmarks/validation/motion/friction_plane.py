"""Coulomb friction on a plane: a patch on a slope and on a belt, and one that is pulled by a spring.

All vertices of a patch of vertex samples press alike, for k and the mass are per area: the patch keeps its
shape and moves as a point. With u its slip speed over that of the smoothing, the step of backward Euler is

    u' = u + c (r - f'(u')),   c = dt mu g cos a / speed,   f'(u) = 2 u - u^2 for u < 1, else 1     (1)

on a slope of tan(a) = r mu, which says all that follows: below the angle of friction the patch creeps at
1 - sqrt(1 - r) of the smoothing's speed, above it the path is that of a constant force.
"""

from __future__ import annotations

import numpy as np

import reference_sim as sim
from benchmarks.meshes import lying, right_grid
from benchmarks.validation.case import known_answer
from benchmarks.validation.convergence import demand_converged
from benchmarks.validation.motion.resting_sheet import box
from reference_sim import energies

MU = 0.5
SPEED = 0.02  # [m/s] of the smoothing
DT = 1 / 30
SOLVED = 1e-11  # mean vertex weights that may be left of a step's gradient
BELT = 0.5  # [m/s]
THROWN, FALLING = 4.0, 1.0  # [m/s]
LEVEL, STILL = np.eye(3), np.zeros((1, 1, 3))


SUMMED_TWICE = "the residual gradient that the solver may leave, summed twice"


@known_answer(
    {"friction_creep": {"ratio": 0.8}},
    expected=1.0, tolerance=1e-9, reason="the residual gradient that the solver may leave",
)  # fmt: skip
def creep_speed(ratio: float) -> float:
    """Return the speed of a patch on a slope of tan(a) = ratio mu, over that of u' = u in (1)."""
    path, downhill = _slope(ratio, frames=31)
    speed = float((path[-1] - path[-2]) @ downhill) / DT
    return speed / (SPEED * (1 - np.sqrt(1 - ratio)))


@known_answer(
    {"friction_slope_below": {"ratio": 0.8}, "friction_slope_at": {"ratio": 1.0}},
    unit="m", expected=0.0, tolerance=1e-10, reason=SUMMED_TWICE,
)  # fmt: skip
def slope_path(ratio: float) -> float:
    """Return the worst distance of a patch on a slope to its path by (1), over 30 steps."""
    path, downhill = _slope(ratio, frames=31)
    angle = np.arctan(ratio * MU)
    exact = _slip(0.0, ratio, DT * MU * sim.GRAVITY * np.cos(angle) / SPEED, steps=30)
    return float(np.abs((path - path[0]) @ downhill - exact).max())


@known_answer(
    {"friction_slide": {"ratio": 1.2}}, unit="m", expected=0.0, tolerance=1e-10, reason=SUMMED_TWICE
)  # fmt: skip
def slide_path(ratio: float) -> float:
    """Return the worst distance of a patch on a slope to the path of the constant g (sin a - mu cos a)."""
    path, downhill = _slope(ratio, frames=31)
    angle, n = np.arctan(ratio * MU), np.arange(31)
    exact = sim.GRAVITY * (np.sin(angle) - MU * np.cos(angle)) * DT**2 * n * (n + 1) / 2
    return float(np.abs((path - path[0]) @ downhill - exact).max())


@known_answer(
    {"friction_belt": {}, "friction_belt_in_substeps": {"substeps": 4}},
    unit="m", expected=0.0, tolerance=1e-10, reason=SUMMED_TWICE,
)  # fmt: skip
def belt_path(substeps: int = 1) -> float:
    """Return the worst distance of a patch put on a belt to its path by (1); u: how fast it lags."""
    along = np.array([BELT * DT, 0.0, 0.0]) * np.arange(16)[:, None, None]
    path = _patch(LEVEL, along, frames=16, substeps=substeps)[:, 0]
    dt = DT / substeps
    behind = _slip(BELT / SPEED, 0.0, dt * MU * sim.GRAVITY / SPEED, steps=15 * substeps, dt=dt)[::substeps]
    return float(np.abs(path - path[0] - (along[:, 0, 0] - behind)).max())


@known_answer(expected=1.0, tolerance=1e-9, reason="what is left of its bounce, and the residual gradient")
def friction_landing() -> float:
    """Return the speed that a sliding patch keeps when it lands, over v - mu (v_n + g t).

    The table gives it the momentum m (v_n + g t) upwards, and takes mu times that of its sliding. Friction
    is a step late, but loses nothing: the force before the first step is that of the last, its weight.
    """
    path = _patch(LEVEL, STILL, frames=16, velocity=np.array([THROWN, -FALLING, 0.0]))
    kept = THROWN - MU * (FALLING + sim.GRAVITY * 15 * DT)
    return float((path[-1, 0] - path[-2, 0]) / DT / kept)


def _slip(u: float, drive: float, c: float, *, steps: int, dt: float = DT) -> np.ndarray:
    """Return the distance (steps + 1,) [m] slipped by (1) from u on.

    Below 1 it is c u'^2 - (1 + 2 c) u' + u + c r = 0.
    """
    slipped = [0.0]
    for _ in range(steps):
        smooth = (1 + 2 * c - np.sqrt(max((1 + 2 * c) ** 2 - 4 * c * (u + c * drive), 0.0))) / (2 * c)
        u = u + c * (drive - 1) if u + c * (drive - 1) >= 1 else smooth
        slipped.append(slipped[-1] + u * SPEED * dt)
    return np.array(slipped)


def _slope(ratio: float, *, frames: int) -> tuple[np.ndarray, np.ndarray]:
    angle = np.arctan(ratio * MU)
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    return _patch(turn, STILL, frames=frames), -turn[:, 0]


def _patch(
    turn: np.ndarray,
    motion: np.ndarray,
    *,
    frames: int,
    velocity: np.ndarray = STILL[0, 0],
    substeps: int = 1,
) -> np.ndarray:
    """Return the path (T, 3) [m] of the middle of a patch on a turned plane moved by motion (T, 1, 3)."""
    points, faces = right_grid(2, 2, 0.1, 0.1)
    flat = lying(points)
    cloth = sim.Cloth(flat, faces[:, ::-1], sim.Material())
    x = slid(
        cloth, flat, frames=frames, dt=DT, speed=SPEED, turn=turn, motion=motion, velocity=velocity,
        substeps=substeps,
    )  # fmt: skip
    return x.mean(axis=1)


def slid(
    cloth: sim.Cloth,
    flat: np.ndarray,
    *,
    frames: int,
    dt: float,
    speed: float,
    turn: np.ndarray = LEVEL,
    motion: np.ndarray = STILL,
    pull: np.ndarray = STILL[0, 0],
    velocity: np.ndarray = STILL[0, 0],
    quasi_static: bool = False,
    substeps: int = 1,
) -> np.ndarray:
    """Simulate a cloth laid flat (V, 3) [m] on the plane y = 0, both turned by `turn`: (frames, V, 3) [m].

    It starts as deep in the margin as its weight presses it. The plane moves by motion (T, 1, 3) [m], pins
    by pull (3,) [m] a frame; velocity (3,) [m/s] is that of the start. `speed` [m/s] is that of the
    smoothing. Contact is on vertices.
    """
    from reference_sim.energies.contact_penalty import DEFAULT_STIFFNESS

    contact = energies.ContactPenalty(cloth, samples="vertices")
    depth = np.sqrt(cloth.material.areal_density * sim.GRAVITY * turn[1, 1] / (3 * DEFAULT_STIFFNESS))
    start = (flat + np.array([0.0, contact.margin - depth, 0.0])) @ turn.T
    friction = energies.ContactFriction(contact, coefficient=MU, speed=speed)
    corners, sides = box()
    trajectory = sim.simulate(
        cloth, [energies.StretchStVK(cloth), energies.Gravity(cloth), contact, friction], dt=dt,
        frames=frames, obstacle=sim.Obstacle((corners + motion) @ turn.T, sides), start=start,
        velocity=np.tile(velocity, (len(flat), 1)),
        pin_positions=lambda frame: start[cloth.pins] + frame * pull,
        quasi_static=quasi_static, substeps=substeps, tolerance=SOLVED,
    )  # fmt: skip
    return demand_converged(trajectory, "the slide").positions
