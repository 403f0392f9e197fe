"""Edges, boundary loops, areas and angles of a triangle mesh."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.int64]


def half_edges(faces: Index) -> Index:
    """Return the directed edges (3F,2) of faces (F,3), three for each face in turn, along its winding."""
    return faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)


def unique_edges(faces: Index) -> Index:
    """Return the edges (E,2) of faces (F,3), sorted, the lower vertex first."""
    return np.unique(np.sort(half_edges(faces), axis=1), axis=0)


def boundary_loops(faces: Index) -> list[Index]:
    """Return the boundary loops of a manifold mesh (F,3), longest first.

    Returns:
        Vertex indices of each loop, in order along the winding of the faces.

    Raises:
        ValueError: the mesh is not manifold at its boundary.

    >>> boundary_loops(np.array([[0, 1, 2], [0, 2, 3]]))
    [array([0, 1, 2, 3])]
    """
    halves = half_edges(faces)
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
    """Return the areas (F,) [m^2] of the faces (F,3) between points (V,3) [m].

    >>> points = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    >>> triangle_areas(points, np.array([[0, 1, 2]]))
    array([0.5])
    """
    return corner_areas(points[faces])


def corner_areas(corners: Array) -> Array:
    """Return the areas (F,) [m^2] of triangles by their corners (F,3,3), or (F,3,2) in a plane [m]."""
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    if corners.shape[2] == 2:
        return 0.5 * np.abs(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0])
    return 0.5 * np.linalg.norm(np.cross(first, second), axis=1)


def corner_angles(points: Array, faces: Index) -> Array:
    """Return the angles (F,3) [rad] at the corners of the faces (F,3) between points (V,3) [m].

    >>> points = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    >>> np.degrees(corner_angles(points, np.array([[0, 1, 2]]))).round(6)
    array([[90., 45., 45.]])
    """
    after, before = (points[np.roll(faces, -k, axis=1)] - points[faces] for k in (1, 2))
    return np.arctan2(np.linalg.norm(np.cross(after, before), axis=2), np.sum(after * before, axis=2))
