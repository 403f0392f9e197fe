"""Boundary loops, areas and angles of a triangle mesh."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.int64]


def boundary_loops(faces: Index) -> list[Index]:
    """Return the boundary loops of a manifold mesh (F,3), longest first.

    Returns:
        Vertex indices of each loop, in order along the winding of the faces.

    Raises:
        ValueError: the mesh is not manifold at its boundary.
    """
    halves = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    size = int(faces.max()) + 1
    forward, backward = halves @ [size, 1], halves @ [1, size]
    rim = halves[~np.isin(forward, backward)]
    following = dict(rim.tolist())
    if len(following) != len(rim) or set(following) != set(following.values()):
        raise ValueError("boundary loops touch or the winding is not consistent: the mesh is not manifold")
    loops = []
    while following:
        vertex, after = next(iter(following.items()))
        loop = [vertex]
        del following[vertex]
        while after != loop[0]:
            loop.append(after)
            after = following.pop(after)
        loops.append(np.array(loop, dtype=np.int64))
    return sorted(loops, key=lambda loop: (-len(loop), int(loop[0])))


def triangle_areas(points: Array, faces: Index) -> Array:
    """Return the areas (F,) [m^2] of the faces (F,3) between points (V,3) [m]."""
    a, b, c = (points[faces[:, k]] for k in range(3))
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)


def corner_angles(points: Array, faces: Index) -> Array:
    """Return the angles (F,3) [rad] at the corners of the faces (F,3) between points (V,3) [m]."""
    after, before = (points[np.roll(faces, -k, axis=1)] - points[faces] for k in (1, 2))
    return np.arctan2(np.linalg.norm(np.cross(after, before), axis=2), np.sum(after * before, axis=2))
