"""How far a frame is from the shape that the cloth was cut in: edges, areas and folds. No physics here."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]


def edge_change(positions: Floats, edges: Indices, rest_lengths: Floats) -> Floats:
    """(T,) mean over edges of |length / rest length - 1| [1]; positions (T,V,3), rest lengths (E,) [m]."""
    vectors = positions[:, edges[:, 1]] - positions[:, edges[:, 0]]
    return np.abs(np.linalg.norm(vectors, axis=2) / rest_lengths - 1.0).mean(1)


def area_change(positions: Floats, faces: Indices, rest_areas: Floats) -> Floats:
    """(T,) mean over faces of |area / rest area - 1| [1]; positions (T,V,3) [m], rest areas (F,) [m^2]."""
    corners = positions[:, faces]
    normals = np.cross(corners[:, :, 1] - corners[:, :, 0], corners[:, :, 2] - corners[:, :, 0])
    return np.abs(0.5 * np.linalg.norm(normals, axis=2) / rest_areas - 1.0).mean(1)


def dihedral_angle(positions: Floats, hinges: Indices) -> Floats:
    """(T,) mean over inner edges of the angle between the normals of their two faces [rad], 0 where flat.

    hinges: (H,4) the edge's ends, then the tip of either face.
    """
    if not len(hinges):
        return np.zeros(len(positions))
    a, b, left, right = (positions[:, hinges[:, k]] for k in range(4))
    edge = b - a
    n1, n2 = np.cross(edge, left - a), np.cross(right - a, edge)
    sine = np.linalg.norm(np.cross(n1, n2), axis=2)
    return np.arctan2(sine, (n1 * n2).sum(2)).mean(1)
