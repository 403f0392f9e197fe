"""Compiled parts of sliding places: see sliding_obstacle."""

from __future__ import annotations

import numpy as np

from reference_sim.contact.anchor_walk import walk_to_foot
from reference_sim.geometry.surface import cross_of_face
from reference_sim.kernels.kernel_cache import njit

FAR, SELDOM = 0.03, 8  # [m] samples farther away slide in one frame of so many only, and ride in the others
SLACK = 1e-4  # [m] by which a neighbour's distance must be the better one to be tried
SWEEPS = 2  # of the trying of neighbours: what was found spreads by so many samples


@njit(cache=True, inline="always")
def _set(s, points, face, v, w, vertices, faces, barycentric, closest):
    """Put the place of sample s on a face; returns its distance."""
    u, squared = 1.0 - v - w, 0.0  # weights are rounded to float32, their sum is not
    barycentric[s, 0], barycentric[s, 1], barycentric[s, 2] = u, v, w
    i, j, k = faces[face, 0], faces[face, 1], faces[face, 2]
    for c in range(3):
        closest[s, c] = u * vertices[i, c] + v * vertices[j, c] + w * vertices[k, c]
        squared += (points[s, c] - closest[s, c]) ** 2
    return np.sqrt(squared)


@njit(cache=True, error_model="numpy")
def slide(
    points, turn, vertices, faces, adjacency, centroids, home, reach, anchors, barycentric, closest, distance
):
    """Let every sample slide over the surface to its foot; those that are FAR away take turns."""
    corners = np.empty((1, 3, 3))
    for s in range(len(points)):
        if distance[s] > FAR and (s + turn) % SELDOM != 0:
            v, w = barycentric[s, 1], barycentric[s, 2]
            distance[s] = _set(s, points, anchors[s], v, w, vertices, faces, barycentric, closest)
            if distance[s] > FAR:
                continue
        face, v, w = walk_to_foot(
            points[s, 0], points[s, 1], points[s, 2], np.uint32(anchors[s]), vertices, faces, adjacency,
            centroids, home, s, reach, corners,
        )  # fmt: skip
        anchors[s] = face
        distance[s] = _set(s, points, face, v, w, vertices, faces, barycentric, closest)


@njit(cache=True, error_model="numpy")
def ask_neighbours(
    points, neighbours, vertices, faces, adjacency, centroids, home, reach, anchors, barycentric, closest,
    distance,
):  # fmt: skip
    """Let samples that are too far try the faces of their neighbours."""
    corners = np.empty((1, 3, 3))
    for _ in range(SWEEPS):
        for s in range(len(points)):
            for n in neighbours[s]:
                excess = distance[s] - distance[n] - SLACK
                if excess <= 0.0:
                    continue
                apart = 0.0
                for c in range(3):
                    apart += (points[s, c] - points[n, c]) ** 2
                if excess * excess <= apart:
                    continue
                squared = 0.0
                for c in range(3):
                    squared += (centroids[anchors[n], c] - home[s, c]) ** 2
                if squared > reach:
                    continue
                face, v, w = walk_to_foot(
                    points[s, 0], points[s, 1], points[s, 2], np.uint32(anchors[n]), vertices, faces,
                    adjacency, centroids, home, s, reach, corners,
                )  # fmt: skip
                before = barycentric[s, 1], barycentric[s, 2]
                tried = _set(s, points, face, v, w, vertices, faces, barycentric, closest)
                if tried < distance[s]:
                    anchors[s], distance[s] = face, tried
                else:
                    _set(s, points, anchors[s], before[0], before[1], vertices, faces, barycentric, closest)


@njit(cache=True)
def gaps_of(points, closest, normals):
    """Return the height (S,) [m] of each sample above its plane."""
    gaps = np.empty(len(points))
    for s in range(len(points)):
        gap = 0.0
        for c in range(3):
            gap += normals[s, c] * (points[s, c] - closest[s, c])
        gaps[s] = gap
    return gaps


@njit(cache=True, error_model="numpy")
def not_outside(nearest, points, home, vertices, faces):
    """Return the samples without a nearest face (-1) that are not outside by the plane of their home face."""
    deep, count = np.empty(len(points), np.int64), 0
    for s in range(len(points)):
        if nearest[s] < 0:
            i, j, k = faces[home[s], 0], faces[home[s], 1], faces[home[s], 2]
            n = cross_of_face(vertices, i, j, k)
            height = 0.0
            for c in range(3):
                height += n[c] * (points[s, c] - vertices[i, c])
            if not height > 0.0:
                deep[count] = s
                count += 1
    return deep[:count]
