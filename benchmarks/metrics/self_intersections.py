"""Self-intersections of a cloth: triangles that pass through others of the same cloth.

Two triangles without a common vertex intersect where an edge of one crosses the inside of the other.
Pairs come from a sweep along x over bounding boxes. Triangles that touch in one plane count as apart. The
line in which two triangles intersect ends at two such crossings.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from reference_sim.kernels.kernel_cache import njit

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from benchmarks.metric import Faces, Vertices


def self_intersections(x: Vertices, faces: Faces) -> tuple[NDArray[np.bool_], float]:
    """Return which faces intersect another, (F,), and the contours' length [m]."""
    corners = x[faces]
    low, high = corners.min(1), corners.max(1)
    order = np.argsort(low[:, 0], kind="stable")
    hit = np.zeros(len(faces), dtype=np.bool_)
    length = _sweep(x, np.ascontiguousarray(faces, dtype=np.int64), low, high, order, hit)
    return hit, float(length)


@njit(cache=True)
def _sweep(x, faces, low, high, order, hit):
    count, length = len(order), 0.0
    ends = np.empty((6, 3))  # where edges of two triangles cross the other one
    for at in range(count):
        e = order[at]
        for other in range(at + 1, count):
            f = order[other]
            if low[f, 0] > high[e, 0]:
                break
            if low[f, 1] > high[e, 1] or low[e, 1] > high[f, 1]:
                continue
            if low[f, 2] > high[e, 2] or low[e, 2] > high[f, 2]:
                continue
            if _neighbours(faces[e], faces[f]):
                continue
            crossings = _crossings(x, faces[e], faces[f], ends, np.int64(0))
            crossings = _crossings(x, faces[f], faces[e], ends, crossings)
            if crossings > 0:
                hit[e] = True
                hit[f] = True
            if crossings > 1:
                dx, dy, dz = ends[0, 0] - ends[1, 0], ends[0, 1] - ends[1, 1], ends[0, 2] - ends[1, 2]
                length += np.sqrt(dx * dx + dy * dy + dz * dz)
    return length


@njit(cache=True, inline="always")
def _neighbours(e, f):
    for i in range(3):
        for j in range(3):
            if e[i] == f[j]:
                return True
    return False


@njit(cache=True, inline="always")
def _volume(x, a, b, c, d):
    """Return six times the signed volume of a tetrahedron."""
    p0, p1, p2 = x[b, 0] - x[a, 0], x[b, 1] - x[a, 1], x[b, 2] - x[a, 2]
    q0, q1, q2 = x[c, 0] - x[a, 0], x[c, 1] - x[a, 1], x[c, 2] - x[a, 2]
    r0, r1, r2 = x[d, 0] - x[a, 0], x[d, 1] - x[a, 1], x[d, 2] - x[a, 2]
    return p0 * (q1 * r2 - q2 * r1) + p1 * (q2 * r0 - q0 * r2) + p2 * (q0 * r1 - q1 * r0)


@njit(cache=True)
def _crossings(x, edges_of, face, ends, crossings):
    """Append to ends[:crossings] where edges of a triangle cross the inside of a face; return how many."""
    a, b, c = face[0], face[1], face[2]
    for i in range(3):
        p, q = edges_of[i], edges_of[(i + 1) % 3]
        side_p, side_q = _volume(x, a, b, c, p), _volume(x, a, b, c, q)
        if side_p * side_q >= 0.0:
            continue
        first, second, third = _volume(x, p, q, a, b), _volume(x, p, q, b, c), _volume(x, p, q, c, a)
        if (first > 0.0 and second > 0.0 and third > 0.0) or (
            first < 0.0 and second < 0.0 and third < 0.0
        ):
            share = side_p / (side_p - side_q)
            for axis in range(3):
                ends[crossings, axis] = (1.0 - share) * x[p, axis] + share * x[q, axis]
            crossings += 1
    return crossings
