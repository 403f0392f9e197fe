"""Descent into a tree of boxes (see `closest_point`) by groups of samples that lie near each other.

A box is opened if it may be of use to one sample of the group: the box around the group is asked first, then
the distances of all its samples side by side, in vector instructions. The tree is descended once for all.
In a leaf the flat disc around a face keeps it from most samples of the group. None of that changes an answer.
"""

from __future__ import annotations

import numpy as np

from .kernel_cache import njit
from .triangle import closest_on_triangle

GROUP = 32  # samples; fewer share less of the way, more are farther apart
FAST = {"nnan", "nsz", "reassoc"}  # for bounds alone, within ROUND_OFF
NONE = 1e300  # a distance greater than any
ROUND_OFF = 1e-14  # of lengths: some fifty times that of float64


@njit(cache=True, error_model="numpy")
def search(
    points, rest_points, region, exact, reach, corners, discs, centroids, boxes, rest_boxes, starts, order,
    place, ascending, sequence, faces, barycentric, closest,
):  # fmt: skip
    """faces (S,) come in as hints and go out as answers, -1 where no face lies within a finite reach (S,)."""
    found, v, w = np.empty(len(points), np.int64), np.empty(len(points)), np.empty(len(points))
    missed = np.empty(GROUP, np.int64)
    scratch = (
        np.empty((3, GROUP)), np.empty((3, GROUP)), np.empty((4, 3)), np.empty((GROUP, 2)),
        np.empty((3, GROUP)), np.empty((2, GROUP), np.int64), np.empty(64, np.int64), np.empty(64),
    )  # fmt: skip
    for begin in range(0, len(sequence), GROUP):
        members = sequence[begin : begin + GROUP]
        _descend(
            members, points, rest_points, region, exact, reach, corners, discs, centroids, boxes, rest_boxes,
            starts, order, place, faces, found, v, w, scratch,
        )  # fmt: skip
        count = 0
        for s in members:
            if found[s] < 0 and reach[s] == np.inf:
                missed[count] = s
                count += 1
        if count > 0:  # no face within the region: then all
            _descend(
                missed[:count], points, rest_points, np.inf, exact, reach, corners, discs, centroids, boxes,
                rest_boxes, starts, order, place, faces, found, v, w, scratch,
            )  # fmt: skip
    for s in range(len(points)):
        k, u = found[s], max(1.0 - v[s] - w[s], 0.0)
        faces[s] = order[k] if k >= 0 or reach[s] == np.inf else -1
        barycentric[s, ascending[k, 0]] = u
        barycentric[s, ascending[k, 1]], barycentric[s, ascending[k, 2]] = v[s], w[s]
        for i in range(3):
            closest[s, i] = u * corners[k, 0, i] + v[s] * corners[k, 1, i] + w[s] * corners[k, 2, i]


@njit(cache=True, error_model="numpy")
def _descend(
    members, points, rest_points, region, exact, reach, corners, discs, centroids, boxes, rest_boxes, starts,
    order, place, faces, found, found_v, found_w, scratch,
):  # fmt: skip
    """found (S,): where in the order of the leaves the closest allowed face of each member is, -1 for none,
    and its weights. At most GROUP members.
    """
    x, rest, span, weights, numbers, places, stack, bounds = scratch
    # Squares of: distance to the best face so far, distance beyond which nothing is of use.
    best, useful, beyond, answer, hint = numbers[0], numbers[1], numbers[2], places[0], places[1]
    limit, inner, count, size = region * region, len(starts) - 2, len(members), 0.0
    for i in range(3):
        size += np.float64(boxes[0, 1, i]) - boxes[0, 0, i]
        for g in range(GROUP):  # an incomplete group is filled up with its first member
            s = members[g if g < count else 0]
            x[i, g], rest[i, g] = points[s, i], rest_points[s, i]
        span[0, i], span[1, i] = _ends(x[i])
        span[2, i], span[3, i] = _ends(rest[i])
    for g in range(GROUP):
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
    worst = useful.max()
    while depth > 0:
        depth -= 1
        node = stack[depth]
        if bounds[depth] > worst:
            continue
        if node < inner:
            near, other = 2 * node + 1, 2 * node + 2
            least_near = _least(boxes, rest_boxes, near, x, span, useful, worst, limit)
            least_other = _least(boxes, rest_boxes, other, x, span, useful, worst, limit)
            if least_other < least_near:
                near, other, least_near, least_other = other, near, least_other, least_near
            if least_other < NONE:
                stack[depth], bounds[depth] = other, least_other
                depth += 1
            if least_near < NONE:
                stack[depth], bounds[depth] = near, least_near
                depth += 1
            continue
        for k in range(starts[node - inner], starts[node - inner + 1]):
            if _beyond_disc(discs, k, x, useful, beyond) > 0.0:
                continue
            for g in range(count):
                if beyond[g] > 0.0 or k == hint[g] or _squared(centroids, k, rest, g) > limit:
                    continue
                v, w, distance = closest_on_triangle(corners, k, x[0, g], x[1, g], x[2, g])
                if distance < best[g] or (
                    distance == best[g] and answer[g] >= 0 and order[k] < order[answer[g]]
                ):
                    best[g], answer[g], weights[g, 0], weights[g, 1] = distance, k, v, w
                    useful[g] = _useful(distance, size, exact)
        worst = useful[:count].max()
    for g in range(count):
        found[members[g]] = answer[g]
        found_v[members[g]], found_w[members[g]] = weights[g, 0], weights[g, 1]


@njit(cache=True)
def _ends(values):
    """Least and greatest of them, NaN aside."""
    low, high = np.inf, -np.inf
    for value in values:
        if value < low:
            low = value
        if value > high:
            high = value
    return low, high


@njit(cache=True, inline="always")
def _apart(boxes, node, low, high):
    """Squared distance between a box of the tree and one from low (3,) to high (3,)."""
    total = 0.0
    for i in range(3):
        gap = max(max(np.float64(boxes[node, 0, i]) - high[i], low[i] - boxes[node, 1, i]), 0.0)
        total += gap * gap
    return total


@njit(cache=True, fastmath=FAST)
def _least(boxes, rest_boxes, node, x, span, useful, worst, limit):
    """The least squared distance from points of a group to a box that is of use to them; NONE if none is."""
    rest_limit = limit * (1.0 + ROUND_OFF)
    if _apart(boxes, node, span[0], span[1]) > worst or _apart(rest_boxes, node, span[2], span[3]) > rest_limit:
        return NONE
    l0, l1, l2 = np.float64(boxes[node, 0, 0]), np.float64(boxes[node, 0, 1]), np.float64(boxes[node, 0, 2])
    h0, h1, h2 = np.float64(boxes[node, 1, 0]), np.float64(boxes[node, 1, 1]), np.float64(boxes[node, 1, 2])
    least = NONE
    for g in range(GROUP):
        dx = max(max(l0 - x[0, g], x[0, g] - h0), 0.0)
        dy = max(max(l1 - x[1, g], x[1, g] - h1), 0.0)
        dz = max(max(l2 - x[2, g], x[2, g] - h2), 0.0)
        distance = dx * dx + dy * dy + dz * dz
        least = min(least, distance if distance <= useful[g] else NONE)
    return least


@njit(cache=True, fastmath=FAST)
def _beyond_disc(discs, k, x, useful, out):
    """Positive for points to which the flat disc around a face is of no use; and the least of them."""
    c0, c1, c2, r = discs[k, 0], discs[k, 1], discs[k, 2], discs[k, 3]
    n0, n1, n2 = discs[k, 4], discs[k, 5], discs[k, 6]
    least = NONE
    for g in range(GROUP):
        dx, dy, dz = x[0, g] - c0, x[1, g] - c1, x[2, g] - c2
        height = n0 * dx + n1 * dy + n2 * dz
        across = np.sqrt(max(dx * dx + dy * dy + dz * dz - height * height, 0.0))
        over = max(across - r, 0.0)
        out[g] = height * height + over * over - useful[g]
        least = min(least, out[g])
    return least


@njit(cache=True, inline="always")
def _squared(points, k, x, g):
    """Squared distance between a point and one of a group."""
    dx, dy, dz = points[k, 0] - x[0, g], points[k, 1] - x[1, g], points[k, 2] - x[2, g]
    return dx * dx + dy * dy + dz * dz


@njit(cache=True)
def _useful(squared, size, exact):
    """Squared distance beyond which nothing is of use, once something is found at `squared`.

    size: of the mesh, for the round-off in the distances to boxes and faces.
    """
    distance = np.sqrt(squared)
    if distance > exact:
        distance = max(exact, 0.5 * distance)
    distance += ROUND_OFF * (distance + size)
    return distance * distance
