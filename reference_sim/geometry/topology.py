"""Edges, boundary loops, areas and angles of a triangle mesh."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from reference_sim.cloth import MeshError, edge_table

Array = NDArray[np.float64]
Index = NDArray[np.int64]


def half_edges(faces: Index) -> Index:
    """Return the directed edges (3F,2) of faces (F,3), three for each face in turn, along its winding."""
    return faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)


def boundary_loops(faces: Index) -> list[Index]:
    """Return the vertices of the boundary loops of a mesh (F,3), along its winding, longest first.

    Raises ValueError where the mesh is not manifold at its boundary.
    """
    halves = half_edges(faces)
    size = int(faces.max()) + 1
    forward, backward = halves @ [size, 1], halves @ [1, size]
    rim = halves[~np.isin(forward, backward)]
    heads = dict(rim.tolist())
    if len(heads) != len(rim) or set(heads) != set(heads.values()):
        raise ValueError(
            "boundary loops touch or the winding is not consistent: the mesh is not manifold"
        )
    loops = []
    while heads:
        start, vertex = next(iter(heads.items()))
        loop = [start]
        del heads[start]
        while vertex != start:
            loop.append(vertex)
            vertex = heads.pop(vertex)
        loops.append(np.array(loop, dtype=np.int64))
    return sorted(loops, key=lambda loop: (-len(loop), int(loop[0])))


def corner_areas(corners: Array) -> Array:
    """Return the areas (F,) [m^2] of triangles by their corners (F,3,3), or (F,3,2) in a plane [m]."""
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    if corners.shape[2] == 2:
        return 0.5 * np.abs(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0])
    return 0.5 * np.linalg.norm(np.cross(first, second), axis=1)


def corner_heights(corners: Array) -> Array:
    """Return the least heights (F,) [m] of triangles by their corners, as for `corner_areas`."""
    edges = np.linalg.norm(np.roll(corners, 1, axis=1) - corners, axis=2)
    return 2 * corner_areas(corners) / np.maximum(edges.max(axis=1), np.finfo(float).tiny)


def corner_angles(points: Array, faces: Index) -> Array:
    """Return the angles (F,3) [rad] at the corners of the faces (F,3) between points (V,3) [m]."""
    after, before = (points[np.roll(faces, -k, axis=1)] - points[faces] for k in (1, 2))
    return np.arctan2(np.linalg.norm(np.cross(after, before), axis=2), np.sum(after * before, axis=2))


LEAST_AREA_RATIO = 1e-12  # area of a face relative to the mean, below which it has no normal


def check_closed(positions: np.ndarray, faces: np.ndarray) -> None:
    """Refuse positions (T, B, 3) [m] and faces (F, 3) that are no moving closed surface.

    Raises MeshError that names vertex, face or edge, and the remedy.
    """
    moving = positions.ndim == 3 and positions.shape[2] == 3 and positions.size
    if not (moving and faces.ndim == 2 and faces.shape[1] == 3 and faces.size):
        raise MeshError(
            f"obstacle {positions.shape} and faces {faces.shape}: expected (T, B, 3) and (F, 3)"
        )
    if not np.isin(faces, np.arange(positions.shape[1])).all():
        raise MeshError(f"obstacle faces name a vertex outside 0..{positions.shape[1] - 1}")
    if not np.isfinite(positions).all():
        frame, vertex, _ = np.argwhere(~np.isfinite(positions))[0]
        raise MeshError(f"obstacle vertex {vertex} of frame {frame} is not finite")
    try:
        edges, sides, _ = edge_table(faces, positions.shape[1])
    except MeshError as error:
        raise MeshError(f"obstacle is not closed: {error}") from None
    rim = np.flatnonzero((sides < 0).any(axis=1))
    if len(rim):
        edge, face = tuple(edges[rim[0]].tolist()), sides[rim[0]].max()
        one = f"edge {edge} of face {face} has one face only"
        raise MeshError(f"obstacle is not closed: {one}: fill the hole")
    for frame, x in enumerate(positions):
        area = corner_areas(x[faces])
        if not area.min() > LEAST_AREA_RATIO * area.mean():
            raise MeshError(f"obstacle face {area.argmin()} has no area in frame {frame}: remove it")
    a, b, c = positions[0][faces].transpose(1, 0, 2)
    if not (volume := np.einsum("fi,fi->", a, np.cross(b - a, c - a)) / 6) > 0:
        raise MeshError(f"obstacle is inside out (volume {volume:.3g} m^3): reverse its faces")
