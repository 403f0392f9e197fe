"""Specimens for engines: sheets of SNUG's fabric that fall, fly, hang, and come to rest.

The mesh is the union jack, whose mirror image in x is the mesh itself.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from benchmarks.meshes import rectangle
from reference_sim.cloth import Cloth
from reference_sim.material import Material

CELLS = 16  # a side: 17 x 17 vertices
SPEED, SPIN = 1.0, 10.0  # [m/s], [1/s] of the thrown sheet
SECOND, REST = 30, 90  # frames after the start


@dataclass(frozen=True, eq=False)
class Specimen:
    """A sheet at frame 0.

    Attributes:
        cloth: rest state and pins, in SNUG's fabric.
        start: positions (V, 3) [m].
        velocity: (V, 3) [m/s].
        frames: that follow.
    """

    cloth: Cloth
    start: np.ndarray
    velocity: np.ndarray
    frames: int = SECOND

    @property
    def mirrored(self) -> np.ndarray:
        """Vertex (V,) that is the mirror image of each in the plane x = 0, by the rest positions."""
        image = self.cloth.rest_positions * [-1.0, 1.0, 1.0]
        return np.array([np.abs(self.cloth.rest_positions - x).sum(axis=1).argmin() for x in image])


def falling() -> Specimen:
    """Return a free horizontal square of 1 m at rest."""
    cloth = _sheet()
    return Specimen(cloth, cloth.rest_positions, np.zeros_like(cloth.rest_positions))


def thrown() -> Specimen:
    """Return the free square moving along x and spinning about the vertical, which stretches it."""
    cloth = _sheet()
    x = cloth.rest_positions
    spin = SPIN * np.stack([x[:, 2], np.zeros(len(x)), -x[:, 0]], axis=1)
    return Specimen(cloth, x, spin + np.array([SPEED, 0.0, 0.0]))


def hanging() -> Specimen:
    """Return the square held by two corners, horizontal at frame 0."""
    cloth = _sheet(held=True)
    return Specimen(cloth, cloth.rest_positions, np.zeros_like(cloth.rest_positions))


def strip() -> Specimen:
    """Return a vertical strip of 0.25 m by 1 m held by its upper edge, without tension at frame 0."""
    points, faces = rectangle("union_jack", CELLS // 4, CELLS, 0.25, 1.0)
    x = np.stack([points[:, 0] - 0.125, points[:, 1], np.zeros(len(points))], axis=1)
    cloth = Cloth(x, faces, Material(), pins=np.flatnonzero(x[:, 1] > 0.999).tolist())
    return Specimen(cloth, x, np.zeros_like(x), REST)


def _sheet(held: bool = False) -> Cloth:
    """Return the horizontal square, free or held by the two corners of negative z."""
    points, faces = rectangle("union_jack", CELLS, CELLS, 1.0, 1.0)
    x = np.stack([points[:, 0] - 0.5, np.zeros(len(points)), points[:, 1] - 0.5], axis=1)
    corners = (np.abs(x[:, 0]) > 0.499) & (x[:, 2] < -0.499)
    return Cloth(x, faces, Material(), pins=np.flatnonzero(corners).tolist() if held else [])


SPECIMENS = {"falling": falling, "thrown": thrown, "hanging": hanging, "strip": strip}


@cache
def specimen(name: str) -> Specimen:
    """Return a specimen of SPECIMENS, made once. Raises KeyError for another name."""
    return SPECIMENS[name]()
