"""Equilibria with an exact curve."""

from __future__ import annotations

import numpy as np

from reference_sim import Cloth, Material, Potential, minimise
from reference_sim.energies import Gravity, StretchStVK

from .meshes import in_space, right_grid

E2 = 32.965  # [N/m] membrane modulus
ROWS = 24


def hanging_strip_tip() -> float:
    """Distance [m] of the free end from the hung one, for a strip of 1 m with lambda = 0.

    Exact: the stretch s at a distance X from the top obeys s (s^2 - 1)/2 E2 = rho_a g (1 - X).
    """
    thickness = 0.47e-3
    material = Material(young_modulus=E2 / thickness, poisson_ratio=0.0, thickness=thickness)
    points, faces = right_grid(ROWS, 4, 1.0, 4.0 / ROWS)
    points[:, 1] -= 1.0  # the top edge at y = 0
    top = np.flatnonzero(points[:, 1] > -1e-9)
    cloth = Cloth(in_space(points), faces, material, pins=top)
    potential = Potential([StretchStVK(cloth), Gravity(cloth)])
    result = minimise(potential, cloth.rest_positions * [1.0, 1.02, 1.0])
    if result.status != "converged":
        raise RuntimeError(f"the strip did not come to rest: {result.reason}")
    end = np.flatnonzero(points[:, 1] < -1 + 1e-9)
    return float(-result.positions[end, 1].mean())
