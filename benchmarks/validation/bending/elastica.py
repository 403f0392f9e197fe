"""Large bending: a clamped strip against Euler's elastica, which scipy integrates here.

Hinges stand for a plate stiffness D that depends on the mesh (see plates.py). So D is calibrated once per
mesh, from its small deflections, and what is judged is the shape at large ones; the spread of D over the
families is a number of its own, the price of hinge bending.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
import scipy.sparse.linalg as spla
from scipy.integrate import solve_bvp

from benchmarks.meshes import FAMILIES, ROW, in_space, rectangle
from benchmarks.validation.convergence import demand_converged
from benchmarks.validation.dead_load import DeadLoad
from reference_sim.cloth import Cloth
from reference_sim.energies.bend_hinge.definition import BendHinge
from reference_sim.energies.energy import Energy
from reference_sim.energies.gravity import Gravity
from reference_sim.energies.stretch_stvk.definition import StretchStVK
from reference_sim.material import Material
from reference_sim.minimise.minimisers import minimise
from reference_sim.potential import Potential

K = 1e-3  # [J] hinge stiffness
# 330 N/m: at Gamma = 1000 the strip weighs 0.9 N per metre of width, and stretches by 0.3 %.
MATERIAL = Material(young_modulus=700e3, poisson_ratio=0.0, bending_stiffness=K)
ROWS = 2  # narrow, so that the cross-section never has to stay flat
COLUMNS = 120
SYMMETRIC = ("cross", "union_jack", "equilateral", "delaunay")


@dataclass(frozen=True)
class Strip:
    """Horizontal strip of 1 m, clamped at x = 0; cell and width [m], plate stiffness D [J]."""

    cloth: Cloth
    cell: float
    width: float
    D: float


@cache
def strip(family: str, scaling: str = "length_area") -> Strip:
    """Make a strip with two pinned columns, half a cell to each side of the clamp, and calibrate its D."""
    h = 1 / (COLUMNS - 0.5)
    width = ROWS * h * (ROW if family == "equilateral" else 1.0)
    points, faces = rectangle(family, COLUMNS, ROWS, COLUMNS * h, width)
    points[:, 0] -= h / 2
    x = in_space(points)[:, [0, 2, 1]]  # the strip lies in the plane y = 0
    cloth = Cloth(x, faces[:, ::-1], MATERIAL, pins=np.flatnonzero(points[:, 0] < 0.51 * h))
    return Strip(cloth, h, width, _calibrated(BendHinge(cloth, scaling=scaling), width))


def _calibrated(bend: BendHinge, width: float) -> float:
    """Return D from the tip's small deflection under a unit load per area: 1/(8 D)."""
    cloth = bend.cloth
    stiffness = Potential([bend]).hessian(cloth.rest_positions).tocsr()[1::3][:, 1::3]
    free = np.setdiff1d(np.arange(cloth.vertex_count), cloth.pins)
    w = np.zeros(cloth.vertex_count)
    w[free] = spla.spsolve(stiffness[free][:, free].tocsc(), cloth.vertex_areas[free])
    return 1 / (8 * float(w[tip(cloth)].mean()))


def tip(cloth: Cloth) -> np.ndarray:
    """Return the vertices of the free end."""
    return np.flatnonzero(cloth.rest_positions[:, 0] > 1 - 1e-9)


@cache
def exact_elastica(weight: float, load: float) -> tuple[np.ndarray, np.ndarray]:
    """Integrate the elastica of length 1 under its weight and a force at its end: s (n,), (x, drop) (2, n).

    theta, downwards, obeys theta'' = -(weight (1 - s) + load) cos theta, theta(0) = 0, theta'(1) = 0; weight
    is Gamma = rho_a g L^3 / D, load is P L^2 / D.
    """
    s = np.linspace(0, 1, 200)
    y = np.zeros((4, len(s)))  # theta, theta', x, drop
    for f in np.linspace(0.05, 1, 20):  # the load grows, each shape starting from the last

        def slope(s, y, f=f):
            force = f * (weight * (1 - s) + load)
            return np.stack([y[1], -force * np.cos(y[0]), np.cos(y[0]), np.sin(y[0])])

        solution = solve_bvp(slope, _clamp_and_free_end, s, y, tol=1e-8, max_nodes=20000)
        if not solution.success:
            raise RuntimeError(f"the elastica could not be integrated: {solution.message}")
        s, y = solution.x, solution.y
    return s, y[2:]


def _clamp_and_free_end(start: np.ndarray, end: np.ndarray) -> np.ndarray:
    return np.array([start[0], end[1], start[2], start[3]])


def bent_strip(family: str, weight: float, load: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the tip of the strip and of the elastica, (x, drop) [m] each."""
    made = strip(family)
    cloth = made.cloth
    acceleration = weight * made.D / MATERIAL.areal_density
    energies: list[Energy] = [StretchStVK(cloth), BendHinge(cloth)]
    if weight:
        energies.append(Gravity(cloth, acceleration=acceleration))
    if load:
        end = tip(cloth)
        forces = np.zeros_like(cloth.rest_positions)
        share = cloth.vertex_areas[end] / cloth.vertex_areas[end].sum()
        forces[end, 1] = -load * made.D * made.width * share
        energies.append(DeadLoad(cloth, forces))
    s, (x, drop) = exact_elastica(weight, load)
    rest = cloth.rest_positions
    guess = rest.copy()  # on the elastica: near the answer, not it
    free = rest[:, 0] > made.cell
    guess[free, 0] = np.interp(rest[free, 0], s, x)
    guess[free, 1] = -np.interp(rest[free, 0], s, drop)
    strength = (weight + load) * made.D / MATERIAL.areal_density / 9.81
    result = minimise(Potential(energies), guess, tolerance=1e-6 * strength)
    demand_converged(result, f"the strip of {family} triangles")
    end = result.positions[tip(cloth)].mean(axis=0)
    return np.array([end[0], -end[1]]), np.array([x[-1], drop[-1]])


def heavy(gamma: float) -> float:
    """Return the tip's distance to the elastica under weight, over its length, worst of four families."""
    return max(_tip_distance(family, gamma, 0.0) for family in SYMMETRIC)


def end_loaded(load: float) -> float:
    """Return the distance of the tip to the elastica's under a force at the end, worst of four families."""
    return max(_tip_distance(family, 0.0, load) for family in SYMMETRIC)


def one_sided_diagonals(gamma: float) -> float:
    """Return the tip's distance where all diagonals lean one way: such a strip twists, no elastica."""
    return _tip_distance("right", gamma, 0.0)


def _tip_distance(family: str, weight: float, load: float) -> float:
    ours, exact = bent_strip(family, weight, load)
    return float(np.linalg.norm(ours - exact))


def stiffness_spread(scaling: str) -> float:
    """Return the largest over the smallest D of the five families at one k."""
    stiffnesses = [strip(family, scaling).D for family in FAMILIES]
    return max(stiffnesses) / min(stiffnesses)
