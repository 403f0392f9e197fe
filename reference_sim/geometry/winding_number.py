"""Winding number of a closed mesh about points: signed crossings of a ray from each point with the faces.

A face counts 1 where the ray leaves through its outer side, and -1 where it enters. For a closed mesh the sum
is the winding number itself, whatever the direction of the ray: 0 outside, 1 inside, 2 in two parts at once.
"""

from __future__ import annotations

import numpy as np

from reference_sim.kernels.kernel_cache import njit


def winding_numbers(vertices: np.ndarray, faces: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return how often a closed mesh winds around each point.

    Rays run along the shortest side of the mesh's bounding box, so that each meets few faces; a grid over the
    other two axes has the faces that a ray may meet. A ray through a side or a corner is moved by less than
    any number, the same way for all faces, so that it passes each of them once.

    Args:
        vertices: (B, 3) [m].
        faces: (F, 3) outward wound; each side belongs to two faces, which pass it in opposite directions.
        points: (P, 3) [m].

    Returns:
        (P,) integers. Of a point on the surface: as of one beside it.

    >>> corners = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    >>> faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    >>> winding_numbers(corners, faces, np.array([[0.1, 0.1, 0.1], [0.5, 0.5, 0.5]])).tolist()
    [1, 0]
    """
    numbers = np.zeros(len(points), np.int64)
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    inside = np.flatnonzero(((points >= low) & (points <= high)).all(axis=1))
    if len(inside) == 0:
        return numbers
    along = int(np.argmin(high - low))
    axes = [(along + 1) % 3, (along + 2) % 3, along]  # the ray runs along the last
    x, rays = np.ascontiguousarray(vertices[:, axes]), np.ascontiguousarray(points[inside][:, axes])
    sides = np.maximum((high - low)[axes[:2]], np.finfo(float).tiny)
    cells = np.maximum(np.sqrt(len(faces) * sides / sides[::-1]), 1.0).astype(np.int64)  # as many as faces
    starts, met = _faces_of_cells(x, faces, low[axes], cells / sides, cells)
    numbers[inside] = _crossings(x, faces, rays, low[axes], cells / sides, cells, starts, met)
    return numbers


@njit(cache=True, error_model="numpy")
def _cell(value, low, scale, count):
    return min(max(int((value - low) * scale), 0), count - 1)


@njit(cache=True, error_model="numpy")
def _faces_of_cells(x, faces, low, scale, cells):
    """Return starts (C + 1,) and faces of each cell that their boxes touch, cell by cell."""
    starts = np.zeros(cells[0] * cells[1] + 1, np.int64)
    box = np.empty((len(faces), 4), np.int64)
    for f in range(len(faces)):
        i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
        for c in range(2):
            box[f, c] = _cell(min(x[i, c], x[j, c], x[k, c]), low[c], scale[c], cells[c])
            box[f, 2 + c] = _cell(max(x[i, c], x[j, c], x[k, c]), low[c], scale[c], cells[c])
        for u in range(box[f, 0], box[f, 2] + 1):
            for v in range(box[f, 1], box[f, 3] + 1):
                starts[u * cells[1] + v + 1] += 1
    for cell in range(len(starts) - 1):
        starts[cell + 1] += starts[cell]
    met, filled = np.empty(starts[-1], np.int64), starts[:-1].copy()
    for f in range(len(faces)):
        for u in range(box[f, 0], box[f, 2] + 1):
            for v in range(box[f, 1], box[f, 3] + 1):
                met[filled[u * cells[1] + v]] = f
                filled[u * cells[1] + v] += 1
    return starts, met


@njit(cache=True, error_model="numpy")
def _area(x, i, j, u, v):
    """Return twice the signed area of (i, j, (u, v)), to the bit minus that of (j, i, (u, v)).

    Where it is zero, that of the point moved by (e, e^2), with e below any number.
    """
    a, b = min(i, j), max(i, j)
    along, across = x[b, 0] - x[a, 0], x[b, 1] - x[a, 1]
    area = along * (v - x[a, 1]) - across * (u - x[a, 0])
    if area == 0.0:
        area = np.copysign(np.finfo(np.float64).tiny, -across if across != 0.0 else along)
    return area if i < j else -area


@njit(cache=True, error_model="numpy")
def _crossings(x, faces, rays, low, scale, cells, starts, met):
    """Return the signed crossings (P,) of the rays from points, in the direction of the last axis."""
    numbers = np.zeros(len(rays), np.int64)
    for p in range(len(rays)):
        u, v, height = rays[p, 0], rays[p, 1], rays[p, 2]
        cell = _cell(u, low[0], scale[0], cells[0]) * cells[1] + _cell(v, low[1], scale[1], cells[1])
        for place in range(starts[cell], starts[cell + 1]):
            face = faces[met[place]]
            i, j, k = face[0], face[1], face[2]
            if max(x[i, 2], x[j, 2], x[k, 2]) < height:
                continue
            of_k, of_i, of_j = _area(x, i, j, u, v), _area(x, j, k, u, v), _area(x, k, i, u, v)
            if (of_k > 0.0) != (of_i > 0.0) or (of_k > 0.0) != (of_j > 0.0):
                continue
            total = of_i + of_j + of_k
            if (of_i * x[i, 2] + of_j * x[j, 2] + of_k * x[k, 2]) / total > height:
                numbers[p] += 1 if total > 0.0 else -1
    return numbers
