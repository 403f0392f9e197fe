"""Elastica: exact shape of an inextensible strip under its weight, integrated by scipy.

    theta'' = -(weight (1 - s) + load) cos theta,   theta(0) = 0, theta'(1) = 0

with theta downwards, s from the clamp over the length L, weight Gamma = rho_a g L^3 / D and load P L^2 / D.
Height over width of its tip against Gamma is the master curve by which Romero et al. 2021 validate
simulators; the angle of its chord is what ASTM D1388 measures.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from scipy.integrate import solve_bvp

LEAST, MOST, POINTS = 1e-2, 3e3, 71  # Gamma of the table that bending lengths are read from


@cache
def exact_elastica(weight: float, load: float) -> tuple[np.ndarray, np.ndarray]:
    """Integrate the elastica of length 1 under its weight and a force at its end.

    Returns:
        s (n,) and (x, drop) (2, n), all over the length.

    Raises:
        RuntimeError: scipy finds no solution.
    """
    s = np.linspace(0, 1, 200)
    y = np.zeros((4, len(s)))  # theta, theta', x, drop
    for f in np.linspace(0.05, 1, 20):  # the load grows, each shape starting from the last
        s, y = _integrated(f * weight, f * load, s, y)
    return s, y[2:]


def _integrated(weight: float, load: float, s: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Solve the boundary value problem from the shape y (4, n) at s (n,)."""

    def slope(s: np.ndarray, y: np.ndarray) -> np.ndarray:
        force = weight * (1 - s) + load
        return np.stack([y[1], -force * np.cos(y[0]), np.cos(y[0]), np.sin(y[0])])

    solution = solve_bvp(slope, _clamp_and_free_end, s, y, tol=1e-8, max_nodes=20000)
    if not solution.success:
        raise RuntimeError(f"the elastica could not be integrated: {solution.message}")
    return solution.x, solution.y


def _clamp_and_free_end(start: np.ndarray, end: np.ndarray) -> np.ndarray:
    return np.array([start[0], end[1], start[2], start[3]])


@cache
def master_curve() -> tuple[np.ndarray, np.ndarray]:
    """Return Gamma (n,) and the angle (n,) [rad] below the horizontal of the chord from clamp to tip."""
    gammas = np.geomspace(LEAST, MOST, POINTS)
    s, y = np.linspace(0, 1, 200), np.zeros((4, 200))
    angles = []
    for gamma in gammas:
        s, y = _integrated(gamma, 0.0, s, y)
        angles.append(np.arctan2(y[3, -1], y[2, -1]))
    return gammas, np.array(angles)


def bending_length(overhang: float, angle: float) -> float:
    """Return the bending length [m] of a strip of that overhang [m] whose chord hangs at `angle` [rad].

    The strip of ASTM D1388, whose overhang is twice its bending length, hangs at 41.5 degrees:

    >>> round(bending_length(0.040, np.radians(41.5)), 4)
    0.02

    Where the angle is outside the table, the nearest end of it is taken.
    """
    gammas, angles = master_curve()
    # Gamma is close to a multiple of tan(angle) at small angles: the quotient is smooth enough for a line.
    quotient = np.interp(angle, angles, np.log(gammas / np.tan(angles)))
    return overhang / float(np.exp(quotient) * np.tan(np.clip(angle, angles[0], angles[-1]))) ** (1 / 3)
