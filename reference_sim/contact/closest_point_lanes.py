"""Search of closest faces (see `closest_point`) by LANES samples and LANES faces side by side.

Bounds are in float32 and never above the true distance by more than a share of ROUND_OFF, which is added to
the distance that they are compared with. A face that no bound keeps away is looked at in float64. So bounds
decide what is looked at, and no answer.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from reference_sim.contact.leaf_bounds import BOUND_MATH, LANES, ROUND_OFF, fit_leaf, leaf_bounds, set_boxes
from reference_sim.geometry.triangle import closest_on_triangle
from reference_sim.kernels.kernel_cache import njit
from reference_sim.kernels.vector_rows import bits_at_most, lowest_bit

DISTANCE_ROUND_OFF = 1e-14  # of lengths, of distances: some fifty times that of float64

# Samples: in groups order[16 i : 16 i + 16]; group i (the last list serves all beyond it) may meet the leaves
# of blocks[starts[i] : stops[i]] whose bit is set in masks, and no others; leaves: of all groups. rest (S, 3)
# [m] in this order and limit [m^2]: the rule of regions.
Listed = namedtuple("Listed", "order starts stops blocks masks leaves rest limit")


@njit(cache=True, error_model="numpy")
def list_leaves(low, high, leaf_low, leaf_high, limit, masks):
    """Set the bits of masks (G, L / 16) where the boxes of a group and a leaf are within `limit` [m^2]."""
    for i in range(len(low)):
        for leaf in range(len(leaf_low)):
            squared = 0.0
            for c in range(3):
                gap = max(max(leaf_low[leaf, c] - high[i, c], low[i, c] - leaf_high[leaf, c]), 0.0)
                squared += gap * gap
            if squared <= limit:
                masks[i, leaf // LANES] |= 1 << (leaf % LANES)


@njit(cache=True, error_model="numpy")
def search(points, samples, everywhere, exact, mesh, pose, faces, barycentric, closest):
    """Find the closest face of every sample at points (S, 3).

    faces (S,) come in as hints and go out as answers. everywhere: the list of all leaves, for samples without
    a face in their region.
    """
    missed = np.empty(len(points), np.int64)
    set_boxes(samples.leaves, mesh, pose)
    count = _search_groups(
        samples.order, points, samples, exact, mesh, pose, faces, barycentric, closest, missed
    )
    if count > 0:
        set_boxes(everywhere.leaves, mesh, pose)
        fit_leaf(0, mesh, pose)  # whoever asks for NaN gets its first face
        faces[missed[:count]] = mesh.order[0]
        barycentric[missed[:count]], closest[missed[:count]] = 1.0 / 3.0, mesh.corners[0].sum(axis=0) / 3.0
        _search_groups(
            missed[:count].copy(), points, everywhere, exact, mesh, pose, faces, barycentric, closest, missed
        )


@njit(cache=True, error_model="numpy")
def _search_groups(some, points, samples, exact, mesh, pose, faces, barycentric, closest, missed):
    """Find the closest allowed faces of some samples (n,), LANES by LANES, from the hints in faces (S,) on.

    Writes who found none into missed (S,) and returns how many.
    """
    # One long function: in three of them, for each group, the search took a tenth longer.
    # Out of their tuples once: each time that an array is taken from one, its references are counted.
    order, ascending, centroids, corners = mesh.order, mesh.ascending, mesh.centroids, mesh.corners
    place, boxes, fitted, slabs, lanes = mesh.place, mesh.boxes, mesh.fitted, mesh.slabs, mesh.lanes
    starts, stops, blocks, masks = samples.starts, samples.stops, samples.blocks, samples.masks
    rest, limit, origin, size = samples.rest, samples.limit, pose.origin, mesh.size[0]
    x, x32 = np.empty((LANES, 3)), np.empty((3, LANES), np.float32)
    best, scale, useful = np.empty(LANES), np.empty(LANES), np.empty(LANES, np.float32)
    answer, weights = np.empty(LANES, np.int64), np.empty((LANES, 2))
    apart, hits, out = (
        np.empty(LANES, np.float32),
        np.empty(LANES, np.int64),
        np.empty(LANES * LANES, np.float32),
    )
    leaves, bounds = np.empty(LANES * len(boxes), np.int64), np.empty(LANES * len(boxes), np.float32)
    limited, missing = limit < np.inf, 0
    for first in range(0, len(some), LANES):
        count, worst = min(LANES, len(some) - first), np.float32(0.0)
        for g in range(LANES):  # an incomplete group is filled up with its first member
            at = first + (g if g < count else 0)
            s = some[at]
            for c in range(3):
                x[g, c] = points[s, c]
                x32[c, g] = x[g, c] - origin[c]
            best[g], answer[g] = np.inf, -1
            if g < count and faces[s] >= 0:
                k = place[faces[s]]
                if fitted[k // LANES] != pose.number:
                    fit_leaf(k // LANES, mesh, pose)
                c0, c1, c2 = centroids[k, 0], centroids[k, 1], centroids[k, 2]
                if not limited or _within(c0 - rest[at, 0], c1 - rest[at, 1], c2 - rest[at, 2], limit):
                    v, w, squared = closest_on_triangle(corners, k, x[g, 0], x[g, 1], x[g, 2])
                    if squared < np.inf:
                        best[g], answer[g], weights[g, 0], weights[g, 1] = squared, k, v, w
            scale[g] = size + max(abs(x32[0, g]), abs(x32[1, g]), abs(x32[2, g]))
            useful[g] = _useful(best[g if g < count else 0], scale[g], exact)
            worst = max(worst, useful[g])
        number = min(first // LANES, len(starts) - 1)
        near_count, nearest = _near_leaves(
            starts[number], stops[number], blocks, masks, boxes, x32, worst, apart, leaves, bounds
        )
        if near_count > 0:  # the nearest first
            leaves[0], leaves[nearest] = leaves[nearest], leaves[0]
            bounds[0], bounds[nearest] = bounds[nearest], bounds[0]
        for n in range(near_count):
            if bounds[n] > worst:
                continue
            leaf, changed = leaves[n], False
            if fitted[leaf] != pose.number:
                fit_leaf(leaf, mesh, pose)
            for i in range(leaf_bounds(leaf, boxes, slabs, lanes, x32, useful, count, apart, hits, out)):
                g, within = hits[i] & (LANES - 1), hits[i] // LANES
                at = first + g
                while within:
                    lane = lowest_bit(within)
                    within &= within - 1
                    k = LANES * leaf + lane
                    if out[LANES * g + lane] > useful[g] or k == answer[g]:
                        continue
                    c0, c1, c2 = centroids[k, 0], centroids[k, 1], centroids[k, 2]
                    if limited and not _within(c0 - rest[at, 0], c1 - rest[at, 1], c2 - rest[at, 2], limit):
                        continue
                    v, w, squared = closest_on_triangle(corners, k, x[g, 0], x[g, 1], x[g, 2])
                    if squared < best[g] or (
                        squared == best[g] and answer[g] >= 0 and order[k] < order[answer[g]]
                    ):
                        best[g], answer[g], weights[g, 0], weights[g, 1] = squared, k, v, w
                        useful[g] = _useful(squared, scale[g], exact)
                        changed = True
            if changed:
                worst = np.float32(0.0)
                for g in range(count):
                    worst = max(worst, useful[g])
        for g in range(count):
            s, k = some[first + g], answer[g]
            if k < 0:
                missed[missing] = s
                missing += 1
                continue
            v, w = weights[g, 0], weights[g, 1]
            u = max(1.0 - v - w, 0.0)
            faces[s] = order[k]
            barycentric[s, ascending[k, 0]] = u
            barycentric[s, ascending[k, 1]], barycentric[s, ascending[k, 2]] = v, w
            for c in range(3):
                closest[s, c] = u * corners[k, 0, c] + v * corners[k, 1, c] + w * corners[k, 2, c]
    return missing


@njit(cache=True, error_model="numpy")
def _within(x, y, z, limit):
    """Return whether an offset is within the rule of regions, a squared distance."""
    return x * x + y * y + z * z <= limit


@njit(cache=True, error_model="numpy")
def _useful(squared, scale, exact):
    """Return the squared bound above which nothing is of use, once something is found at `squared` [m^2].

    scale: of the numbers that bounds are made of [m].
    """
    distance = np.sqrt(squared)
    if distance > exact:
        distance = max(exact, 0.5 * distance)
    distance += DISTANCE_ROUND_OFF * distance + ROUND_OFF * (distance + scale)
    return np.float32(distance * distance)


@njit(cache=True, fastmath=BOUND_MATH)
def _near_leaves(start, stop, blocks, masks, boxes, x32, worst, apart, leaves, bounds):
    """Write the listed leaves whose boxes are within `worst` [m^2] of the box of a group, and their bounds.

    Returns how many there are, and which of them is nearest.
    """
    l0, l1, l2 = x32[0, 0], x32[1, 0], x32[2, 0]
    h0, h1, h2 = l0, l1, l2
    for g in range(LANES):
        l0, l1, l2 = min(l0, x32[0, g]), min(l1, x32[1, g]), min(l2, x32[2, g])
        h0, h1, h2 = max(h0, x32[0, g]), max(h1, x32[1, g]), max(h2, x32[2, g])
    zero, near_count, nearest = np.float32(0.0), 0, 0
    for n in range(start, stop):
        block, mask = blocks[n], masks[n]
        for lane in range(LANES):
            dx = max(max(boxes[block, 0, lane] - h0, l0 - boxes[block, 3, lane]), zero)
            dy = max(max(boxes[block, 1, lane] - h1, l1 - boxes[block, 4, lane]), zero)
            dz = max(max(boxes[block, 2, lane] - h2, l2 - boxes[block, 5, lane]), zero)
            apart[lane] = dx * dx + dy * dy + dz * dz
        near = bits_at_most(apart, 0, worst) & mask
        while near:
            lane = lowest_bit(near)
            near &= near - 1
            leaves[near_count], bounds[near_count] = LANES * block + lane, apart[lane]
            if bounds[near_count] < bounds[nearest]:
                nearest = near_count
            near_count += 1
    return near_count, nearest
