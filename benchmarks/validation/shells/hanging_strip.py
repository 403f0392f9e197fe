"""Equilibria with an exact curve: a hanging strip and the elastic catenary, both with lambda = 0.

Then a strip is a string of force N = E2 s (s^2 - 1)/2 per width at stretch s, and a strip of 1 m under its
weight w = rho_a g per area follows from the force at each of its points, integrated here by scipy.
"""

from __future__ import annotations

from functools import cache

import numpy as np

import reference_sim as sim
from benchmarks.meshes import in_space, lying, right_grid
from benchmarks.validation.case import known_answer
from benchmarks.validation.convergence import demand_converged, fitted_order
from reference_sim import energies

E2 = 32.965  # [N/m] membrane modulus
THICKNESS = 0.47e-3
MATERIAL = sim.Material(young_modulus=E2 / THICKNESS, poisson_ratio=0.0, thickness=THICKNESS)
WEIGHT = MATERIAL.areal_density * sim.GRAVITY  # [N/m^2]
SPAN = 0.8  # [m] between the ends of the catenary
ROWS = (12, 24, 48)


def string_stretch(force: float) -> float:
    """Return s with E2 s (s^2 - 1)/2 = force [N/m]."""
    from scipy.optimize import brentq

    return brentq(lambda s: E2 * s * (s * s - 1) / 2 - force, 1.0, 3.0, xtol=1e-15)


def exact_tip() -> float:
    """Return the length [m] of the strip of 1 m hanging by one end."""
    from scipy.integrate import quad

    return quad(lambda hanging: string_stretch(WEIGHT * hanging), 0, 1, epsabs=1e-13)[0]


@known_answer(unit="m", tolerance=2e-6, reason="second order in 1/24 of the length")
def hanging_strip_tip() -> tuple[float, float]:
    """Return the distance of the free end of a 1 m strip from the hung one, measured and exact."""
    return _hanging(ROWS[1]), exact_tip()


@known_answer(expected=2.0, tolerance=0.2, reason="12, 24 and 48 cells are few")
def hanging_strip_order() -> float:
    """Return the order in h of the tip of a hanging strip."""
    exact = exact_tip()
    return fitted_order([abs(_hanging(rows) - exact) for rows in ROWS], [1 / rows for rows in ROWS])


def _hanging(rows: int) -> float:
    points, faces = right_grid(rows, 4, 1.0, 4.0 / rows)
    points[:, 1] -= 1.0  # the top edge at y = 0
    cloth = sim.Cloth(in_space(points), faces, MATERIAL, pins=np.flatnonzero(points[:, 1] > -1e-9))
    x = _at_rest(cloth, cloth.rest_positions * [1.0, 1.02, 1.0])[1]
    return float(-x[points[:, 1] < -1 + 1e-9, 1].mean())


def exact_catenary() -> dict[str, float]:
    """Return the horizontal "force" per width on an end [N/m] and the "sag" [m] of the elastic catenary.

    X is measured from the lowest point.
    """
    from scipy.integrate import quad
    from scipy.optimize import brentq

    def over_half(force: float, vertical: bool) -> float:
        def share(X: float) -> float:
            N = float(np.hypot(force, WEIGHT * X))
            return string_stretch(N) * (WEIGHT * X if vertical else force) / N

        return quad(share, 0, 0.5, epsabs=1e-13)[0]

    force = brentq(lambda H: 2 * over_half(H, False) - SPAN, 0.01, 10.0, xtol=1e-14)
    return {"force": force, "sag": over_half(force, True)}


@known_answer(["catenary_force"], unit="N/m", tolerance=2e-4, reason="second order in 1/48 of the length")
@known_answer(["catenary_sag"], unit="m", tolerance=1e-4, reason="second order in 1/48 of the length")
@cache
def catenary() -> dict[str, tuple[float, float]]:
    """Return the horizontal force per width, or the sag, of an elastic catenary, 1 m over a span of 0.8 m."""
    measured, exact = _catenary(ROWS[-1]), exact_catenary()
    return {f"catenary_{name}": (measured[name], exact[name]) for name in exact}


@known_answer(expected=2.0, tolerance=0.1, reason="12, 24 and 48 cells are few")
def catenary_order() -> float:
    """Return the order in h of the sag of an elastic catenary."""
    exact = exact_catenary()["sag"]
    return fitted_order([abs(_catenary(rows)["sag"] - exact) for rows in ROWS], [1 / rows for rows in ROWS])


def _catenary(columns: int) -> dict[str, float]:
    width = 2.0 / columns
    points, faces = right_grid(2, columns, width, 1.0)
    rest = lying(points)
    ends = np.flatnonzero((points[:, 0] < 1e-9) | (points[:, 0] > 1 - 1e-9))
    cloth = sim.Cloth(rest, faces[:, ::-1], MATERIAL, pins=ends)
    start = rest * [SPAN, 1.0, 1.0] - [0.5 * SPAN, 0.0, 0.0]
    start[:, 1] = -0.28 * (1 - (2 * start[:, 0] / SPAN) ** 2)  # near the answer, not it
    potential, x = _at_rest(cloth, start)
    left = points[:, 0] < 1e-9
    middle = np.abs(points[:, 0] - 0.5) < 1e-9
    force = -potential.gradient(x)[left, 0].sum() / width
    return {"force": float(force), "sag": float(-x[middle, 1].mean())}


def _at_rest(cloth: sim.Cloth, start: np.ndarray) -> tuple[sim.Potential, np.ndarray]:
    potential = sim.Potential([energies.StretchStVK(cloth), energies.Gravity(cloth)])
    return potential, demand_converged(sim.minimise(potential, start, tolerance=1e-9), "the strip").positions
