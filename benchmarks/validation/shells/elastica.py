"""Large bending: a clamped strip against Euler's elastica, which scipy integrates.

Hinges stand for a plate stiffness D that depends on the mesh (see plates.py). So D, and where the clamp acts,
are calibrated once per mesh from small deflections (see benchmarks.fabrics.strip), and what is judged is the
shape at large ones.
"""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

import numpy as np

import reference_sim as sim
from benchmarks.validation.case import known_answer
from benchmarks.validation.convergence import demand_converged
from benchmarks.validation.dead_load import DeadLoad
from reference_sim import energies

if TYPE_CHECKING:
    from benchmarks.fabrics.strip import Strip

K = 1e-3  # [J] hinge stiffness
# 330 N/m: at Gamma = 1000 the strip weighs 0.9 N per metre of width, and stretches by 0.3 %.
MATERIAL = sim.Material(young_modulus=700e3, poisson_ratio=0.0, bending_stiffness=K)
COLUMNS = 120
SYMMETRIC = ("cross", "union_jack", "equilateral", "delaunay")


@cache
def strip(family: str, columns: int) -> Strip:
    """Return a strip of 1 m, clamped at x = 0."""
    from benchmarks.fabrics.strip import clamped_strip

    return clamped_strip(family, columns, 1.0, MATERIAL)


def bent_strip(
    family: str, weight: float, load: float, columns: int = COLUMNS
) -> tuple[np.ndarray, np.ndarray]:
    """Return the chord of the strip and of the elastica, (width, height) each, over the length."""
    from benchmarks.fabrics.elastica import exact_elastica

    made = strip(family, columns)
    cloth, length = made.cloth, made.length
    acceleration = weight * made.stiffness / length**3 / MATERIAL.areal_density
    terms: list[energies.Energy] = [energies.StretchStVK(cloth), energies.BendHinge(cloth)]
    if weight:
        terms.append(energies.Gravity(cloth, acceleration=acceleration))
    if load:
        forces = np.zeros_like(cloth.rest_positions)
        share = cloth.vertex_areas[made.tip] / cloth.vertex_areas[made.tip].sum()
        forces[made.tip, 1] = -load * made.stiffness / length**2 * made.width * share
        terms.append(DeadLoad(cloth, forces))
    s, (x, drop) = exact_elastica(weight, load)
    rest = cloth.rest_positions
    guess = rest.copy()  # on the elastica: near the answer, not it
    free = rest[:, 0] > made.cell
    guess[free, 0] = np.interp(rest[free, 0], s, x)
    guess[free, 1] = -np.interp(rest[free, 0], s, drop)
    strength = (weight + load) * made.stiffness / MATERIAL.areal_density / 9.81
    result = sim.minimise(sim.Potential(terms), guess, tolerance=1e-6 * strength)
    demand_converged(result, f"the strip of {family} triangles")
    return made.chord(result.positions) / length, np.array([x[-1], drop[-1]])


def slenderness(gamma: float, columns: int) -> float:
    """Return height over width of the chord at that Gamma, over the elastica's, on `columns` cells."""
    from benchmarks.fabrics.strip import FAMILY

    ours, exact = bent_strip(FAMILY, gamma, 0.0, columns)
    return float((ours[1] / ours[0]) / (exact[1] / exact[0]))


@known_answer(
    {
        "end_loaded_cantilever_1": {"load": 1.0},
        "end_loaded_cantilever_3": {"load": 3.0},
        "end_loaded_cantilever_10": {"load": 10.0},
        "heavy_elastica_10": {"weight": 10.0},
    },
    smoke=False, expected=0.0, tolerance=3e-3, reason="120 cells, their error halves with the cell",
)  # fmt: skip
@known_answer(
    {"heavy_elastica_100": {"weight": 100.0}, "heavy_elastica_1000": {"weight": 1000.0}},
    smoke=False, expected=0.0, tolerance=6e-3, reason="120 cells, their error halves with the cell",
)  # fmt: skip
@known_answer(
    {"heavy_elastica_1": {"weight": 1.0}},
    smoke=False, expected=0.0, tolerance=1e-4, reason="120 cells, their error halves with the cell",
)  # fmt: skip
def tip_distance(weight: float = 0.0, load: float = 0.0) -> float:
    """Return the distance of a cantilever's tip to the elastica, over its length, worst of the families.

    It bends under a weight, Gamma, or under a force at the end. Where all diagonals lean one way, as in
    family "right", which is left out, the strip twists and is no elastica.
    """
    bent = (bent_strip(family, weight, load) for family in SYMMETRIC)
    return max(float(np.linalg.norm(ours - exact)) for ours, exact in bent)
