"""Clamped strip, calibrated from small deflections, and Euler's elastica, which scipy integrates.

    theta'' = -(weight (1 - s) + load) cos theta,   theta(0) = 0, theta'(1) = 0

with theta downwards, s from the clamp over the length L, weight Gamma = rho_a g L^3 / D and load P L^2 /
D.

Hinges stand for a plate stiffness D that depends on the mesh (see plates.py), and the clamp, two pinned
columns of vertices, acts somewhere between them: the triangles between them cannot bend. Both follow from
one linear solve, the small deflection w of the strip under a unit load per area and its slope w' at the
tip:

    w = l^4 / (8 D),   w' = l^3 / (6 D)   =>   l = 4 w / (3 w'),   D = l^4 / (8 w)

with l the length from where the clamp acts to the tip.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

import reference_sim as sim
from benchmarks.meshes import ROW, rectangle
from benchmarks.validation.equilibrium import flat_cloth
from reference_sim import energies

# Cells across a strip: narrow, so that the cross-section never has to stay flat.
ROWS = 2


@cache
def exact_elastica(weight: float, load: float) -> tuple[np.ndarray, np.ndarray]:
    """Return s (n,) and (x, drop) (2, n) of the elastica of length 1. Raises as `solve_elastica`."""
    s = np.linspace(0, 1, 200)
    y = np.zeros((4, len(s)))  # theta, theta', x, drop
    for f in np.linspace(0.05, 1, 20):  # the load grows, each shape starting from the last
        s, y = solve_elastica(f * weight, f * load, s, y)
    return s, y[2:]


def solve_elastica(
    weight: float, load: float, s: np.ndarray, y: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Solve the boundary value problem from the shape y (4, n), theta, theta', x and drop, at s (n,).

    Raises RuntimeError where scipy finds no solution.
    """
    from scipy.integrate import solve_bvp

    def slope(s: np.ndarray, y: np.ndarray) -> np.ndarray:
        force = weight * (1 - s) + load
        return np.stack([y[1], -force * np.cos(y[0]), np.cos(y[0]), np.sin(y[0])])

    def ends(clamp: np.ndarray, tip: np.ndarray) -> np.ndarray:
        return np.array([clamp[0], tip[1], clamp[2], clamp[3]])

    solution = solve_bvp(slope, ends, s, y, tol=1e-8, max_nodes=20000)
    if not solution.success:
        raise RuntimeError(f"the elastica could not be integrated: {solution.message}")
    return solution.x, solution.y


@dataclass(frozen=True)
class Strip:
    """Horizontal strip along x, clamped near x = 0."""

    cloth: sim.Cloth
    cell: float  # [m]
    width: float  # [m]
    stiffness: float  # [J] plate stiffness D of its hinges
    clamp: float  # [m] x where the clamp acts

    @property
    def tip(self) -> np.ndarray:
        """Vertices of the free end."""
        x = self.cloth.rest_positions[:, 0]
        return np.flatnonzero(x > x.max() - 1e-6 * self.cell)

    @property
    def length(self) -> float:
        """Length [m] from where the clamp acts to the free end."""
        return float(self.cloth.rest_positions[:, 0].max() - self.clamp)

    def chord(self, x: np.ndarray) -> np.ndarray:
        """Return (width, height) [m] of the chord from clamp to tip, height downwards, at x (V, 3) [m]."""
        tip = x[self.tip].mean(axis=0)
        return np.array([tip[0] - self.clamp, -tip[1]])


def clamped_strip(family: str, columns: int, length: float, material: sim.Material) -> Strip:
    """Make a strip with two pinned columns, half a cell to each side of x = 0, and calibrate it.

    Args:
        family: of triangles, see meshes.FAMILIES.
        columns: cells along the strip.
        length: from x = 0 to the free end [m].
        material: of the cloth.
    """
    import scipy.sparse.linalg as spla

    cell = length / (columns - 0.5)
    width = ROWS * cell * (ROW if family == "equilateral" else 1.0)
    points, faces = rectangle(family, columns, ROWS, columns * cell, width)
    points[:, 0] -= cell / 2
    cloth = flat_cloth(points, faces, material, held=points[:, 0] < 0.51 * cell, lies=True)
    # The small deflection w (V,) [m] under a unit load per area [Pa], linearly.
    hessian = sim.Potential([energies.BendHinge(cloth)]).hessian(cloth.rest_positions)
    stiffness = hessian.tocsr()[1::3][:, 1::3]
    free = np.flatnonzero(cloth.free)
    w = np.zeros(cloth.vertex_count)
    w[free] = spla.spsolve(stiffness[free][:, free].tocsc(), cloth.vertex_areas[free])
    ends = [w[np.abs(points[:, 0] - at) < 1e-6 * cell].mean() for at in (length, length - 2 * cell)]
    acting = 4 * ends[0] / (3 * (ends[0] - ends[1]) / (2 * cell))
    return Strip(cloth, cell, width, float(acting**4 / (8 * ends[0])), float(length - acting))
