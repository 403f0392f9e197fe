"""Known answers of time integration: a triangle that scipy solves, and its order in dt.

Pendulum: one triangle hangs by its base; by symmetry its third vertex stays half-way between the two
pins, at a distance r from the base that was h at rest, with E(r) = A (lambda/2 + mu) G^2, G = ((r/h)^2 -
1)/2.
"""

from __future__ import annotations

import numpy as np

import reference_sim as sim
from benchmarks.validation.case import known_answer
from benchmarks.validation.equilibrium import farthest, motion, order
from reference_sim import energies

SOFT = sim.Material(young_modulus=7e3)
HEIGHT, BASE = 0.5, 0.4  # [m] of the triangle
MASS = SOFT.areal_density * HEIGHT * BASE / 2 / 3
RIGIDITY = HEIGHT * BASE / 2 * (SOFT.lame_lambda / 2 + SOFT.lame_mu)  # [J] A (lambda/2 + mu)


def _pull(r: float) -> float:
    """Return dE/dr of the pendulum [N]."""
    return RIGIDITY * ((r / HEIGHT) ** 2 - 1) * r / HEIGHT**2


def _swing_pendulum(
    start: np.ndarray, dt: float, frames: int, *, gravity: float = sim.GRAVITY
) -> np.ndarray:
    """Return the path (frames, 2) [m] of the free vertex across the base, from `start` (2,), at rest."""
    rest = np.array([[0.0, 0.0, -BASE / 2], [0.0, 0.0, BASE / 2], [HEIGHT, 0.0, 0.0]])
    cloth = sim.Cloth(rest, np.array([[0, 1, 2]]), SOFT, pins=[0, 1])
    x = rest.copy()
    x[2, :2] = start
    terms = [energies.StretchStVK(cloth), energies.Gravity(cloth, acceleration=gravity)]
    return motion(cloth, terms, dt=dt, frames=frames, start=x, tolerance=1e-11)[:, 2, :2]


@known_answer(
    unit="m", expected=0.0, tolerance=1e-10, reason="scipy's tolerance, 1e-12 a step, summed twice"
)
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
    return farthest(_swing_pendulum(start, dt, 61), np.array(path[1:]))


@known_answer(
    expected=1.0, tolerance=0.1, reason="backward Euler; its second order still shows at 1/480 s"
)
def time_step_order() -> float:
    """Return the order in dt of the pendulum's place after half a second, against scipy."""
    from scipy.integrate import solve_ivp

    start, end = np.array([0.52, 0.1]), 0.5

    def rate(_, state):
        q, v = state[:2], state[2:]
        r = np.hypot(*q)
        return np.concatenate([v, -_pull(r) / MASS * q / r - [0.0, sim.GRAVITY]])

    exact = solve_ivp(rate, (0, end), [*start, 0.0, 0.0], rtol=1e-10, atol=1e-12).y[:2, -1]

    def error(n: int) -> float:
        return float(np.linalg.norm(_swing_pendulum(start, end / n, n + 1)[-1] - exact))

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
    path = _swing_pendulum(np.array([HEIGHT + amplitude, 0.0]), fitted_dt, 31, gravity=0.0)[:, 0] - HEIGHT
    velocity = np.diff(path)[-1] / fitted_dt
    share = np.hypot(path[-1], velocity / natural) / amplitude
    return float(share), float((1 + (frequency * dt) ** 2) ** -15)
