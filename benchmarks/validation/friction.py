"""Known answers of Coulomb friction: a patch on a slope and a belt, a point on a spring, a strip, a capstan.

Patch: all vertices press alike, for k and the mass are per area, so it keeps its shape and moves as a point.
With u its slip speed over that of the smoothing, a step of backward Euler on a slope of tan(a) = r mu is

    u' = u + c (r - f'(u')),   c = dt mu g cos a / speed,   f'(u) = 2 u - u^2 for u < 1, else 1     (1)

Below the angle of friction it creeps at 1 - sqrt(1 - r) of the smoothing's speed, above it the path is that
of a constant force.

Point: the apex of a triangle that is its spring, held at the two other corners: it moves on a line. It sticks
until the spring pulls with mu m g, and ends up behind the handle with that very pull, by steps of

    m (x' - x - dt v) / dt^2 = T(handle' - x') - mu m g f'(|x' - x|),   T of uniaxial strain

Strip, of modulus E2 and Poisson's ratio 0, pulled over a table: it slides from the pulled end on. Its tension
per width falls by q = mu rho_a g per length from the pull F to zero over F/q, so the end is at

    u(F) = integral over 0 <= X <= F/q of s(q X) - 1,    E2 s (s^2 - 1)/2 = T at stretch s              (2)

until all of length L slides, with F = q L.

Capstan: a strip held at both ends over a drum that turns under it. Once the tension has found its profile the
friction of each vertex is mu N on its own tangent. Where the strip turns by b, forces balance where

    (T2 - T1) cos(b/2) = mu N,    (T2 + T1) sin(b/2) = N,    T2/T1 = (1 + mu tan(b/2))/(1 - mu tan(b/2))

which over a turn of phi is exp(mu phi) (Euler, Eytelwein), but for mu (1 + mu^2) phi b^2/12 in its logarithm.
"""

from __future__ import annotations

from functools import cache, partial
from typing import Any

import numpy as np

import reference_sim as sim
from benchmarks.meshes import right_grid
from benchmarks.validation.case import known_answer
from benchmarks.validation.contact import DRUM, RoundBody, box, strip_over_drum
from benchmarks.validation.equilibrium import flat_cloth, motion, order
from benchmarks.validation.large_bending import HANGING_MATERIAL, WEIGHT, string_stretch
from reference_sim import energies

MU = 0.5
SPEED = 0.02  # [m/s] of the smoothing
DT = 1 / 30
SOLVED = 1e-11  # mean vertex weights that may be left of a step's gradient
BELT = 0.5  # [m/s]
THROWN, FALLING = 4.0, 1.0  # [m/s]
LEVEL, STILL = np.eye(3), np.zeros((1, 1, 3))
PATH = partial(
    known_answer, unit="m", expected=0.0, tolerance=1e-10,
    reason="the residual gradient that the solver may leave, summed twice",
)  # fmt: skip


@known_answer(
    {"friction_creep": {"ratio": 0.8}},
    expected=1.0, tolerance=1e-9, reason="the residual gradient that the solver may leave",
)  # fmt: skip
def creep_speed(ratio: float) -> float:
    """Return the speed of a patch on a slope of tan(a) = ratio mu, over that of u' = u in (1)."""
    path, downhill = _slope(ratio)
    speed = float((path[-1] - path[-2]) @ downhill) / DT
    return speed / (SPEED * (1 - np.sqrt(1 - ratio)))


@PATH({"friction_slope_below": {"ratio": 0.8}, "friction_slope_at": {"ratio": 1.0}})
def slope_path(ratio: float) -> float:
    """Return the worst distance of a patch on a slope to its path by (1), over 30 steps."""
    path, downhill = _slope(ratio)
    angle = np.arctan(ratio * MU)
    exact = _slip(0.0, ratio, DT * MU * sim.GRAVITY * np.cos(angle) / SPEED, steps=30)
    return float(np.abs((path - path[0]) @ downhill - exact).max())


@PATH({"friction_slide": {"ratio": 1.2}})
def slide_path(ratio: float) -> float:
    """Return the worst distance of a patch on a slope to the path of the constant g (sin a - mu cos a)."""
    path, downhill = _slope(ratio)
    angle, n = np.arctan(ratio * MU), np.arange(31)
    exact = sim.GRAVITY * (np.sin(angle) - MU * np.cos(angle)) * DT**2 * n * (n + 1) / 2
    return float(np.abs((path - path[0]) @ downhill - exact).max())


@PATH({"friction_belt": {}, "friction_belt_in_substeps": {"substeps": 4}})
def belt_path(substeps: int = 1) -> float:
    """Return the worst distance of a patch put on a belt to its path by (1); u: how fast it lags."""
    along = np.array([BELT * DT, 0.0, 0.0]) * np.arange(16)[:, None, None]
    path = _patch(carried=along, frames=16, substeps=substeps)[:, 0]
    dt = DT / substeps
    behind = _slip(BELT / SPEED, 0.0, dt * MU * sim.GRAVITY / SPEED, steps=15 * substeps, dt=dt)[::substeps]
    return float(np.abs(path - path[0] - (along[:, 0, 0] - behind)).max())


@known_answer(expected=1.0, tolerance=1e-9, reason="what is left of its bounce, and the residual gradient")
def friction_landing() -> float:
    """Return the speed that a sliding patch keeps when it lands, over v - mu (v_n + g t).

    The table gives it the momentum m (v_n + g t) upwards, and takes mu times that of its sliding. Friction
    is a step late, but loses nothing: the force before the first step is that of the last, its weight.
    """
    path = _patch(frames=16, velocity=np.array([THROWN, -FALLING, 0.0]))
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


def _slope(ratio: float) -> tuple[np.ndarray, np.ndarray]:
    c, s = (function(np.arctan(ratio * MU)) for function in (np.cos, np.sin))
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    return _patch(turn=turn, frames=31), -turn[:, 0]


def _patch(**options: Any) -> np.ndarray:
    """Return the path (T, 3) [m] of the middle of a patch; options: of `slid`."""
    cloth = flat_cloth(*right_grid(2, 2, 0.1, 0.1), lies=True)
    return slid(cloth, dt=DT, speed=SPEED, **options).mean(axis=1)


def slid(
    cloth: sim.Cloth,
    *,
    frames: int,
    dt: float,
    speed: float,
    turn: np.ndarray = LEVEL,
    carried: np.ndarray = STILL,
    pull: np.ndarray = STILL[0, 0],
    velocity: np.ndarray = STILL[0, 0],
    quasi_static: bool = False,
    substeps: int = 1,
) -> np.ndarray:
    """Simulate a cloth flat on the plane y = 0, both turned by `turn`, and return (frames, V, 3) [m].

    It starts as deep in the margin as its weight presses it. The plane moves by carried (T, 1, 3) [m], pins
    by pull (3,) [m] a frame; velocity (3,) [m/s] is that of the start. `speed` [m/s] is that of the
    smoothing. Contact is on vertices.
    """
    from reference_sim.energies.contact_penalty import DEFAULT_STIFFNESS

    contact = energies.ContactPenalty(cloth, samples="vertices")
    depth = np.sqrt(cloth.material.areal_density * sim.GRAVITY * turn[1, 1] / (3 * DEFAULT_STIFFNESS))
    start = (cloth.rest_positions + np.array([0.0, contact.margin - depth, 0.0])) @ turn.T
    friction = energies.ContactFriction(contact, coefficient=MU, speed=speed)
    corners, sides = box()
    return motion(
        cloth, [energies.StretchStVK(cloth), energies.Gravity(cloth), contact, friction], dt=dt,
        frames=frames, obstacle=sim.Obstacle((corners + carried) @ turn.T, sides), start=start,
        velocity=np.tile(velocity, (cloth.vertex_count, 1)),
        pin_positions=lambda frame: start[cloth.pins] + frame * pull,
        quasi_static=quasi_static, substeps=substeps, tolerance=SOLVED,
    )  # fmt: skip


SOFT = sim.Material(young_modulus=7e3)  # a tenth of cotton's: the point breaks loose after 14 steps
REACH, WIDTH = 0.3, 0.1  # [m] of the triangle
HANDLE = 0.05  # [m/s]
PULL_DT = 0.01
LENGTH = 1.0  # [m] of the strip
COLUMNS = 40


@PATH()
def friction_spring_path() -> float:
    """Return the worst distance of a point that a spring pulls to discrete steps by scipy, 300 steps."""
    path, exact = _pulled_point()[:2]
    return float(np.abs(path - exact).max())


@known_answer(expected=1.0, tolerance=1e-4, reason="what is left of its swing after 300 steps")
def friction_spring_pull() -> float:
    """Return the pull of that spring once the point slides, over mu m g: no more than to break it loose."""
    return _pulled_point()[2]


@cache
def _pulled_point() -> tuple[np.ndarray, np.ndarray, float]:
    from scipy.optimize import brentq

    corners = np.array([[0.0, 0.0, 0.0], [REACH, 0.0, WIDTH / 2], [REACH, 0.0, -WIDTH / 2]])
    cloth = sim.Cloth(corners, np.array([[0, 1, 2]]), SOFT, pins=[1, 2])
    speed, frames = 1e-3, 301
    x = slid(cloth, frames=frames, dt=PULL_DT, speed=speed, pull=np.array([HANDLE * PULL_DT, 0.0, 0.0]))
    mass, area = cloth.masses[0], cloth.areas[0]
    stiffness = area * (SOFT.lame_lambda + 2 * SOFT.lame_mu) / REACH

    def pull(apart: float) -> float:
        s = apart / REACH
        return stiffness * s * (s * s - 1) / 2

    def excess(at: float, held: float, before: float, v: float) -> float:
        slip = (at - before) / (speed * PULL_DT)
        grip = np.sign(slip) * (1.0 if abs(slip) > 1 else 2 * abs(slip) - slip**2)
        return mass * ((at - before - PULL_DT * v) / PULL_DT**2 + MU * sim.GRAVITY * grip) - pull(held - at)

    exact, v = [0.0], 0.0
    for n in range(1, frames):
        held, before = REACH + n * HANDLE * PULL_DT, exact[-1]
        at = brentq(excess, before - 0.1, before + 0.1, (held, before, v), xtol=1e-16, rtol=1e-15)
        v = (at - before) / PULL_DT
        exact.append(at)
    last = pull(x[-1, 1, 0] - x[-1, 0, 0]) / (MU * mass * sim.GRAVITY)
    return x[:, 0, 0], np.array(exact), float(last)


@known_answer(expected=0.0, tolerance=1e-3, reason="40 cells, and which of them slides last")
def friction_strip_pull() -> float:
    """Return the worst error of the pull on a strip that sticks to a table, over mu times its weight."""
    from scipy.optimize import brentq

    ends, pulls = _pulled_strip()
    sticking = ends < _end(1.0)
    exact = [brentq(lambda share, u=u: _end(share) - u, 0.0, 1.0) for u in ends[sticking]]
    return float(np.abs(pulls[sticking] - exact).max())


@known_answer(
    expected=1.0, tolerance=1e-5, reason="its vertices move aside a little: all diagonals lean one way"
)
def friction_strip_slide() -> float:
    """Return the pull on a strip of which all slides, over mu times its weight."""
    ends, pulls = _pulled_strip()
    return float(pulls[ends > 1.1 * _end(1.0)].mean())


def _end(share: float) -> float:
    """Return u [m] at which the pull is that share of mu times the strip's weight, by (2)."""
    from scipy.integrate import quad

    return quad(lambda X: string_stretch(MU * WEIGHT * X) - 1, 0, share * LENGTH, epsabs=1e-14)[0]


@cache
def _pulled_strip() -> tuple[np.ndarray, np.ndarray]:
    """Return the place of the pulled end [m], and the pull over mu times the weight, step by step."""
    width = LENGTH / COLUMNS
    points, faces = right_grid(1, COLUMNS, width, LENGTH)
    cloth = flat_cloth(points, faces, HANGING_MATERIAL, held=points[:, 0] > LENGTH - 1e-9, lies=True)
    step = np.array([_end(1.0) / 20, 0.0, 0.0])
    dt = 100.0  # s: inertia is nothing
    x = slid(cloth, frames=31, dt=dt, speed=1e-4 * step[0] / dt, pull=step, quasi_static=True)
    strain, pins = energies.StretchStVK(cloth), cloth.pins
    # A pinned vertex slides too: the friction of its half of a cell is pulled as well.
    pin_friction = MU * cloth.masses[pins].sum() * sim.GRAVITY
    pulls = np.array([strain.value_and_gradient(frame)[1][pins, 0].sum() + pin_friction for frame in x[1:]])
    return x[1:, pins[0], 0] - LENGTH, pulls / (MU * cloth.masses.sum() * sim.GRAVITY)


HARD = 3.4e10  # [J/m^5]: the strip lies a hundredth as deep in the margin as on a body
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
    line = x.reshape(3, columns + 1, 3).mean(axis=0)
    first, last = line[1] - line[0], line[-1] - line[-2]
    wrap = np.arccos(first @ last / np.linalg.norm(first) / np.linalg.norm(last))
    return float(np.log(max(pulls) / min(pulls)) - mu * wrap)
