"""Distances from samples to faces: bounds for LANES samples and a leaf of faces at once, and exact ones."""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from reference_sim.kernels.fast_kernels import LANES
from reference_sim.kernels.kernel_cache import njit
from reference_sim.kernels.lanes import bits_at_most, lowest_bit

# LANES: faces of a leaf, leaves of a block and samples of a group
QUANTITIES = 21  # of a face, for its bound
# Bounds are in float32 and never above the true distance by more than a share of ROUND_OFF, which is
# added to the distance that they are compared with. A leaf is fitted to a pose when it is first needed.
# The exact distance is the same to the bit for all triangles that share the closest side or corner.
BOUND_MATH = {"nnan", "nsz", "reassoc", "contract"}  # for bounds alone, within ROUND_OFF
ROUND_OFF = 3e-6  # of lengths, of the bounds: some fifty times that of float32
# Squared sine of an angle of a triangle, below which its normal is round-off.
FLAT = 1e-12

# The mesh, faces in the order of L leaves of LANES; the last leaf is filled up with its last face.
# order (16 L,) and vertices (16 L, 3): face and its vertices, ascending; ascending (16 L, 3): their
# corners. spread (L, n): the vertices of a leaf, each once, the first repeated. place (F,): of a face in
# this order. centroids (16 L, 3) [m] at rest. What follows belongs to a pose, each leaf set when it is
# first needed: boxes (L / 16, 6, 16) [m] of leaves, boxed and fitted (L,) the pose that a leaf's box and
# the rest were set for; corners (16 L, 3, 3) [m], slabs (L, 5): mean normal, least and greatest height
# along it [m]; lanes (L, QUANTITIES 16). Boxes, slabs and lanes: from an origin, in float32. offsets (9,
# 16): room for `fit_leaf`.
Mesh = namedtuple(
    "Mesh",
    "order vertices spread ascending place centroids boxes boxed fitted corners offsets slabs lanes size",
)
# A pose: its number, the positions (B, 3) [m] and the origin (3,) [m].
Pose = namedtuple("Pose", "number positions origin")


@njit(cache=True, error_model="numpy")
def set_boxes(leaves, mesh, pose):
    """Set the boxes of some leaves in a pose, and the greatest distance from the origin along an axis."""
    spread, boxes, boxed = mesh.spread, mesh.boxes, mesh.boxed
    positions, origin = pose.positions, pose.origin
    largest = mesh.size[0]
    for leaf in leaves:
        if boxed[leaf] == pose.number:
            continue
        boxed[leaf] = pose.number
        v = spread[leaf, 0]
        l0, l1, l2 = positions[v, 0], positions[v, 1], positions[v, 2]
        h0, h1, h2 = l0, l1, l2
        for n in range(1, spread.shape[1]):
            v = spread[leaf, n]
            x, y, z = positions[v, 0], positions[v, 1], positions[v, 2]
            l0, l1, l2 = min(l0, x), min(l1, y), min(l2, z)
            h0, h1, h2 = max(h0, x), max(h1, y), max(h2, z)
        b, lane = leaf // LANES, leaf % LANES
        for c, low, high in ((0, l0, h0), (1, l1, h1), (2, l2, h2)):
            low, high = low - origin[c], high - origin[c]
            boxes[b, c, lane], boxes[b, 3 + c, lane] = low, high
            largest = max(largest, max(high, -low))
    mesh.size[0] = largest


@njit(cache=True, error_model="numpy")
def fit_leaf(leaf, mesh, pose):
    """Set corners, slab and lanes of a leaf in a pose."""
    mesh.fitted[leaf] = pose.number
    vertices, corners, offsets = mesh.vertices, mesh.corners, mesh.offsets
    positions, origin = pose.positions, pose.origin
    for lane in range(LANES):
        place = LANES * leaf + lane
        for a in range(3):
            v = vertices[place, a]
            for c in range(3):
                corners[place, a, c] = positions[v, c]
                offsets[3 * a + c, lane] = positions[v, c] - origin[c]
    _set_lanes(offsets, mesh.lanes[leaf])
    _set_slab(offsets, mesh.slabs[leaf])


@njit(cache=True, error_model="numpy", fastmath=BOUND_MATH)
def _set_lanes(offsets, lanes):
    """Set first corners, normals, axes and sides of the faces of a leaf, for `_face_bounds`.

    offsets (9, LANES) [m]: corners of the faces from the origin. A flat face has no frame: with all of it
    zero, its bound is zero.
    """
    for i in range(LANES):
        a0, a1, a2 = offsets[0, i], offsets[1, i], offsets[2, i]
        s0, s1, s2 = offsets[3, i] - a0, offsets[4, i] - a1, offsets[5, i] - a2
        t0, t1, t2 = offsets[6, i] - a0, offsets[7, i] - a1, offsets[8, i] - a2
        n0, n1, n2 = s1 * t2 - s2 * t1, s2 * t0 - s0 * t2, s0 * t1 - s1 * t0
        ss, tt, nn = s0 * s0 + s1 * s1 + s2 * s2, t0 * t0 + t1 * t1 + t2 * t2, n0 * n0 + n1 * n1 + n2 * n2
        flat = not nn > FLAT * max(ss, tt) * max(ss, tt)
        along, area = 0.0 if flat else np.sqrt(ss), np.sqrt(nn)
        per_along, per_area = 0.0 if flat else 1.0 / along, 0.0 if flat else 1.0 / area
        n0, n1, n2 = per_area * n0, per_area * n1, per_area * n2
        p0, p1, p2 = per_along * s0, per_along * s1, per_along * s2
        q0, q1, q2 = n1 * p2 - n2 * p1, n2 * p0 - n0 * p2, n0 * p1 - n1 * p0
        # In the plane the corners are (0, 0), (along, 0) and (c, d); the normals of sides point outwards.
        c, d = p0 * t0 + p1 * t1 + p2 * t2, area * per_along
        length1, length2 = np.sqrt((c - along) * (c - along) + d * d), np.sqrt(c * c + d * d)
        per1, per2 = 0.0 if flat else 1.0 / length1, 0.0 if flat else 1.0 / length2
        a, b = d * per1, (along - c) * per1
        lanes[i], lanes[16 + i], lanes[32 + i] = a0, a1, a2
        lanes[48 + i], lanes[64 + i], lanes[80 + i] = n0, n1, n2
        lanes[96 + i], lanes[112 + i], lanes[128 + i] = p0, p1, p2
        lanes[144 + i], lanes[160 + i], lanes[176 + i] = q0, q1, q2
        lanes[192 + i], lanes[208 + i], lanes[224 + i] = 0.5 * along, a, b
        lanes[240 + i], lanes[256 + i] = a * along, 0.5 * length1 - b * along
        lanes[272 + i], lanes[288 + i] = -d * per2, c * per2
        lanes[304 + i], lanes[320 + i] = 0.5 * length2, 0.5 * length1


@njit(cache=True, error_model="numpy", fastmath=BOUND_MATH)
def _set_slab(offsets, slab):
    """Set the mean normal of a leaf, and least and greatest height along it; offsets: see `_set_lanes`."""
    m0, m1, m2 = 0.0, 0.0, 0.0
    for i in range(LANES):
        a0, a1, a2 = offsets[0, i], offsets[1, i], offsets[2, i]
        s0, s1, s2 = offsets[3, i] - a0, offsets[4, i] - a1, offsets[5, i] - a2
        t0, t1, t2 = offsets[6, i] - a0, offsets[7, i] - a1, offsets[8, i] - a2
        m0 += s1 * t2 - s2 * t1
        m1 += s2 * t0 - s0 * t2
        m2 += s0 * t1 - s1 * t0
    length = np.sqrt(m0 * m0 + m1 * m1 + m2 * m2)
    scale = 1.0 / length if length > 0.0 else 0.0
    m0, m1, m2 = scale * m0, scale * m1, scale * m2
    low = high = m0 * offsets[0, 0] + m1 * offsets[1, 0] + m2 * offsets[2, 0]
    for a in range(0, 9, 3):
        for i in range(LANES):
            height = m0 * offsets[a, i] + m1 * offsets[a + 1, i] + m2 * offsets[a + 2, i]
            low, high = min(low, height), max(high, height)
    slab[0], slab[1], slab[2], slab[3], slab[4] = m0, m1, m2, low, high


@njit(cache=True, fastmath=BOUND_MATH)
def leaf_bounds(leaf, boxes, slabs, lanes, x32, useful, count, excess, hits, out):
    """Write into out (LANES LANES,) the bounds of the faces of a leaf, for members that may need one.

    Box and slab of the leaf keep most away. Returns of how many members some faces are within what is of
    use, and writes into hits (LANES,) LANES times the bits of these faces, plus the member.
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
        excess[g] = max(dx * dx + dy * dy + dz * dz, dn * dn) - useful[g]
    members = bits_at_most(excess, 0, zero) & ((1 << count) - 1)
    while members:
        g = lowest_bit(members)
        members &= members - 1
        _face_bounds(leaf, lanes, x32[0, g], x32[1, g], x32[2, g], g, out)
        within = bits_at_most(out, g, useful[g])
        hits[needing] = LANES * within + g
        needing += within != 0
    return needing


@njit(cache=True, fastmath=BOUND_MATH, inline="always")
def _face_bounds(leaf, lanes, x, y, z, g, out):
    """Write the squared distances from a sample to the faces of a leaf into row g of out.

    In the frame of each face: its height, and in its plane the distance to the nearest side, where the
    foot is beyond one.
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


# Squared sine of a triangle's first angle, below which all of its sides are tried.
SLIVER = 1e-3


@njit(cache=True, error_model="numpy")
def _on_side(a0, a1, a2, b0, b1, b2, x, y, z):
    """Return the share of the side from corner a to b that is closest to a point, and the distance squared.

    The same bits for every face that has the side, and the same for every side that ends in the corner.
    """
    r0, r1, r2 = x - a0, y - a1, z - a2
    s0, s1, s2 = b0 - a0, b1 - a1, b2 - a2
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
def _closest(a0, a1, a2, b0, b1, b2, c0, c1, c2, x, y, z):
    r0, r1, r2 = x - a0, y - a1, z - a2
    s0, s1, s2 = b0 - a0, b1 - a1, b2 - a2
    t0, t1, t2 = c0 - a0, c1 - a1, c2 - a2
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
        share, distance = _on_side(a0, a1, a2, b0, b1, b2, x, y, z)
        if distance < best:
            best, best_v, best_w = distance, share, 0.0
    if v < 0.0 or sliver:
        share, distance = _on_side(a0, a1, a2, c0, c1, c2, x, y, z)
        if distance < best:
            best, best_v, best_w = distance, 0.0, share
    if u < 0.0 or sliver:
        share, distance = _on_side(b0, b1, b2, c0, c1, c2, x, y, z)
        if distance < best:
            best, best_v = distance, 1.0 - share
            best_w = 1.0 - best_v  # so that the first weight, 1 - v - w, is exactly zero
    return best_v, best_w, best


@njit(cache=True, error_model="numpy")
def closest_on_triangle(corners, place, x, y, z):
    """Return the last two weights of the point of corners[place] closest to (x, y, z), and distance^2.

    It is the foot of the perpendicular, where that lies inside; else the best of the sides that the foot
    is beyond, one of which holds the closest point. Of a sliver, whose foot is too inexact to tell, all
    sides.
    """
    # As numbers: a function with several ends counts the references to an array at every call.
    return _closest(
        corners[place, 0, 0], corners[place, 0, 1], corners[place, 0, 2],
        corners[place, 1, 0], corners[place, 1, 1], corners[place, 1, 2],
        corners[place, 2, 0], corners[place, 2, 1], corners[place, 2, 2],
        x, y, z,
    )  # fmt: skip
