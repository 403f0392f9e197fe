"""Coulomb friction of what is pulled over a table: a point by a spring, and a strip by its end.

The point is a triangle's apex, its spring the triangle, held at the two other corners: by symmetry it moves
on a line. It sticks until the spring pulls with mu m g, and ends up behind the handle with that very pull,
for sliding costs what breaking loose does. In between it swings, step by step as

    m (x' - x - dt v) / dt^2 = T(handle' - x') - mu m g f'(|x' - x|)                                    (1)

with the closed form T of a triangle in uniaxial strain.

The strip, of modulus E2 and Poisson's ratio 0, slides from the pulled end on, and sticks beyond: its tension
per width falls by q = mu rho_a g per length from the pull F to zero over F/q, so the end is at

    u(F) = integral over 0 <= X <= F/q of s(q X) - 1,    E2 s (s^2 - 1)/2 = T at stretch s              (2)

until all of length L slides, with F = q L, about mu rho_a g L^2 / (2 E2) from where it was.
"""

from __future__ import annotations

from functools import cache

import numpy as np

import reference_sim as sim
from benchmarks.meshes import lying, right_grid
from benchmarks.validation.case import known_answer
from benchmarks.validation.motion.friction_plane import MU, SUMMED_TWICE, slid
from benchmarks.validation.shells.hanging_strip import MATERIAL, WEIGHT, string_stretch
from reference_sim import energies

SOFT = sim.Material(young_modulus=7e3)  # a tenth of cotton's: the point breaks loose after 14 steps
REACH, WIDTH = 0.3, 0.1  # [m] of the triangle
HANDLE = 0.05  # [m/s]
DT = 0.01
LENGTH = 1.0  # [m] of the strip
COLUMNS = 40


@known_answer(unit="m", expected=0.0, tolerance=1e-10, reason=SUMMED_TWICE)
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
    x = slid(cloth, corners, frames=frames, dt=DT, speed=speed, pull=np.array([HANDLE * DT, 0.0, 0.0]))
    mass, area = cloth.masses[0], cloth.areas[0]
    stiffness = area * (SOFT.lame_lambda + 2 * SOFT.lame_mu) / REACH

    def pull(apart: float) -> float:
        s = apart / REACH
        return stiffness * s * (s * s - 1) / 2

    exact, v = [0.0], 0.0
    for n in range(1, frames):
        held, before = REACH + n * HANDLE * DT, exact[-1]

        def excess(at: float, held: float = held, before: float = before, v: float = v) -> float:
            slip = (at - before) / (speed * DT)
            grip = np.sign(slip) * (1.0 if abs(slip) > 1 else 2 * abs(slip) - slip**2)
            return mass * ((at - before - DT * v) / DT**2 + MU * sim.GRAVITY * grip) - pull(held - at)

        at = brentq(excess, before - 0.1, before + 0.1, xtol=1e-16, rtol=1e-15)
        v = (at - before) / DT
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
    rest = lying(points)
    cloth = sim.Cloth(rest, faces[:, ::-1], MATERIAL, pins=np.flatnonzero(points[:, 0] > LENGTH - 1e-9))
    step = np.array([_end(1.0) / 20, 0.0, 0.0])
    dt = 100.0  # s: inertia is nothing
    x = slid(cloth, rest, frames=31, dt=dt, speed=1e-4 * step[0] / dt, pull=step, quasi_static=True)
    strain, pins = energies.StretchStVK(cloth), cloth.pins
    # A pinned vertex slides too: the friction of its half of a cell is pulled as well.
    pin_friction = MU * cloth.masses[pins].sum() * sim.GRAVITY
    pulls = np.array([strain.value_and_gradient(frame)[1][pins, 0].sum() + pin_friction for frame in x[1:]])
    return x[1:, pins[0], 0] - LENGTH, pulls / (MU * cloth.masses.sum() * sim.GRAVITY)
