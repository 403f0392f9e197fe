"""Known answers of Coulomb friction: a patch on a slope, a belt and a table, a capstan.

Patch: all vertices press alike, for k and the mass are per area, so it keeps its shape and moves as a
point. With u its slip speed over that of the smoothing, a step of backward Euler on a slope of tan(a) = r
mu is

    u' = u + c (r - f'(u')),   c = dt mu g cos a / speed,   f'(u) = 2 u - u^2 for u < 1, else 1     (1)

Below the angle of friction it creeps at 1 - sqrt(1 - r) of the smoothing's speed, above it the path is
that of a constant force.

Capstan: a strip held at both ends over a drum that turns under it. Once the tension has found its profile
the friction of each vertex is mu N on its own tangent. Where the strip turns by b, forces balance where

    (T2 - T1) cos(b/2) = mu N,    (T2 + T1) sin(b/2) = N,    T2/T1 = (1 + mu tan(b/2))/(1 - mu tan(b/2))

which over a turn of phi is exp(mu phi) (Euler, Eytelwein), but for mu (1 + mu^2) phi b^2/12 in its
logarithm.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

import reference_sim as sim
from benchmarks.meshes import right_grid
from benchmarks.validation.case import known_answer
from benchmarks.validation.contact import DRUM, RoundBody, box, strip_over_drum
from benchmarks.validation.equilibrium import COTTON, flat_cloth, motion, order
from reference_sim import energies

MU = 0.5
SPEED = 0.02  # [m/s] of the smoothing
DT = 1 / 30
BELT = 0.5  # [m/s]
THROWN, FALLING = 4.0, 1.0  # [m/s]
LEVEL, STILL = np.eye(3), np.zeros((1, 1, 3))
PATH = partial(
    known_answer, unit="m", expected=0.0, tolerance=1e-10,
    reason="the residual gradient that the solver may leave, summed twice",
)  # fmt: skip


@PATH({"friction_slope_below": {"ratio": 0.8}, "friction_slope_at": {"ratio": 1.0}})
def slope_path(ratio: float) -> float:
    """Return the worst distance of a patch on a slope to its path by (1), over 30 steps."""
    slid, c, _ = _slide(ratio)
    exact = _slip(0.0, ratio, DT * MU * sim.GRAVITY * c / SPEED, steps=30)
    return float(np.abs(slid - exact).max())


@PATH({"friction_slide": {"ratio": 1.2}})
def slide_path(ratio: float) -> float:
    """Return the worst distance of a patch on a slope to the path of constant g (sin a - mu cos a)."""
    (slid, c, s), n = _slide(ratio), np.arange(31)
    exact = sim.GRAVITY * (s - MU * c) * DT**2 * n * (n + 1) / 2
    return float(np.abs(slid - exact).max())


@PATH({"friction_belt": {}, "friction_belt_in_substeps": {"substeps": 4}})
def belt_path(substeps: int = 1) -> float:
    """Return the worst distance of a patch put on a belt to its path by (1); u: how fast it lags."""
    along = np.array([BELT * DT, 0.0, 0.0]) * np.arange(16)[:, None, None]
    path = _patch(carried=along, frames=16, substeps=substeps)[:, 0]
    dt = DT / substeps
    offset = _slip(BELT / SPEED, 0.0, dt * MU * sim.GRAVITY / SPEED, steps=15 * substeps, dt=dt)[
        ::substeps
    ]
    return float(np.abs(path - path[0] - (along[:, 0, 0] - offset)).max())


@known_answer(
    expected=1.0, tolerance=1e-9, reason="what is left of its bounce, and the residual gradient"
)
def friction_landing() -> float:
    """Return the speed that a sliding patch keeps when it lands, over v - mu (v_n + g t).

    The table gives it the momentum m (v_n + g t) upwards, and takes mu times that of its sliding.
    """
    path = _patch(frames=16, velocity=np.array([THROWN, -FALLING, 0.0]))
    speed = THROWN - MU * (FALLING + sim.GRAVITY * 15 * DT)
    return float((path[-1, 0] - path[-2, 0]) / DT / speed)


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


def _slide(ratio: float) -> tuple[np.ndarray, float, float]:
    """Return the way (31,) [m] of a patch down a slope, cosine and sine of its angle."""
    angle = np.arctan(ratio * MU)
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    path = _patch(turn=turn, frames=31)
    return (path - path[0]) @ -turn[:, 0], c, s


def _patch(
    *,
    frames: int,
    turn: np.ndarray = LEVEL,
    carried: np.ndarray = STILL,
    velocity: np.ndarray = STILL[0, 0],
    substeps: int = 1,
) -> np.ndarray:
    """Return the path (frames, 3) [m] of the middle of a patch on the plane y = 0, both turned by `turn`.

    It starts as deep in the margin as its weight presses it, with a velocity (3,) [m/s]. The plane moves
    by carried (T, 1, 3) [m].
    """
    from reference_sim.energies.contact_penalty import DEFAULT_STIFFNESS

    cloth = flat_cloth(*right_grid(2, 2, 0.1, 0.1), lies=True)
    contact = energies.ContactPenalty(cloth, samples="vertices")
    depth = np.sqrt(COTTON.areal_density * sim.GRAVITY * turn[1, 1] / (3 * DEFAULT_STIFFNESS))
    friction = energies.ContactFriction(contact, coefficient=MU, speed=SPEED)
    corners, sides = box()
    x = motion(
        cloth, [energies.StretchStVK(cloth), energies.Gravity(cloth), contact, friction], dt=DT,
        frames=frames, obstacle=sim.Obstacle((corners + carried) @ turn.T, sides),
        start=(cloth.rest_positions + np.array([0.0, contact.margin - depth, 0.0])) @ turn.T,
        velocity=np.tile(velocity, (cloth.vertex_count, 1)), substeps=substeps, tolerance=1e-11,
    )  # fmt: skip
    return x.mean(axis=1)


HARD = 3.4e10  # [J/m^5]: the strip lies a hundredth as deep as on a body
TURN = 0.02  # [rad] of the drum in a step


@known_answer(
    {"friction_capstan_rough": {"mu": 0.5}, "friction_capstan_smooth": {"mu": 0.1}},
    expected=1.0, tolerance=1e-3, reason="60 cells: mu (1 + mu^2) phi b^2 / 12, at most 8e-4",
)  # fmt: skip
def ratio(mu: float) -> float:
    """Return the pulls on the ends of a strip over a turning drum, tight over slack, over exp(mu phi)."""
    return float(np.exp(_excess(mu, 60)))


@known_answer(expected=2.0, tolerance=0.2, reason="the strip's depth in the margin over R is left")
def friction_capstan_order() -> float:
    """Return the order in the length of a cell of the error of that ratio's logarithm, at mu = 0.5."""
    return order(lambda columns: abs(_excess(0.5, columns)), (30, 60, 120))


def _excess(mu: float, columns: int) -> float:
    """Return the logarithm of the ratio of the pulls, less mu times the angle from first to last cell."""
    cloth, points, start = strip_over_drum(columns, HARD)
    sides = points[:, 0] < 1e-9, points[:, 0] > points[:, 0].max() - 1e-9
    contact = energies.ContactPenalty(cloth, samples="vertices", stiffness=HARD)
    friction = energies.ContactFriction(contact, coefficient=mu, speed=1e-3 * DRUM * TURN)
    body: Any = RoundBody(DRUM, axis=2, turn=TURN)
    x = motion(
        cloth, [energies.StretchStVK(cloth), contact, friction], dt=1.0, frames=40, obstacle=body,
        start=start, guess="previous", quasi_static=True, tolerance=1e-9,
    )[-1]  # fmt: skip
    strain = energies.StretchStVK(cloth).value_and_gradient(x)[1]
    pulls = [float(np.linalg.norm(strain[side].sum(axis=0))) for side in sides]
    line = x.reshape(3, -1, 3).mean(axis=0)
    first, last = line[1] - line[0], line[-1] - line[-2]
    wrap = np.arccos(first @ last / np.linalg.norm(first) / np.linalg.norm(last))
    return float(np.log(max(pulls) / min(pulls)) - mu * wrap)
