"""Search of closest faces (see `closest_point`) by LANES samples and LANES faces side by side.

Bounds are in float32 and never above the true distance by more than a share of ROUND_OFF, which is added to
the distance that they are compared with. A face that no bound keeps away is looked at in float64. So bounds
decide what is looked at, and no answer.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from reference_sim.geometry.triangle import closest_on_triangle
from reference_sim.kernels.kernel_cache import njit
from reference_sim.kernels.vector_rows import bits_at_most, lowest_bit

LANES = 16  # faces of a leaf, leaves of a block and samples of a group
QUANTITIES = 21  # of a face, for its bound
BOUND_MATH = {"nnan", "nsz", "reassoc", "contract"}  # for bounds alone, within ROUND_OFF
ROUND_OFF = 3e-6  # of lengths, of the bounds: some fifty times that of float32
DISTANCE_ROUND_OFF = 1e-14  # of lengths, of distances: some fifty times that of float64
FLAT = 1e-12  # squared sine of an angle of a triangle, below which its normal is round-off

# The mesh, faces in the order of L leaves of LANES; the last leaf is filled up with its last face.
# order (16 L,) and vertices (16 L, 3): face and its vertices, ascending; ascending (16 L, 3): their corners.
# place (F,): of a face in this order. centroids (16 L, 3) [m] at rest. What follows belongs to a pose, each
# leaf set when it is first needed: boxes (L / 16, 6, 16) [m] of leaves, boxed and fitted (L,) the pose that
# a leaf's box and the rest were set for; corners (16 L, 3, 3) [m], slabs (L, 5): mean normal, least and
# greatest height along it [m]; lanes (L, QUANTITIES 16). Boxes, slabs and lanes: from an origin, in float32.
Mesh = namedtuple(
    "Mesh", "order vertices ascending place centroids boxes boxed fitted corners slabs lanes size"
)
# A pose: its number, the positions (B, 3) [m] and the origin (3,) [m].
Pose = namedtuple("Pose", "number positions origin")
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
    _set_boxes(samples.leaves, mesh, pose)
    count = _search_groups(
        samples.order, points, samples, exact, mesh, pose, faces, barycentric, closest, missed
    )
    if count > 0:
        _set_boxes(everywhere.leaves, mesh, pose)
        _fit(0, mesh, pose)  # whoever asks for NaN gets its first face
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
                    _fit(k // LANES, mesh, pose)
                c0, c1, c2 = centroids[k, 0], centroids[k, 1], centroids[k, 2]
                if not limited or _within(c0 - rest[at, 0], c1 - rest[at, 1], c2 - rest[at, 2], limit):
                    v, w, squared = closest_on_triangle(corners, k, x[g, 0], x[g, 1], x[g, 2])
                    if squared < np.inf:
                        best[g], answer[g], weights[g, 0], weights[g, 1] = squared, k, v, w
            scale[g] = size + max(abs(x32[0, g]), abs(x32[1, g]), abs(x32[2, g]))
            useful[g] = _useful(best[g if g < count else 0], scale[g], exact)
            worst = max(worst, useful[g])
        number = min(first // LANES, len(starts) - 1)
        found, nearest = _near_leaves(
            starts[number], stops[number], blocks, masks, boxes, x32, worst, apart, leaves, bounds
        )
        if found > 0:  # the nearest first
            leaves[0], leaves[nearest] = leaves[nearest], leaves[0]
            bounds[0], bounds[nearest] = bounds[nearest], bounds[0]
        for n in range(found):
            if bounds[n] > worst:
                continue
            leaf, changed = leaves[n], False
            if fitted[leaf] != pose.number:
                _fit(leaf, mesh, pose)
            for i in range(_bounds(leaf, boxes, slabs, lanes, x32, useful, count, apart, hits, out)):
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
    zero, found, nearest = np.float32(0.0), 0, 0
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
            leaves[found], bounds[found] = LANES * block + lane, apart[lane]
            if bounds[found] < bounds[nearest]:
                nearest = found
            found += 1
    return found, nearest


@njit(cache=True, fastmath=BOUND_MATH)
def _bounds(leaf, boxes, slabs, lanes, x32, useful, count, apart, hits, out):
    """Write into out (LANES LANES,) the bounds of the faces of a leaf, for members that may need one.

    Box and slab of the leaf keep most away. Returns of how many members some faces are within what is of use,
    and writes into hits (LANES,) LANES times the bits of these faces, plus the member.
    """
    b, lane = leaf // LANES, leaf % LANES
    l0, l1, l2 = boxes[b, 0, lane], boxes[b, 1, lane], boxes[b, 2, lane]
    h0, h1, h2 = boxes[b, 3, lane], boxes[b, 4, lane], boxes[b, 5, lane]
    n0, n1, n2, low, high = slabs[leaf, 0], slabs[leaf, 1], slabs[leaf, 2], slabs[leaf, 3], slabs[leaf, 4]
    zero, needing = np.float32(0.0), 0
    for g in range(LANES):
        dx = max(max(l0 - x32[0, g], x32[0, g] - h0), zero)
        dy = max(max(l1 - x32[1, g], x32[1, g] - h1), zero)
        dz = max(max(l2 - x32[2, g], x32[2, g] - h2), zero)
        height = n0 * x32[0, g] + n1 * x32[1, g] + n2 * x32[2, g]
        dn = max(max(low - height, height - high), zero)
        apart[g] = max(dx * dx + dy * dy + dz * dz, dn * dn) - useful[g]
    needed = bits_at_most(apart, 0, zero) & ((1 << count) - 1)
    while needed:
        g = lowest_bit(needed)
        needed &= needed - 1
        _face_bounds(leaf, lanes, x32[0, g], x32[1, g], x32[2, g], g, out)
        within = bits_at_most(out, g, useful[g])
        hits[needing] = LANES * within + g
        needing += within != 0
    return needing


@njit(cache=True, fastmath=BOUND_MATH, inline="always")
def _face_bounds(leaf, lanes, x, y, z, g, out):
    """Write the squared distances from a sample to the faces of a leaf into row g of out.

    In the frame of each face: its height, and in its plane the distance to the nearest side, where the foot
    is beyond one. Both change no faster than the sample moves, so that round-off stays round-off.
    """
    zero = np.float32(0.0)
    for i in range(LANES):
        rx, ry, rz = x - lanes[leaf, i], y - lanes[leaf, 16 + i], z - lanes[leaf, 32 + i]
        h = lanes[leaf, 48 + i] * rx + lanes[leaf, 64 + i] * ry + lanes[leaf, 80 + i] * rz
        p = lanes[leaf, 96 + i] * rx + lanes[leaf, 112 + i] * ry + lanes[leaf, 128 + i] * rz
        q = lanes[leaf, 144 + i] * rx + lanes[leaf, 160 + i] * ry + lanes[leaf, 176 + i] * rz
        half0, half2 = lanes[leaf, 192 + i], lanes[leaf, 304 + i]
        a1, b1 = lanes[leaf, 208 + i], lanes[leaf, 224 + i]
        a2, b2 = lanes[leaf, 272 + i], lanes[leaf, 288 + i]
        s0, s1, s2 = -q, a1 * p + b1 * q - lanes[leaf, 240 + i], a2 * p + b2 * q
        t0 = max(abs(p - half0) - half0, zero)
        t1 = a1 * q - b1 * p - lanes[leaf, 256 + i]
        t1 = max(abs(t1) - lanes[leaf, 320 + i], zero)
        t2 = max(abs(a2 * q - b2 * p + half2) - half2, zero)
        side = min(min(s0 * s0 + t0 * t0, s1 * s1 + t1 * t1), s2 * s2 + t2 * t2)
        out[LANES * g + i] = h * h + (side if max(max(s0, s1), s2) > zero else zero)


@njit(cache=True, error_model="numpy")
def _set_boxes(leaves, mesh, pose):
    """Set the boxes of some leaves in a pose, and the greatest distance from the origin along an axis."""
    low, high = np.empty(3), np.empty(3)
    for leaf in leaves:
        if mesh.boxed[leaf] == pose.number:
            continue
        mesh.boxed[leaf] = pose.number
        low[:], high[:] = np.inf, -np.inf
        for place in range(LANES * leaf, LANES * leaf + LANES):
            for a in range(3):
                v = mesh.vertices[place, a]
                for c in range(3):
                    value = np.float64(pose.positions[v, c])
                    low[c], high[c] = min(low[c], value), max(high[c], value)
        box = mesh.boxes[leaf // LANES]
        for c in range(3):
            box[c, leaf % LANES], box[3 + c, leaf % LANES] = low[c] - pose.origin[c], high[c] - pose.origin[c]
            mesh.size[0] = max(mesh.size[0], high[c] - pose.origin[c], pose.origin[c] - low[c])


@njit(cache=True, error_model="numpy")
def _fit(leaf, mesh, pose):
    """Set corners, slab and lanes of a leaf in a pose."""
    mesh.fitted[leaf] = pose.number
    mean = np.zeros(3)
    for lane in range(LANES):
        place = LANES * leaf + lane
        corners = mesh.corners[place]
        for a in range(3):
            v = mesh.vertices[place, a]
            for c in range(3):
                corners[a, c] = pose.positions[v, c]
        _set_lane(corners, pose.origin, mesh.lanes[leaf], lane, mean)
    length = np.sqrt(mean[0] ** 2 + mean[1] ** 2 + mean[2] ** 2)
    mean *= 1.0 / length if length > 0.0 else 0.0
    low, high = np.inf, -np.inf
    for place in range(LANES * leaf, LANES * leaf + LANES):
        for a in range(3):
            height = 0.0
            for c in range(3):
                height += mean[c] * (mesh.corners[place, a, c] - pose.origin[c])
            low, high = min(low, height), max(high, height)
    slab = mesh.slabs[leaf]
    slab[0], slab[1], slab[2], slab[3], slab[4] = mean[0], mean[1], mean[2], low, high


@njit(cache=True, error_model="numpy")
def _set_lane(corners, origin, lanes, lane, mean):
    """Set one face's first corner, normal, axes and sides for `_face_bounds`; add twice its area to `mean`.

    A flat face has no frame: all zero, its bound is zero.
    """
    a0, a1, a2 = np.float64(corners[0, 0]), np.float64(corners[0, 1]), np.float64(corners[0, 2])
    s0, s1, s2 = corners[1, 0] - a0, corners[1, 1] - a1, corners[1, 2] - a2
    t0, t1, t2 = corners[2, 0] - a0, corners[2, 1] - a1, corners[2, 2] - a2
    n0, n1, n2 = s1 * t2 - s2 * t1, s2 * t0 - s0 * t2, s0 * t1 - s1 * t0
    ss, tt, nn = s0 * s0 + s1 * s1 + s2 * s2, t0 * t0 + t1 * t1 + t2 * t2, n0 * n0 + n1 * n1 + n2 * n2
    mean[0] += n0
    mean[1] += n1
    mean[2] += n2
    longest = max(ss, tt)
    if not nn > FLAT * longest * longest:
        for k in range(QUANTITIES):
            lanes[LANES * k + lane] = 0.0
        return
    along, area = np.sqrt(ss), np.sqrt(nn)
    n0, n1, n2 = n0 / area, n1 / area, n2 / area
    p0, p1, p2 = s0 / along, s1 / along, s2 / along
    q0, q1, q2 = n1 * p2 - n2 * p1, n2 * p0 - n0 * p2, n0 * p1 - n1 * p0
    # In the plane the corners are (0, 0), (along, 0) and (c, d); the normals of sides point outwards.
    c, d = p0 * t0 + p1 * t1 + p2 * t2, area / along
    length1, length2 = np.sqrt((c - along) * (c - along) + d * d), np.sqrt(tt)
    a, b = d / length1, (along - c) / length1
    values = (
        a0 - origin[0], a1 - origin[1], a2 - origin[2], n0, n1, n2, p0, p1, p2, q0, q1, q2, 0.5 * along,
        a, b, a * along, 0.5 * length1 - b * along, -d / length2, c / length2, 0.5 * length2, 0.5 * length1,
    )  # fmt: skip
    for k in range(QUANTITIES):
        lanes[LANES * k + lane] = values[k]
