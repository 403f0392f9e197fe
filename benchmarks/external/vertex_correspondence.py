"""Correspondence of the vertices of two triangle meshes: by topology, or by position."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from reference_sim.geometry.topology import edge_uses

Index = np.ndarray  # of whole numbers
TRIED = 24  # vertices that a first one is laid on; a mesh may have thousands of symmetries
TINY = 1e-300  # [m] in place of a distance of zero


def same_faces(theirs: Index, ours: Index) -> bool:
    """Return whether two lists of triangles (F,3) join the same vertices, in any order and winding.

    >>> same_faces(np.array([[0, 1, 2]]), np.array([[1, 0, 2]]))
    True
    """
    one, other = (np.unique(np.sort(faces, axis=1), axis=0) for faces in (theirs, ours))
    return theirs.shape == ours.shape and np.array_equal(one, other)


def nearest_order(theirs: np.ndarray, ours: np.ndarray, *, reach: float) -> Index | None:
    """Return the nearest of their points (V,3) for each of ours (V,3): indices (V,).

    None where two of ours have the same, or one is farther than `reach` [m].
    """
    distance, order = cKDTree(theirs).query(ours)
    one_to_one = len(np.unique(order)) == len(ours) == len(theirs)
    return np.asarray(order) if one_to_one and float(distance.max()) < reach else None


def same_topology(
    theirs: Index, ours: Index, their_points: np.ndarray, our_points: np.ndarray
) -> Index | None:
    """Return for each of our vertices the one of theirs in the same place of the mesh: indices (V,).

    theirs, ours: (F,3). Of several ways, as in a symmetric mesh, one is taken by which their_points and
    our_points (V,3) are near each other. None where the meshes are not the same.

    Method: colours of vertices are refined by those of their neighbours (Weisfeiler and Leman 1968). While
    some share one, a vertex of ours and the nearest of theirs of its colour get a colour of their own; for
    the first, each of the TRIED nearest is tried, and the way with the least distances is taken.
    """
    if theirs.shape != ours.shape or len(their_points) != len(our_points):
        return None
    edges, _ = edge_uses(np.concatenate([theirs, ours + len(our_points)]))  # one graph: colours compare
    ends, used = np.concatenate([edges, edges[:, ::-1]]), np.unique(ours)
    colours = _refined(np.zeros(2 * len(our_points), dtype=np.uint64), ends)
    ways = (_laid_on(colours, ends, used, their_points, our_points, first) for first in range(TRIED))
    orders = [way for way in ways if way is not None and same_faces(theirs, way[ours])]
    return min(orders, key=lambda order: ((their_points[order] - our_points) ** 2).sum(), default=None)


def _laid_on(
    colours: Index, ends: Index, used: Index, their_points: np.ndarray, our_points: np.ndarray, first: int
) -> Index | None:
    """Return the order where the first pair is a vertex and its nearest but `first`; None without one."""
    count = len(our_points)
    while True:
        one, other = colours[:count], colours[count:]
        if not np.array_equal(np.sort(one), np.sort(other)):
            return None
        shared = np.flatnonzero(np.bincount(other[used]) > 1)
        if not len(shared):
            break
        theirs, ours = np.flatnonzero(one == shared[0]), np.flatnonzero(other == shared[0])
        if first >= len(theirs):
            return None
        away, nearest = cKDTree(their_points[theirs]).query(our_points[ours], k=max(2, first + 1))
        clearest = int(np.argmin(away[:, 0] / np.maximum(away[:, 1], TINY)))
        colours = colours.copy()
        colours[[theirs[nearest[clearest, first]], ours[clearest] + count]] = colours.max() + 1
        colours, first = _refined(colours.astype(np.uint64), ends), 0
    if first:
        return None
    order = np.empty(count, dtype=np.int64)
    order[np.argsort(other, kind="stable")] = np.argsort(one, kind="stable")
    return order


def _refined(colours: Index, ends: Index) -> Index:
    """Return colours (V,) by which vertices differ wherever the graph of directed edges (E,2) does."""
    classes = 0
    while True:
        mixed, around = _mixed(colours), np.zeros(len(colours), dtype=np.uint64)
        np.add.at(around, ends[:, 0], mixed[ends[:, 1]])
        distinct, finer = np.unique(mixed * np.uint64(3) + _mixed(around), return_inverse=True)
        if len(distinct) == classes:
            return finer.ravel()
        colours, classes = finer.ravel().astype(np.uint64), len(distinct)


def _mixed(values: Index) -> Index:
    """Return a hash of whole numbers, the same everywhere.

    Source: splitmix64 (Steele, Lea and Flood 2014).
    """
    with np.errstate(over="ignore"):
        x = values + np.uint64(0x9E3779B97F4A7C15)
        x = (x ^ (x >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        x = (x ^ (x >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
        return x ^ (x >> np.uint64(31))
