"""Clamped strip of a fabric: the cantilever of ASTM D1388, option A, and of Romero et al. 2021.

Hinges stand for a plate stiffness D that depends on the mesh, and the clamp, two pinned columns of vertices,
acts somewhere between them: the triangles between them cannot bend. Both follow from one linear solve, the
small deflection w of the strip under a unit load per area and its slope w' at the tip:

    w = l^4 / (8 D),   w' = l^3 / (6 D)   =>   l = 4 w / (3 w'),   D = l^4 / (8 w)

with l the length from where the clamp acts to the tip. What is tested then is the shape at large deflections.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse.linalg as spla

from benchmarks.fabrics.elastica import bending_length
from benchmarks.fabrics.fabric import SNUG, Fabric
from benchmarks.meshes import ROW, lying, rectangle
from reference_sim.cloth import Cloth
from reference_sim.energies.bend_hinge import BendHinge
from reference_sim.material import GRAVITY, Material
from reference_sim.potential import Potential

BENDING_LENGTH = "fabric/bending_length"
FAMILY, ROWS = "union_jack", 2  # symmetric, and narrow, so that the cross-section never has to stay flat
OVERHANG = 2.0  # over the bending length: there the chord hangs at 41.5 degrees, as ASTM D1388 asks


@dataclass(frozen=True)
class Strip:
    """Horizontal strip along x, clamped near x = 0.

    Attributes:
        cloth: rest state.
        cell, width: [m].
        stiffness: plate stiffness D [J] of its hinges.
        clamp: x [m] where the clamp acts.
    """

    cloth: Cloth
    cell: float
    width: float
    stiffness: float
    clamp: float

    @property
    def start(self) -> np.ndarray:
        """Positions (V, 3) [m] before it bends: flat."""
        return self.cloth.rest_positions

    @property
    def tip(self) -> np.ndarray:
        """Vertices of the free end."""
        x = self.cloth.rest_positions[:, 0]
        return np.flatnonzero(x > x.max() - 1e-6 * self.cell)

    @property
    def length(self) -> float:
        """Length [m] from where the clamp acts to the free end."""
        return float(self.cloth.rest_positions[:, 0].max() - self.clamp)

    def hanging_along(self, s: np.ndarray, aside: np.ndarray, depth: np.ndarray) -> np.ndarray:
        """Return positions (V, 3) [m] of the strip along a curve that begins downwards in the origin.

        Args:
            s: (n,) from where the clamp acts, over the length.
            aside: (n,) of the curve there, over the length.
            depth: (n,) the same downwards; above the clamp the strip is straight.
        """
        x = self.cloth.rest_positions.copy()
        along = (x[:, 0] - self.clamp) / self.length
        x[:, 0] = self.length * np.interp(along, s, aside)
        x[:, 1] = -self.length * np.where(along > 0, np.interp(along, s, depth), along)
        return x

    def chord(self, x: np.ndarray) -> np.ndarray:
        """Return (width, height) [m] of the chord from clamp to tip, height downwards, at x (V, 3) [m]."""
        tip = x[self.tip].mean(axis=0)
        return np.array([tip[0] - self.clamp, -tip[1]])

    def measure(self, x: np.ndarray) -> dict[str, float]:
        """Return the bending length [mm] that the angle of the chord means, at x (V, 3) [m]."""
        width, height = self.chord(x)
        return {BENDING_LENGTH: 1e3 * bending_length(self.length, float(np.arctan2(height, width)))}

    def error(self, x: np.ndarray) -> float:
        """Return how far the bending length at x (V, 3) [m] is from the exact one [%]."""
        exact = (self.stiffness / (self.cloth.material.areal_density * GRAVITY)) ** (1 / 3)
        return 100.0 * abs(self.measure(x)[BENDING_LENGTH] / (1e3 * exact) - 1.0)


def clamped_strip(
    family: str, columns: int, length: float, material: Material, *, scaling: str = "length_area"
) -> Strip:  # fmt: skip
    """Make a strip with two pinned columns, half a cell to each side of x = 0, and calibrate it.

    Args:
        family: of triangles, see meshes.FAMILIES.
        columns: cells along the strip.
        length: from x = 0 to the free end [m].
        material: of the cloth.
        scaling: of the hinges.
    """
    cell = length / (columns - 0.5)
    width = ROWS * cell * (ROW if family == "equilateral" else 1.0)
    points, faces = rectangle(family, columns, ROWS, columns * cell, width)
    points[:, 0] -= cell / 2
    x = lying(points)
    cloth = Cloth(x, faces[:, ::-1], material, pins=np.flatnonzero(points[:, 0] < 0.51 * cell))
    w = _small_deflection(BendHinge(cloth, scaling=scaling))
    ends = [w[np.abs(points[:, 0] - at) < 1e-6 * cell].mean() for at in (length, length - 2 * cell)]
    acting = 4 * ends[0] / (3 * (ends[0] - ends[1]) / (2 * cell))
    return Strip(cloth, cell, width, float(acting**4 / (8 * ends[0])), float(length - acting))


def _small_deflection(bend: BendHinge) -> np.ndarray:
    """Return w (V,) [m] under a unit load per area [Pa], linearly."""
    cloth = bend.cloth
    stiffness = Potential([bend]).hessian(cloth.rest_positions).tocsr()[1::3][:, 1::3]
    free = np.flatnonzero(cloth.free)
    w = np.zeros(cloth.vertex_count)
    w[free] = spla.spsolve(stiffness[free][:, free].tocsc(), cloth.vertex_areas[free])
    return w


def cantilever(fabric: Fabric, columns: int) -> Strip:
    """Return a strip of a fabric whose overhang is twice its bending length.

    Its membrane is SNUG's; k of its hinges is such that its plate stiffness is the fabric's rigidity.
    """
    length = OVERHANG * fabric.bending_length
    for _ in range(2):  # where the clamp acts scales with the cell, so the second strip is right
        trial = clamped_strip(FAMILY, columns, length, membrane(fabric, 1.0))
        length *= OVERHANG * fabric.bending_length / trial.length
    return clamped_strip(FAMILY, columns, length, membrane(fabric, fabric.rigidity / trial.stiffness))


def membrane(fabric: Fabric, bending_stiffness: float, factor: float = 1.0) -> Material:
    """Return the material of a fabric: SNUG's membrane times `factor`, k [J] of its hinges as given."""
    return Material(
        young_modulus=factor * SNUG.young_modulus, poisson_ratio=SNUG.poisson_ratio, thickness=SNUG.thickness,
        density=fabric.density / SNUG.thickness, bending_stiffness=bending_stiffness,
    )  # fmt: skip
