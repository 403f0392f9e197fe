"""Known answers of time integration: few vertices that scipy solves, and the order of whole sheets in dt.

Pendulum: one triangle hangs by its base; by symmetry its third vertex stays half-way between the two pins,
at a distance r from the base that was h at rest, with E(r) = A (lambda/2 + mu) G^2, G = ((r/h)^2 - 1)/2.
Rotor: six triangles around a free vertex; every one is stretched by r/R alike, E = A 2 (lambda + mu) G^2.

Where a sheet has no exact motion, the order is that of the distance between the positions with dt and with
dt/2: it is that of the distance to the limit, where there is a limit.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

import reference_sim as sim
from benchmarks.meshes import random_rotation, sheet, square_sheet
from benchmarks.validation.case import known_answer
from benchmarks.validation.contact import RoundBody
from benchmarks.validation.discrete_laws import HANGING, stretched_membrane
from benchmarks.validation.equilibrium import (
    border,
    farthest,
    fitted_order,
    minimum,
    motion,
    order,
    sheet_terms,
)
from reference_sim import energies

SOFT = sim.Material(young_modulus=7e3)
HEIGHT, BASE = 0.5, 0.4  # [m] of the triangle
RADIUS = 0.2  # [m] of the rotor
MASS = SOFT.areal_density * HEIGHT * BASE / 2 / 3
RIGIDITY = HEIGHT * BASE / 2 * (SOFT.lame_lambda / 2 + SOFT.lame_mu)  # [J] A (lambda/2 + mu)


def _pull(r: float) -> float:
    """Return dE/dr of the pendulum [N]."""
    return RIGIDITY * ((r / HEIGHT) ** 2 - 1) * r / HEIGHT**2


def _simulated_pendulum(
    start: np.ndarray, dt: float, frames: int, *, gravity: float = sim.GRAVITY
) -> np.ndarray:
    """Return the path (frames, 2) [m] of the free vertex across the base, from `start` (2,), at rest."""
    rest = np.array([[0.0, 0.0, -BASE / 2], [0.0, 0.0, BASE / 2], [HEIGHT, 0.0, 0.0]])
    cloth = sim.Cloth(rest, np.array([[0, 1, 2]]), SOFT, pins=[0, 1])
    x = rest.copy()
    x[2, :2] = start
    terms = [energies.StretchStVK(cloth), energies.Gravity(cloth, acceleration=gravity)]
    return motion(cloth, terms, dt=dt, frames=frames, start=x, tolerance=1e-11)[:, 2, :2]


@known_answer(unit="m", expected=0.0, tolerance=1e-10, reason="scipy's tolerance, 1e-12 a step, summed twice")
def pendulum() -> float:
    """Return the largest distance of an elastic pendulum to its discrete steps solved by scipy, 60 steps."""
    from scipy.optimize import fsolve

    dt, start = 1 / 30, np.array([0.52, 0.1])

    def balance(q, before, last):
        r = np.hypot(*q)
        return (q - 2 * last + before) / dt**2 + _pull(r) / MASS * q / r + [0.0, sim.GRAVITY]

    path = [start, start]  # the one before the start: no velocity
    for _ in range(60):
        path.append(fsolve(balance, 2 * path[-1] - path[-2], (path[-2], path[-1]), xtol=1e-12))
    return farthest(_simulated_pendulum(start, dt, 61), np.array(path[1:]))


@known_answer(expected=1.0, tolerance=0.1, reason="backward Euler; its second order still shows at 1/480 s")
def time_step_order() -> float:
    """Return the order in dt of the pendulum's place after half a second; scipy integrates the reference."""
    from scipy.integrate import solve_ivp

    start, end = np.array([0.52, 0.1]), 0.5

    def rate(_, state):
        q, v = state[:2], state[2:]
        r = np.hypot(*q)
        return np.concatenate([v, -_pull(r) / MASS * q / r - [0.0, sim.GRAVITY]])

    exact = solve_ivp(rate, (0, end), [*start, 0.0, 0.0], rtol=1e-10, atol=1e-12).y[:2, -1]

    def error(n: int) -> float:
        return float(np.linalg.norm(_simulated_pendulum(start, end / n, n + 1)[-1] - exact))

    return order(error, (240, 480, 960), end)


@known_answer(
    {"numerical_damping_10": {"frequency": 10.0}, "numerical_damping_20": {"frequency": 20.0}},
    tolerance=1e-5, reason="amplitude 1e-5: what is not linear in it",
)  # fmt: skip
def numerical_damping(frequency: float) -> tuple[float, float]:
    """Return the amplitude left after 1 s at 30 steps a second of a swing at `frequency` [rad/s], and exact.

    Backward Euler multiplies x + i v/omega by 1/(1 + i omega dt) in each step. The pendulum of a fitting
    length swings along itself, weightless, by a hundred thousandth.
    """
    dt, amplitude = 1 / 30, 1e-5 * HEIGHT
    # omega^2 = 2 A (lambda/2 + mu)/(m h^2): made to fit by the step instead of the length.
    natural = np.sqrt(2 * RIGIDITY / MASS) / HEIGHT
    fitted_dt = dt * frequency / natural
    path = _simulated_pendulum(np.array([HEIGHT + amplitude, 0.0]), fitted_dt, 31, gravity=0.0)[:, 0] - HEIGHT
    velocity = np.diff(path)[-1] / fitted_dt
    left = np.hypot(path[-1], velocity / natural) / amplitude
    return float(left), float((1 + (frequency * dt) ** 2) ** -15)


@known_answer(unit="m", expected=0.0, tolerance=1e-11, reason="round-off of 60 steps, summed twice")
def rotor() -> float:
    """Return the largest distance of a turning hexagon to its exact discrete steps, 60 steps.

    The force is along z' itself, so z' (1 + dt^2 f(|z'|)) = 2 z - z_before: the direction is that of the
    right side, and the radius the root of one equation.
    """
    from scipy.optimize import brentq

    dt, spin = 1 / 30, 4.0
    angle = np.arange(6) * np.pi / 3
    ring = RADIUS * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    flat = np.concatenate([[[0.0, 0.0]], ring])
    turn = random_rotation(3)[:, :2]
    faces = np.array([[0, 1 + i, 1 + (i + 1) % 6] for i in range(6)])
    cloth = sim.Cloth(flat @ turn.T, faces, SOFT)
    velocity = spin * np.stack([-flat[:, 1], flat[:, 0]], axis=1)
    terms = [energies.StretchStVK(cloth)]
    x = motion(cloth, terms, dt=dt, frames=61, velocity=velocity @ turn.T, tolerance=1e-11)
    area = cloth.areas.sum()
    rigidity = 2 * (SOFT.lame_lambda + SOFT.lame_mu) * area / 6  # for each vertex of the ring
    mass = SOFT.areal_density * area / 9  # two thirds of a triangle

    def too_long(r: float, straight: float) -> float:
        return r + dt**2 / mass * rigidity * ((r / RADIUS) ** 2 - 1) * r / RADIUS**2 - straight

    z = [complex(*ring[0]) - dt * spin * 1j * complex(*ring[0]), complex(*ring[0])]
    for _ in range(60):
        straight = 2 * z[-1] - z[-2]
        r = brentq(too_long, 0.0, 10 * abs(straight), (abs(straight),), xtol=1e-15, rtol=1e-14)
        z.append(r * straight / abs(straight))
    exact = np.outer(np.real(z[1:]), turn[:, 0]) + np.outer(np.imag(z[1:]), turn[:, 1])
    return farthest(x[:, 1], exact)


VISCOSITY = 0.25  # [N s/m] of an edge: waves faster than about 100 rad/s do not swing
BALL = 0.1  # [m] radius


@known_answer(expected=1.0, tolerance=0.1, reason="backward Euler; its second order still shows at 1/3840 s")
def membrane_time_step_order() -> float:
    """Return the order in dt of a stretched membrane's lowest mode after 0.1 s, against A cos(omega t)."""
    amplitude, end = 1e-5, 0.1
    cloth, start, mode, omega2 = stretched_membrane(amplitude)
    exact = amplitude * np.cos(np.sqrt(omega2) * end) * mode

    def error(n: int) -> float:
        x = _end(cloth, [energies.StretchStVK(cloth)], start, end, n, tolerance=1e-11)
        return float(np.linalg.norm(x[:, 2] - exact))

    return order(error, (96, 192, 384), end)


@known_answer(expected=1.0, tolerance=0.15, reason="backward Euler; faster vibrations still show at 1/1920 s")
def swing_time_step_order() -> float:
    """Return the order in dt of a sheet that swings from its upper edge, from 20 degrees, after 0.25 s."""
    flat, faces = sheet((8, 6), (0.4, 0.3))
    upright = np.stack([flat[:, 2], -flat[:, 0], flat[:, 1]], axis=1)
    cloth = sim.Cloth(upright, faces, sim.Material(), pins=np.arange(7))
    terms = sheet_terms(cloth)
    hanging = minimum(terms, upright)
    cosine, sine = np.cos(np.deg2rad(20)), np.sin(np.deg2rad(20))
    turn = np.array([[1, 0, 0], [0, cosine, -sine], [0, sine, cosine]])
    edge = upright[0] * [0, 1, 0]
    start = (hanging - edge) @ turn.T + edge
    return halving_order(lambda n: _end(cloth, terms, start, 0.25, n), (60, 120, 240, 480))


@known_answer(expected=1.0, tolerance=0.1, reason="backward Euler; its second order still shows at 1/1200 s")
def pressed_time_step_order() -> float:
    """Return the order in dt of a taut sheet that a ball, already in touch, is pressed into smoothly."""
    end = 0.2
    flat, faces = square_sheet(8, 0.4)
    cloth = sim.Cloth(flat, faces, sim.Material(), pins=np.flatnonzero(border(flat[:, [0, 2]])))
    terms = [*sheet_terms(cloth), energies.ContactPenalty(cloth)]

    def ball(n: int) -> Any:
        t = np.linspace(0, end, n + 1)
        return RoundBody(BALL, heights=0.02 * np.sin(2 * np.pi * t) ** 6 - 0.8 * BALL)  # without a jolt

    tent = 1.1 * flat
    tent[:, 1] = 0.12 * np.maximum(0.2 - np.hypot(flat[:, 0], flat[:, 2]), 0.0)
    still: Any = RoundBody(BALL, heights=[-0.8 * BALL])
    # Contact planes follow the sheet until both agree.
    start = sim.simulate(
        cloth, terms, dt=1.0, frames=9, quasi_static=True, start=tent, obstacle=still, guess="previous"
    ).positions[-1]
    return halving_order(
        lambda n: _end(cloth, terms, start, end, n, obstacle=ball(n), guess="extrapolated"),
        (30, 60, 120, 240),
    )  # fmt: skip


class Viscosity(energies.Energy):
    """Viscosity of an edge, E = c/(2 dt) |(x_j - x_i) - (x_j - x_i)_t|^2 [J], c times relative velocity."""

    name = "viscosity"

    def __init__(self, cloth: sim.Cloth) -> None:
        self.cloth, self.stencils = cloth, cloth.edges
        self.before, self.factor = np.zeros((len(cloth.edges), 3)), 0.0

    def prepare(self, step: energies.Step) -> None:
        """Remember the edges at the start of the step."""
        self.before = step.previous[self.stencils[:, 1]] - step.previous[self.stencils[:, 0]]
        self.factor = VISCOSITY / step.dt

    def value_and_gradient(self, x: np.ndarray) -> tuple[float, np.ndarray]:
        """Return the energy [J] and its gradient (V, 3) [N]."""
        first, second = self.stencils.T
        change = x[second] - x[first] - self.before
        gradient = np.zeros_like(x)
        np.add.at(gradient, second, self.factor * change)
        np.add.at(gradient, first, -self.factor * change)
        return 0.5 * self.factor * float((change**2).sum()), gradient

    def hessian_blocks(self, x: np.ndarray) -> np.ndarray:
        """Return the Hessian of each edge, (E, 6, 6) [N/m]."""
        return np.kron(self.scalar_stiffness(x)[1], np.eye(3))

    def scalar_stiffness(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the edges and their blocks (E, 2, 2) [N/m], the same for all coordinates."""
        block = self.factor * np.array([[1.0, -1.0], [-1.0, 1.0]])
        return np.arange(len(self.stencils)), np.broadcast_to(block, (len(self.stencils), 2, 2))


@known_answer(
    {"hanging_sheet_time_step_order": {"viscous": False}},
    reason="reported: its vibrations are too fast for the steps, so the first order does not show",
)
@known_answer(
    {"viscous_time_step_order": {"viscous": True}},
    expected=1.0, tolerance=0.1, reason="backward Euler; nothing swings too fast for the steps",
)  # fmt: skip
def hanging_sheet_order(viscous: bool) -> float:
    """Return the order in dt of a sheet held at two corners, wrinkled after 0.7 s."""
    from benchmarks.scenes import sheets

    scene = sheets.build_hanging_sheet(HANGING, sheet_cells=6, sheet_frames=22)
    terms = [*scene.energies, *([Viscosity(scene.cloth)] if viscous else [])]
    return halving_order(lambda n: _end(scene.cloth, terms, scene.start, 0.7, n), (42, 84, 168, 336))


def halving_order(end: Callable[[int], np.ndarray], steps: Sequence[int]) -> float:
    """Return the order of `end` (V,3) [m] over numbers of steps, each twice the one before."""
    ends = [end(n) for n in steps]
    distances = [np.sqrt(((a - b) ** 2).sum(axis=1).mean()) for a, b in pairwise(ends)]
    return fitted_order(distances, [1 / n for n in steps[:-1]])


def _end(
    cloth: sim.Cloth, terms: Sequence[energies.Energy], start: np.ndarray, end: float, n: int, **options: Any
) -> np.ndarray:
    """Return positions (V,3) [m] after `end` [s] in n steps, from rest."""
    return motion(cloth, terms, dt=end / n, frames=n + 1, start=start, **options)[-1]
