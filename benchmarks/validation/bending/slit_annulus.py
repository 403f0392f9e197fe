"""Slit annular plate (Sze, Liu and Lo 2004): clamped at one lip of the slit, the other lifted by a line load.

E = 21 MPa, nu = 0, thickness 0.03 m, radii 6 and 10 m, 0.8 N/m on the free lip. Shells of the literature
lift its inner corner by 13.891 m and the outer by 17.528 m.

Hinges have a Poisson ratio of -1/3 (see plates.py), so bending and torsion cannot both be right: with
C11 (1 - nu^2) set to the plate's D, torsion is a half too stiff. What comes out is the price of that.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from benchmarks.meshes import rectangle
from benchmarks.validation.convergence import demand_converged
from benchmarks.validation.dead_load import DeadLoad
from reference_sim.cloth import Cloth
from reference_sim.energies.bend_hinge.definition import BendHinge
from reference_sim.energies.stretch_stvk.definition import StretchStVK
from reference_sim.material import Material
from reference_sim.minimise.minimisers import minimise
from reference_sim.potential import Potential

INNER, OUTER, LOAD = 6.0, 10.0, 0.8
YOUNG, THICKNESS = 21e6, 0.03
COLUMNS, ROWS = 120, 8  # around and across, so that triangles half-way are equilateral
STAGES = 12


def corner(which: str) -> float:
    """Return the lift [m] of the free lip's "inner" or "outer" corner."""
    inner, outer = _lifted()
    return inner if which == "inner" else outer


@cache
def _lifted() -> tuple[float, float]:
    D = YOUNG * THICKNESS**3 / 12
    k = D / (1 / 4 * (1 - 1 / 9))
    material = Material(
        young_modulus=YOUNG, poisson_ratio=0.0, thickness=THICKNESS, density=1.0, bending_stiffness=k
    )
    flat, faces = rectangle("equilateral", COLUMNS, ROWS, 2 * np.pi, OUTER - INNER)
    turn, radius = flat[:, 0] * COLUMNS / (COLUMNS - 0.5), INNER + flat[:, 1]
    turn -= turn[turn > 1e-9].min() / 2  # the clamp lies half-way between the two pinned columns
    rest = np.stack([radius * np.cos(turn), 0.0 * turn, -radius * np.sin(turn)], axis=1)
    pins = np.flatnonzero(turn < 2 * np.pi / COLUMNS * 0.6)
    cloth = Cloth(rest, faces, material, pins=pins)
    lip = np.flatnonzero(turn > 2 * np.pi - 1e-6)
    lip = lip[np.argsort(radius[lip])]
    share = np.gradient(radius[lip])
    share[[0, -1]] /= 2
    forces = np.zeros_like(rest)
    x = rest.copy()
    x[:, 1] = 1e-3 * turn**2
    x[pins] = rest[pins]
    for stage in range(1, STAGES + 1):
        forces[lip, 1] = LOAD * share * (stage / STAGES) ** 2
        potential = Potential([StretchStVK(cloth), BendHinge(cloth), DeadLoad(cloth, forces)])
        x = demand_converged(minimise(potential, x, tolerance=1e-4), f"the plate at stage {stage}").positions
    return float(x[lip[0], 1]), float(x[lip[-1], 1])
