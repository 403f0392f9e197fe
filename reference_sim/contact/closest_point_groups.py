"""Descent into a tree of boxes (see `closest_point`) by groups of samples that lie near each other.

The tree is descended once for the box around a group. At a leaf, the distances of all samples of the group to
its box are worked out side by side, in vector instructions; those within look at its faces, of which the flat
discs around them keep most away. Neither changes an answer.
"""

from __future__ import annotations

import numpy as np

from reference_sim.geometry.triangle import closest_on_triangle
from reference_sim.kernels.kernel_cache import njit

GROUP_SIZE = 16  # samples; fewer share less of the way, more are farther apart
BOUND_MATH = {"nnan", "nsz", "reassoc"}  # for bounds alone, within DISTANCE_ROUND_OFF
DISTANCE_ROUND_OFF = 1e-14  # of lengths: some fifty times that of float64


@njit(cache=True, error_model="numpy")
def search(
    points, rest_points, region, exact, reach, corners, discs, centroids, boxes, rest_boxes, starts, order,
    place, ascending, sequence, faces, barycentric, closest,
):  # fmt: skip
    """Search the closest face of every sample.

    faces (S,) come in as hints and go out as answers, -1 where no face lies within a finite reach (S,).
    """
    leaf_faces, v, w = np.empty(len(points), np.int64), np.empty(len(points)), np.empty(len(points))
    missed = np.empty(GROUP_SIZE, np.int64)
    scratch = (
        np.empty((3, GROUP_SIZE)), np.empty((3, GROUP_SIZE)), np.empty((4, 3)), np.empty((GROUP_SIZE, 2)),
        np.empty((3, GROUP_SIZE)), np.empty((2, GROUP_SIZE), np.int64), np.empty(64, np.int64), np.empty(64),
    )  # fmt: skip
    for begin in range(0, len(sequence), GROUP_SIZE):
        members = sequence[begin : begin + GROUP_SIZE]
        _descend(
            members, points, rest_points, region, exact, reach, corners, discs, centroids, boxes, rest_boxes,
            starts, order, place, faces, leaf_faces, v, w, scratch,
        )  # fmt: skip
        count = 0
        for s in members:
            if leaf_faces[s] < 0 and reach[s] == np.inf:
                missed[count] = s
                count += 1
        if count > 0:  # no face within the region: then all
            _descend(
                missed[:count], points, rest_points, np.inf, exact, reach, corners, discs, centroids, boxes,
                rest_boxes, starts, order, place, faces, leaf_faces, v, w, scratch,
            )  # fmt: skip
    for s in range(len(points)):
        k, u = leaf_faces[s], max(1.0 - v[s] - w[s], 0.0)
        faces[s] = order[k] if k >= 0 or reach[s] == np.inf else -1
        barycentric[s, ascending[k, 0]] = u
        barycentric[s, ascending[k, 1]], barycentric[s, ascending[k, 2]] = v[s], w[s]
        for i in range(3):
            closest[s, i] = u * corners[k, 0, i] + v[s] * corners[k, 1, i] + w[s] * corners[k, 2, i]


@njit(cache=True, error_model="numpy")
def _descend(
    members, points, rest_points, region, exact, reach, corners, discs, centroids, boxes, rest_boxes, starts,
    order, place, faces, leaf_faces, leaf_v, leaf_w, scratch,
):  # fmt: skip
    """Find the closest allowed faces of at most GROUP_SIZE members by one descent.

    Writes into leaf_faces (S,) the place of the face in the order of the leaves, -1 for none, and its
    weights.
    """
    x, rest, span, weights, numbers, places, stack, bounds = scratch
    # Squares of: distance to the best face so far, distance beyond which nothing is of use.
    best, useful, apart, answer, hint = numbers[0], numbers[1], numbers[2], places[0], places[1]
    limit, inner, count, size = region * region, len(starts) - 2, len(members), 0.0
    for i in range(3):
        size += np.float64(boxes[0, 1, i]) - boxes[0, 0, i]
        for g in range(GROUP_SIZE):  # an incomplete group is filled up with its first member
            s = members[g if g < count else 0]
            x[i, g], rest[i, g] = points[s, i], rest_points[s, i]
        span[0, i], span[1, i] = _ends(x[i])
        span[2, i], span[3, i] = _ends(rest[i])
    for g in range(GROUP_SIZE):
        s = members[g if g < count else 0]
        best[g], answer[g], hint[g] = reach[s] * reach[s], -1, -1
        weights[g, 0] = weights[g, 1] = 0.0
        k = place[faces[s]] if faces[s] >= 0 else -1
        if k >= 0 and _squared(centroids, k, rest, g) <= limit:
            hint[g] = k
            v, w, distance = closest_on_triangle(corners, k, x[0, g], x[1, g], x[2, g])
            if distance < best[g]:
                best[g], answer[g], weights[g, 0], weights[g, 1] = distance, k, v, w
        useful[g] = _useful(best[g], size, exact)
    stack[0], bounds[0], depth = 0, 0.0, 1
    worst = 0.0
    for g in range(count):
        worst = max(worst, useful[g])
    while depth > 0:
        depth -= 1
        node = stack[depth]
        if bounds[depth] > worst:
            continue
        if node < inner:
            near, other = 2 * node + 1, 2 * node + 2
            least_near = _apart(boxes, rest_boxes, near, span, limit)
            least_other = _apart(boxes, rest_boxes, other, span, limit)
            if least_other < least_near:
                near, other, least_near, least_other = other, near, least_other, least_near
            if least_other <= worst:
                stack[depth], bounds[depth] = other, least_other
                depth += 1
            if least_near <= worst:
                stack[depth], bounds[depth] = near, least_near
                depth += 1
            continue
        _box_distances(boxes, node, x, apart)
        for g in range(count):
            if apart[g] > useful[g]:
                continue
            for k in range(starts[node - inner], starts[node - inner + 1]):
                if (
                    k == hint[g]
                    or _to_disc(discs, k, x[0, g], x[1, g], x[2, g]) > useful[g]
                    or _squared(centroids, k, rest, g) > limit
                ):
                    continue
                v, w, distance = closest_on_triangle(corners, k, x[0, g], x[1, g], x[2, g])
                if distance < best[g] or (
                    distance == best[g] and answer[g] >= 0 and order[k] < order[answer[g]]
                ):
                    best[g], answer[g], weights[g, 0], weights[g, 1] = distance, k, v, w
                    useful[g] = _useful(distance, size, exact)
        worst = 0.0
        for g in range(count):
            worst = max(worst, useful[g])
    for g in range(count):
        leaf_faces[members[g]] = answer[g]
        leaf_v[members[g]], leaf_w[members[g]] = weights[g, 0], weights[g, 1]


@njit(cache=True)
def _ends(values):
    """Return the least and the greatest value, NaN aside."""
    low, high = np.inf, -np.inf
    for value in values:
        if value < low:
            low = value
        if value > high:
            high = value
    return low, high


@njit(cache=True, inline="always")
def _apart(boxes, rest_boxes, node, span, limit):
    """Return the squared distance between the boxes of a node and of a group; inf where regions are apart."""
    apart = rest_apart = 0.0
    for i in range(3):
        gap = max(max(np.float64(boxes[node, 0, i]) - span[1, i], span[0, i] - boxes[node, 1, i]), 0.0)
        apart += gap * gap
        gap = max(
            max(np.float64(rest_boxes[node, 0, i]) - span[3, i], span[2, i] - rest_boxes[node, 1, i]), 0.0
        )
        rest_apart += gap * gap
    return apart if rest_apart <= limit else np.inf


@njit(cache=True, fastmath=BOUND_MATH)
def _box_distances(boxes, node, x, out):
    """Write the squared distances from the points of a group to a box."""
    l0, l1, l2 = np.float64(boxes[node, 0, 0]), np.float64(boxes[node, 0, 1]), np.float64(boxes[node, 0, 2])
    h0, h1, h2 = np.float64(boxes[node, 1, 0]), np.float64(boxes[node, 1, 1]), np.float64(boxes[node, 1, 2])
    for g in range(GROUP_SIZE):
        dx = max(max(l0 - x[0, g], x[0, g] - h0), 0.0)
        dy = max(max(l1 - x[1, g], x[1, g] - h1), 0.0)
        dz = max(max(l2 - x[2, g], x[2, g] - h2), 0.0)
        out[g] = dx * dx + dy * dy + dz * dz


@njit(cache=True, inline="always")
def _to_disc(discs, k, x, y, z):
    """Return the squared distance from a point to the flat disc around a face."""
    dx, dy, dz = x - discs[k, 0], y - discs[k, 1], z - discs[k, 2]
    height = discs[k, 4] * dx + discs[k, 5] * dy + discs[k, 6] * dz
    across = np.sqrt(max(dx * dx + dy * dy + dz * dz - height * height, 0.0)) - discs[k, 3]
    return height * height + max(across, 0.0) ** 2


@njit(cache=True, inline="always")
def _squared(points, k, x, g):
    """Return the squared distance between a point and one of a group."""
    dx, dy, dz = points[k, 0] - x[0, g], points[k, 1] - x[1, g], points[k, 2] - x[2, g]
    return dx * dx + dy * dy + dz * dz


@njit(cache=True, inline="always")
def _useful(squared, size, exact):
    """Return the squared distance beyond which nothing is of use, once something is found at `squared`.

    size: of the mesh, for the round-off in the distances to boxes and faces.
    """
    distance = np.sqrt(squared)
    if distance > exact:
        distance = max(exact, 0.5 * distance)
    distance += DISTANCE_ROUND_OFF * (distance + size)
    return distance * distance
