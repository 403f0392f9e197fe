"""Closest points of a moving triangle mesh: a tree of boxes, built once and refitted to every frame.

In one pose the faces are halved again and again along the longest side of the box of their centroids. All
leaves lie equally deep, so node i has the children 2 i + 1 and 2 i + 2. A new frame only moves the boxes. A
search begins with the face that its caller remembers from before: any face is an upper bound, and a good one
leaves little to visit.

A sample may be held to the faces near its own place at rest. Nodes carry boxes of the faces' rest centroids
too, so that what is out of reach is left out by whole subtrees.

An answer depends on mesh and point alone, never on what was remembered: of faces at the same distance the one
of lowest index answers, and a box is left out only if it is farther by more than round-off. Arithmetic is in
float64 even where the mesh is kept in float32.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

LEAF = 4  # faces in a leaf, at most
SLIVER = 1e-3  # squared sine of a triangle's first angle, below which all of its sides are tried
ROUND_OFF = 1e-14  # of lengths: some fifty times that of float64


@dataclass(frozen=True)
class Closest:
    """Per sample: its face (S,), the place on it (S, 3), and that point (S, 3) [m]."""

    faces: np.ndarray
    barycentric: np.ndarray
    points: np.ndarray


class FaceTree:
    """Tree of boxes over the faces of a mesh whose vertices move. Refit it before the first search.

    Args:
        faces: (F, 3), at least one.
        centroids: (F, 3) [m], their centroids at rest, in a pose that spreads the mesh: by them the tree is
            built and the rule of regions judges. Positions are kept in their type, float64 or float32.
    """

    def __init__(self, faces: np.ndarray, centroids: np.ndarray) -> None:
        self.faces = np.ascontiguousarray(faces, dtype=np.int64)
        self._order, self._starts = _halved(centroids)
        self._place = np.argsort(self._order)
        # Corners by ascending vertex: faces then agree to the bit about a side or a corner that they share.
        self._ascending = np.argsort(self.faces[self._order], axis=1, kind="stable")
        self._vertices = np.take_along_axis(self.faces[self._order], self._ascending, axis=1)
        self._centroids = np.ascontiguousarray(centroids[self._order])
        nodes = 2 * len(self._starts) - 3  # of L leaves, with L + 1 starts, L - 1 inner ones
        self._rest_boxes = np.empty((nodes, 2, 3), centroids.dtype)
        _enclose(self._centroids[:, None], self._starts, self._rest_boxes)
        self._corners = np.empty((len(faces), 3, 3), centroids.dtype)
        self._boxes = np.empty_like(self._rest_boxes)

    def refit(self, positions: np.ndarray) -> None:
        """Take the mesh to positions (B, 3) [m]."""
        positions = np.ascontiguousarray(positions, self._corners.dtype)
        _gather(positions, self._vertices, self._corners)
        _enclose(self._corners, self._starts, self._boxes)

    def nearest(
        self,
        points: np.ndarray,
        *,
        hints: np.ndarray | None = None,
        rest_points: np.ndarray | None = None,
        region: float = np.inf,
        exact: float = np.inf,
    ) -> Closest:
        """Closest points of the mesh to points (S, 3) [m].

        hints: (S,) faces to begin with, -1 for none. They change the cost and, but for `exact`, no answer.
        rest_points: (S, 3) [m] where samples are at rest. With them, a sample meets only faces whose rest
            centroid lies no farther away than `region` [m]; where there is none, all.
        exact: [m] a sample farther away than this may get any point at most twice as far as the closest: a
            remembered face then often does, for a third of the cost.
        """
        if rest_points is None:
            rest_points, region = points, np.inf
        points, rest_points = (np.ascontiguousarray(x, self._corners.dtype) for x in (points, rest_points))
        faces = np.full(len(points), -1) if hints is None else np.array(hints, np.int64)
        # Neighbours one after another: they visit the same boxes, which saves a sixth.
        sequence = np.argsort(self._place[faces])
        barycentric, closest = np.empty((len(points), 3)), np.empty((len(points), 3))
        _search(
            points, rest_points, float(region), float(exact), self._corners, self._centroids, self._boxes,
            self._rest_boxes, self._starts, self._order, self._place, self._ascending, sequence,
            faces, barycentric, closest,
        )  # fmt: skip
        return Closest(faces, barycentric, closest)


def _halved(centroids: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Faces in the order of the leaves (F,), and where each of the L leaves begins, (L + 1,) with the end."""
    count = len(centroids)
    order, starts = np.arange(count), np.array([0, count])
    while np.diff(starts).max() > LEAF:
        x = centroids[order]
        block = np.repeat(np.arange(len(starts) - 1), np.diff(starts))
        low, high = (ends.reduceat(x, starts[:-1], axis=0) for ends in (np.minimum, np.maximum))
        along = x[np.arange(count), (high - low).argmax(axis=1)[block]]
        order = order[np.lexsort((along, block))]
        middles = (starts[:-1] + starts[1:]) // 2
        starts = np.append(np.stack([starts[:-1], middles], axis=1).ravel(), count)
    return order, starts


@njit(cache=True)
def _gather(positions, vertices, corners):
    for place in range(len(vertices)):
        for a in range(3):
            for i in range(3):
                corners[place, a, i] = positions[vertices[place, a], i]


@njit(cache=True)
def _enclose(points, starts, boxes):
    """Boxes (N, 2, 3) of points (F, K, 3) in the order of the leaves: leaves first, then up to the root."""
    leaves = len(starts) - 1
    for leaf in range(leaves):
        box = boxes[leaves - 1 + leaf]
        for i in range(3):
            low = high = points[starts[leaf], 0, i]
            for place in range(starts[leaf], starts[leaf + 1]):
                for a in range(points.shape[1]):
                    low, high = min(low, points[place, a, i]), max(high, points[place, a, i])
            box[0, i], box[1, i] = low, high
    for node in range(leaves - 2, -1, -1):
        first, second = boxes[2 * node + 1], boxes[2 * node + 2]
        for i in range(3):
            boxes[node, 0, i] = min(first[0, i], second[0, i])
            boxes[node, 1, i] = max(first[1, i], second[1, i])


@njit(cache=True)
def _box_distance(boxes, node, x, y, z):
    """Squared distance from a point to a box."""
    dx = max(boxes[node, 0, 0] - x, x - boxes[node, 1, 0], 0.0)
    dy = max(boxes[node, 0, 1] - y, y - boxes[node, 1, 1], 0.0)
    dz = max(boxes[node, 0, 2] - z, z - boxes[node, 1, 2], 0.0)
    return dx * dx + dy * dy + dz * dz


@njit(cache=True, error_model="numpy")
def _on_side(corners, place, a, b, x, y, z):
    """Share of the side from corner a to b at which it comes closest to a point; distance squared.

    The same bits for every face that has the side, and the same for every side that ends in the corner.
    """
    a0, a1, a2 = corners[place, a, 0], corners[place, a, 1], corners[place, a, 2]
    b0, b1, b2 = corners[place, b, 0], corners[place, b, 1], corners[place, b, 2]
    r0, r1, r2 = x - a0, y - a1, z - a2
    s0, s1, s2 = np.float64(b0) - a0, np.float64(b1) - a1, np.float64(b2) - a2
    along, length = s0 * r0 + s1 * r1 + s2 * r2, s0 * s0 + s1 * s1 + s2 * s2
    if along <= 0.0:
        return 0.0, r0 * r0 + r1 * r1 + r2 * r2
    if along >= length:
        r0, r1, r2 = x - b0, y - b1, z - b2
        return 1.0, r0 * r0 + r1 * r1 + r2 * r2
    share = along / length
    q0, q1, q2 = r0 - share * s0, r1 - share * s1, r2 - share * s2
    return share, q0 * q0 + q1 * q1 + q2 * q2


@njit(cache=True, error_model="numpy")
def closest_on_triangle(corners, place, x, y, z):
    """Of triangle corners[place] and a point: weights v, w of the second and third corner at the closest
    point, and the squared distance to it.

    The foot of the perpendicular, where it lies inside; else the best of the sides that the foot is beyond,
    one of which holds the closest point. Of a sliver, whose foot is too inexact to tell, all sides.
    """
    o0, o1, o2 = corners[place, 0, 0], corners[place, 0, 1], corners[place, 0, 2]
    r0, r1, r2 = x - o0, y - o1, z - o2
    s0, s1, s2 = (
        np.float64(corners[place, 1, 0]) - o0,
        np.float64(corners[place, 1, 1]) - o1,
        np.float64(corners[place, 1, 2]) - o2,
    )
    t0, t1, t2 = (
        np.float64(corners[place, 2, 0]) - o0,
        np.float64(corners[place, 2, 1]) - o1,
        np.float64(corners[place, 2, 2]) - o2,
    )
    ss, tt, st = s0 * s0 + s1 * s1 + s2 * s2, t0 * t0 + t1 * t1 + t2 * t2, s0 * t0 + s1 * t1 + s2 * t2
    sr, tr = s0 * r0 + s1 * r1 + s2 * r2, t0 * r0 + t1 * r1 + t2 * r2
    det, v, w = ss * tt - st * st, tt * sr - st * tr, ss * tr - st * sr
    u = det - v - w
    best, best_v, best_w = np.inf, 0.0, 0.0
    sliver = not det > SLIVER * ss * tt
    if det > 0.0 and u >= 0.0 and v >= 0.0 and w >= 0.0:
        best_v, best_w = v / det, w / det
        q0 = r0 - best_v * s0 - best_w * t0
        q1 = r1 - best_v * s1 - best_w * t1
        q2 = r2 - best_v * s2 - best_w * t2
        best = q0 * q0 + q1 * q1 + q2 * q2
        if not sliver:
            return best_v, best_w, best
    if w < 0.0 or sliver:
        share, distance = _on_side(corners, place, 0, 1, x, y, z)
        if distance < best:
            best, best_v, best_w = distance, share, 0.0
    if v < 0.0 or sliver:
        share, distance = _on_side(corners, place, 0, 2, x, y, z)
        if distance < best:
            best, best_v, best_w = distance, 0.0, share
    if u < 0.0 or sliver:
        share, distance = _on_side(corners, place, 1, 2, x, y, z)
        if distance < best:
            best, best_v = distance, 1.0 - share
            best_w = 1.0 - best_v  # so that the first weight, 1 - v - w, is exactly zero
    return best_v, best_w, best


@njit(cache=True, error_model="numpy")
def _search(
    points, rest_points, region, exact, corners, centroids, boxes, rest_boxes, starts, order, place,
    ascending, sequence, faces, barycentric, closest,
):  # fmt: skip
    """faces (S,) come in as hints and go out as answers."""
    stack, bounds = np.empty(64, np.int64), np.empty(64)
    for s in sequence:
        hint = place[faces[s]] if faces[s] >= 0 else -1
        k, v, w = _best_place(
            points[s], rest_points[s], region, exact, hint, corners, centroids, boxes, rest_boxes, starts,
            order, stack, bounds,
        )  # fmt: skip
        if k < 0 and region < np.inf:
            k, v, w = _best_place(
                points[s], rest_points[s], np.inf, exact, hint, corners, centroids, boxes, rest_boxes, starts,
                order, stack, bounds,
            )  # fmt: skip
        u = max(1.0 - v - w, 0.0)
        faces[s] = order[k]
        barycentric[s, ascending[k, 0]] = u
        barycentric[s, ascending[k, 1]], barycentric[s, ascending[k, 2]] = v, w
        for i in range(3):
            closest[s, i] = u * corners[k, 0, i] + v * corners[k, 1, i] + w * corners[k, 2, i]


@njit(cache=True, error_model="numpy")
def _best_place(
    point, home, region, exact, hint, corners, centroids, boxes, rest_boxes, starts, order, stack, bounds
):  # fmt: skip
    """Where in the order of the leaves the closest allowed face is, -1 for none, and its weights v, w."""
    x, y, z = np.float64(point[0]), np.float64(point[1]), np.float64(point[2])
    hx, hy, hz = np.float64(home[0]), np.float64(home[1]), np.float64(home[2])
    limit, inner, size = region * region, len(starts) - 2, 0.0
    for i in range(3):
        size += np.float64(boxes[0, 1, i]) - boxes[0, 0, i]
    best, reach, answer, best_v, best_w = np.inf, np.inf, -1, 0.0, 0.0
    if hint >= 0 and _squared(centroids, hint, hx, hy, hz) <= limit:
        best_v, best_w, best = closest_on_triangle(corners, hint, x, y, z)
        reach, answer = _reach(best, size, exact), hint
    stack[0], bounds[0], depth = 0, _box_distance(boxes, 0, x, y, z), 1
    while depth > 0:
        depth -= 1
        node = stack[depth]
        if bounds[depth] > reach or _box_distance(rest_boxes, node, hx, hy, hz) > limit:
            continue
        if node < inner:
            near, other = 2 * node + 1, 2 * node + 2
            to_near, to_other = _box_distance(boxes, near, x, y, z), _box_distance(boxes, other, x, y, z)
            if to_other < to_near:
                near, other, to_near, to_other = other, near, to_other, to_near
            if to_other <= reach:
                stack[depth], bounds[depth] = other, to_other
                depth += 1
            if to_near <= reach:
                stack[depth], bounds[depth] = near, to_near
                depth += 1
            continue
        for k in range(starts[node - inner], starts[node - inner + 1]):
            if k == hint or _squared(centroids, k, hx, hy, hz) > limit:
                continue
            v, w, distance = closest_on_triangle(corners, k, x, y, z)
            if distance < best or (distance == best and order[k] < order[answer]):
                best, best_v, best_w, answer = distance, v, w, k
                reach = _reach(best, size, exact)
    return answer, best_v, best_w


@njit(cache=True)
def _squared(points, k, x, y, z):
    """Squared distance between points."""
    dx, dy, dz = points[k, 0] - x, points[k, 1] - y, points[k, 2] - z
    return dx * dx + dy * dy + dz * dz


@njit(cache=True)
def _reach(squared, size, exact):
    """Squared distance beyond which nothing is of use, once something is found at `squared`.

    size: of the mesh, for the round-off in the distances to boxes and faces.
    """
    distance = np.sqrt(squared)
    if distance > exact:
        distance = max(exact, 0.5 * distance)
    return (distance + ROUND_OFF * (distance + size)) ** 2
