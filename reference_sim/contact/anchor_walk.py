"""Walk of a cached contact anchor after its garment sample over the skin, without a search.

An anchor moves as a bead on the skin would: to the foot of its sample on the anchor's face and, where the
foot is outside, over a side that it is outside of onto the next face, until a foot is inside or a side or a
corner is closest. Where the skin is one smooth sheet that is the closest point. What it cannot find is skin
of another limb, a thigh that comes up through the hem: that takes a search (snug.training.contact.cache).
"""

from __future__ import annotations

import numpy as np

from reference_sim.geometry.triangle import closest_on_triangle
from reference_sim.kernels.kernel_cache import njit

WALK_SLACK = 0.001  # m: beyond the margin, and still followed
CROSSINGS = 12  # sides that an anchor may cross at a time: some 15 cm


def triangle_adjacency(faces: np.ndarray) -> np.ndarray:
    """Return (Q, 3) int32 for faces (Q, 3): the face across the side opposite to each corner, or -1."""
    sides = np.sort(faces[:, [[1, 2], [2, 0], [0, 1]]], axis=2).reshape(-1, 2)
    _, number = np.unique(sides, axis=0, return_inverse=True)
    order = np.argsort(number.ravel(), kind="stable")
    adjacency = np.full(len(sides), -1, np.int32)
    twins = np.flatnonzero(np.diff(number.ravel()[order]) == 0)
    first, second = order[twins], order[twins + 1]
    adjacency[first], adjacency[second] = second // 3, first // 3
    return adjacency.reshape(-1, 3)


@njit(cache=True, inline="always", error_model="numpy")  # a call costs as much as a walk
def walk_to_foot(
    x0: np.float32,
    x1: np.float32,
    x2: np.float32,
    face: np.uint32,
    skin: np.ndarray,
    faces: np.ndarray,
    adjacency: np.ndarray,
    centroids: np.ndarray,
    homes: np.ndarray,
    sample: int,
    reach: np.float32,
    corners: np.ndarray,
) -> tuple[np.uint32, np.float32, np.float32]:
    """Return the face, and weights of its second and third corner, where an anchor rests for a sample at x.

    Args:
        x0: position of the sample [m].
        x1: second coordinate.
        x2: third coordinate.
        face: to begin with.
        skin: (B, 3) [m].
        faces: (Q, 3).
        adjacency: (Q, 3), see `triangle_adjacency`.
        centroids: (Q, 3) [m] of the faces at rest.
        homes: (S, 3) [m] of the samples at rest.
        sample: index in homes.
        reach: [m^2] the rule of regions, squared.
        corners: (1, 3, 3) room to work in.
    """
    last, zero, one = face, np.float32(0.0), np.float32(1.0)
    for _ in range(CROSSINGS):
        i, j, k = faces[face, 0], faces[face, 1], faces[face, 2]
        o0, o1, o2 = skin[i, 0], skin[i, 1], skin[i, 2]
        s0, s1, s2 = skin[j, 0] - o0, skin[j, 1] - o1, skin[j, 2] - o2
        t0, t1, t2 = skin[k, 0] - o0, skin[k, 1] - o1, skin[k, 2] - o2
        r0, r1, r2 = x0 - o0, x1 - o1, x2 - o2
        ss, tt, st = (s0 * s0 + s1 * s1 + s2 * s2, t0 * t0 + t1 * t1 + t2 * t2, s0 * t0 + s1 * t1 + s2 * t2)
        sr, tr = s0 * r0 + s1 * r1 + s2 * r2, t0 * r0 + t1 * r1 + t2 * r2
        determinant = ss * tt - st * st
        v, w = (tt * sr - st * tr) / determinant, (ss * tr - st * sr) / determinant
        u = one - v - w
        if u >= zero and v >= zero and w >= zero:
            return face, v, w
        side = 0 if u <= v and u <= w else 1 if v <= w else 2
        other = adjacency[face, side]
        if other < 0 or np.uint32(other) == last:
            break
        d0, d1, d2 = (
            centroids[other, 0] - homes[sample, 0],
            centroids[other, 1] - homes[sample, 1],
            centroids[other, 2] - homes[sample, 2],
        )
        if d0 * d0 + d1 * d1 + d2 * d2 > reach:
            break
        last, face = face, np.uint32(other)
    for corner in range(3):
        for axis in range(3):
            corners[0, corner, axis] = skin[faces[face, corner], axis]
    v64, w64, _ = closest_on_triangle(corners, 0, np.float64(x0), np.float64(x1), np.float64(x2))
    return face, np.float32(v64), np.float32(w64)
