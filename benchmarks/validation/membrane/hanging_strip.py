"""Equilibria with an exact curve: a hanging strip and the elastic catenary, both with lambda = 0.

Then a strip is a string of force N = E2 s (s^2 - 1)/2 per width at stretch s, and a strip of 1 m under its
weight w = rho_a g per area follows from the force at each of its points, integrated here by scipy.
"""

from __future__ import annotations

import numpy as np
from scipy.integrate import quad
from scipy.optimize import brentq

from benchmarks.meshes import in_space, lying, right_grid
from benchmarks.validation.convergence import demand_converged, fitted_order
from reference_sim.cloth import Cloth
from reference_sim.energies.gravity import Gravity
from reference_sim.energies.stretch_stvk import StretchStVK
from reference_sim.material import GRAVITY, Material
from reference_sim.minimise.minimisers import minimise
from reference_sim.potential import Potential

E2 = 32.965  # [N/m] membrane modulus
THICKNESS = 0.47e-3
MATERIAL = Material(young_modulus=E2 / THICKNESS, poisson_ratio=0.0, thickness=THICKNESS)
WEIGHT = MATERIAL.areal_density * GRAVITY  # [N/m^2]
SPAN = 0.8  # [m] between the ends of the catenary
ROWS = (12, 24, 48)


def string_stretch(force: float) -> float:
    """Return s with E2 s (s^2 - 1)/2 = force [N/m]."""
    return brentq(lambda s: E2 * s * (s * s - 1) / 2 - force, 1.0, 3.0, xtol=1e-15)


def exact_tip() -> float:
    """Return the length [m] of the strip of 1 m hanging by one end."""
    return quad(lambda hanging: string_stretch(WEIGHT * hanging), 0, 1, epsabs=1e-13)[0]


def hanging_strip_tip() -> tuple[float, float]:
    """Return the distance [m] of the free end from the hung one, measured and exact."""
    return _hanging(ROWS[1]), exact_tip()


def hanging_strip_order() -> float:
    """Return the order at which that distance converges."""
    exact = exact_tip()
    return fitted_order([abs(_hanging(rows) - exact) for rows in ROWS], [1 / rows for rows in ROWS])


def _hanging(rows: int) -> float:
    points, faces = right_grid(rows, 4, 1.0, 4.0 / rows)
    points[:, 1] -= 1.0  # the top edge at y = 0
    cloth = Cloth(in_space(points), faces, MATERIAL, pins=np.flatnonzero(points[:, 1] > -1e-9))
    x = _at_rest(cloth, cloth.rest_positions * [1.0, 1.02, 1.0])[1]
    return float(-x[points[:, 1] < -1 + 1e-9, 1].mean())


def exact_catenary() -> dict[str, float]:
    """Return the horizontal "force" per width on an end [N/m] and the "sag" [m] of the elastic catenary.

    X is measured from the lowest point.
    """

    def over_half(force: float, vertical: bool) -> float:
        def share(X: float) -> float:
            N = float(np.hypot(force, WEIGHT * X))
            return string_stretch(N) * (WEIGHT * X if vertical else force) / N

        return quad(share, 0, 0.5, epsabs=1e-13)[0]

    force = brentq(lambda H: 2 * over_half(H, False) - SPAN, 0.01, 10.0, xtol=1e-14)
    return {"force": force, "sag": over_half(force, True)}


def catenary(what: str) -> tuple[float, float]:
    """Return the "force" [N/m] or the "sag" [m] of the catenary, measured and exact."""
    return _catenary(ROWS[-1])[what], exact_catenary()[what]


def catenary_order() -> float:
    """Return the order at which the sag converges."""
    exact = exact_catenary()["sag"]
    return fitted_order([abs(_catenary(rows)["sag"] - exact) for rows in ROWS], [1 / rows for rows in ROWS])


def _catenary(columns: int) -> dict[str, float]:
    width = 2.0 / columns
    points, faces = right_grid(2, columns, width, 1.0)
    rest = lying(points)
    ends = np.flatnonzero((points[:, 0] < 1e-9) | (points[:, 0] > 1 - 1e-9))
    cloth = Cloth(rest, faces[:, ::-1], MATERIAL, pins=ends)
    start = rest * [SPAN, 1.0, 1.0] - [0.5 * SPAN, 0.0, 0.0]
    start[:, 1] = -0.28 * (1 - (2 * start[:, 0] / SPAN) ** 2)  # near the answer, not it
    potential, x = _at_rest(cloth, start)
    left = points[:, 0] < 1e-9
    middle = np.abs(points[:, 0] - 0.5) < 1e-9
    force = -potential.gradient(x)[left, 0].sum() / width
    return {"force": float(force), "sag": float(-x[middle, 1].mean())}


def _at_rest(cloth: Cloth, start: np.ndarray) -> tuple[Potential, np.ndarray]:
    potential = Potential([StretchStVK(cloth), Gravity(cloth)])
    return potential, demand_converged(minimise(potential, start, tolerance=1e-9), "the strip").positions
