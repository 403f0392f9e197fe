"""Closest points of a moving triangle mesh, exactly: lists of leaves, bounds in float32, answers in float64.

In one pose the faces are halved again and again along the longest side of the box of their centroids,
down to leaves of LANES neighbouring faces; samples likewise to groups, by their places at rest. A sample
may be restricted to the faces near its own place at rest: which leaves a group may meet is then known for
good. A search begins with the face that its caller remembers from before.

An answer depends on mesh and point alone, never on what was remembered: of faces at the same distance the
one of lowest index answers, and a face is left out only if it is farther by more than round-off.
"""

from __future__ import annotations

from collections import namedtuple
from dataclasses import dataclass

import numpy as np

from reference_sim.geometry.leaf_bounds import (
    BOUND_MATH,
    LANES,
    QUANTITIES,
    ROUND_OFF,
    Mesh,
    Pose,
    closest_on_triangle,
    fit_leaf,
    leaf_bounds,
    set_boxes,
)
from reference_sim.kernels.kernel_cache import njit
from reference_sim.kernels.lanes import bits_at_most, lowest_bit

DISTANCE_ROUND_OFF = 1e-14  # of lengths, of distances: some fifty times that of float64

# Samples: in groups order[16 i : 16 i + 16]; group i (the last list serves all beyond it) may meet the
# leaves of blocks[starts[i] : stops[i]] whose bit is set in masks, and no others; leaves: of all groups.
# rest (S, 3) [m] in this order and limit [m^2]: the rule of regions.
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
def search(subset, points, samples, exact, mesh, pose, faces, barycentric, closest, missed):
    """Find the closest allowed faces of a subset (n,), LANES by LANES, from the hints in faces (S,) on.

    Writes who found none into missed (S,) and returns how many.
    """
    set_boxes(samples.leaves, mesh, pose)
    # One long function: in three of them, for each group, the search took a tenth longer; in inlined ones,
    # each of whose arguments is counted again, up to ten times as long where few faces are allowed.
    # Out of their tuples once: each time that an array is taken from one, its references are counted.
    order, ascending, centroids, corners = mesh.order, mesh.ascending, mesh.centroids, mesh.corners
    place, boxes, fitted, slabs, lanes = mesh.place, mesh.boxes, mesh.fitted, mesh.slabs, mesh.lanes
    starts, stops, blocks, masks = samples.starts, samples.stops, samples.blocks, samples.masks
    rest, limit, origin, size = samples.rest, samples.limit, pose.origin, mesh.size[0]
    x, x32 = np.empty((LANES, 3)), np.empty((3, LANES), np.float32)
    best, scale, useful = np.empty(LANES), np.empty(LANES), np.empty(LANES, np.float32)
    answer, weights = np.empty(LANES, np.int64), np.empty((LANES, 2))
    gaps, hits = np.empty(LANES, np.float32), np.empty(LANES, np.int64)
    out = np.empty(LANES * LANES, np.float32)
    leaves, bounds = np.empty(LANES * len(boxes), np.int64), np.empty(LANES * len(boxes), np.float32)
    limited, misses = limit < np.inf, 0
    for first in range(0, len(subset), LANES):
        count, worst = min(LANES, len(subset) - first), np.float32(0.0)
        for g in range(LANES):  # an incomplete group is filled up with its first member
            at = first + (g if g < count else 0)
            s = subset[at]
            for c in range(3):
                x[g, c] = points[s, c]
                x32[c, g] = x[g, c] - origin[c]
            best[g], answer[g] = np.inf, -1
            if g < count and faces[s] >= 0:
                k = place[faces[s]]
                if fitted[k // LANES] != pose.number:
                    fit_leaf(k // LANES, mesh, pose)
                c0, c1, c2 = centroids[k, 0], centroids[k, 1], centroids[k, 2]
                if not limited or _is_within(c0 - rest[at, 0], c1 - rest[at, 1], c2 - rest[at, 2], limit):
                    v, w, squared = closest_on_triangle(corners, k, x[g, 0], x[g, 1], x[g, 2])
                    if squared < np.inf:
                        best[g], answer[g], weights[g, 0], weights[g, 1] = squared, k, v, w
            scale[g] = size + max(abs(x32[0, g]), abs(x32[1, g]), abs(x32[2, g]))
            useful[g] = _bound(best[g if g < count else 0], scale[g], exact)
            worst = max(worst, useful[g])
        number = min(first // LANES, len(starts) - 1)
        near_count, nearest = _find_leaves(
            starts[number], stops[number], blocks, masks, boxes, x32, worst, gaps, leaves, bounds
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
            for i in range(leaf_bounds(leaf, boxes, slabs, lanes, x32, useful, count, gaps, hits, out)):
                g, within = hits[i] & (LANES - 1), hits[i] // LANES
                at = first + g
                while within:
                    lane = lowest_bit(within)
                    within &= within - 1
                    k = LANES * leaf + lane
                    if out[LANES * g + lane] > useful[g] or k == answer[g]:
                        continue
                    c0, c1, c2 = centroids[k, 0], centroids[k, 1], centroids[k, 2]
                    if limited and not _is_within(
                        c0 - rest[at, 0], c1 - rest[at, 1], c2 - rest[at, 2], limit
                    ):
                        continue
                    v, w, squared = closest_on_triangle(corners, k, x[g, 0], x[g, 1], x[g, 2])
                    if squared < best[g] or (
                        squared == best[g] and answer[g] >= 0 and order[k] < order[answer[g]]
                    ):
                        best[g], answer[g], weights[g, 0], weights[g, 1] = squared, k, v, w
                        useful[g] = _bound(squared, scale[g], exact)
                        changed = True
            if changed:
                worst = np.float32(0.0)
                for g in range(count):
                    worst = max(worst, useful[g])
        for g in range(count):
            s, k = subset[first + g], answer[g]
            if k < 0:
                missed[misses] = s
                misses += 1
                continue
            v, w = weights[g, 0], weights[g, 1]
            u = max(1.0 - v - w, 0.0)
            faces[s] = order[k]
            barycentric[s, ascending[k, 0]] = u
            barycentric[s, ascending[k, 1]], barycentric[s, ascending[k, 2]] = v, w
            for c in range(3):
                closest[s, c] = u * corners[k, 0, c] + v * corners[k, 1, c] + w * corners[k, 2, c]
    return misses


@njit(cache=True, error_model="numpy")
def _is_within(x, y, z, limit):
    """Return whether an offset is within the rule of regions, a squared distance."""
    return x * x + y * y + z * z <= limit


@njit(cache=True, error_model="numpy")
def _bound(squared, scale, exact):
    """Return the squared bound above which nothing is of use, once something is found at `squared` [m^2].

    scale: of the numbers that bounds are made of [m].
    """
    distance = np.sqrt(squared)
    if distance > exact:
        distance = max(exact, 0.5 * distance)
    distance += DISTANCE_ROUND_OFF * distance + ROUND_OFF * (distance + scale)
    return np.float32(distance * distance)


@njit(cache=True, fastmath=BOUND_MATH)
def _find_leaves(start, stop, blocks, masks, boxes, x32, worst, gaps, leaves, bounds):
    """Write the listed leaves whose boxes are within `worst` [m^2] of the box of a group, and their bounds.

    Returns how many there are, and which of them is nearest.
    """
    l0, l1, l2 = x32[0, 0], x32[1, 0], x32[2, 0]
    h0, h1, h2 = l0, l1, l2
    for g in range(LANES):
        l0, l1, l2 = min(l0, x32[0, g]), min(l1, x32[1, g]), min(l2, x32[2, g])
        h0, h1, h2 = max(h0, x32[0, g]), max(h1, x32[1, g]), max(h2, x32[2, g])
    zero, count, nearest = np.float32(0.0), 0, 0
    for n in range(start, stop):
        block, mask = blocks[n], masks[n]
        for lane in range(LANES):
            dx = max(max(boxes[block, 0, lane] - h0, l0 - boxes[block, 3, lane]), zero)
            dy = max(max(boxes[block, 1, lane] - h1, l1 - boxes[block, 4, lane]), zero)
            dz = max(max(boxes[block, 2, lane] - h2, l2 - boxes[block, 5, lane]), zero)
            gaps[lane] = dx * dx + dy * dy + dz * dz
        bits = bits_at_most(gaps, 0, worst) & mask
        while bits:
            lane = lowest_bit(bits)
            bits &= bits - 1
            leaves[count], bounds[count] = LANES * block + lane, gaps[lane]
            if bounds[count] < bounds[nearest]:
                nearest = count
            count += 1
    return count, nearest


@dataclass(frozen=True)
class Closest:
    """Closest points of samples."""

    faces: np.ndarray  # (S,)
    barycentric: np.ndarray  # (S, 3) place on the face
    points: np.ndarray  # (S, 3) [m]


class FaceSearch:
    """Search of closest points on faces (F, 3) that move. Call `refit` before the first search.

    By the centroids (F, 3) [m] at rest, in a pose that spreads the mesh, leaves are made and the rule of
    regions decides.
    """

    def __init__(self, faces: np.ndarray, centroids: np.ndarray) -> None:
        self.faces = np.ascontiguousarray(faces, dtype=np.int64)
        order = arrange(centroids)
        place = np.argsort(order)
        leaves = -(-len(order) // LANES)
        order = np.append(order, np.repeat(order[-1], LANES * leaves - len(order)))
        # Corners by ascending vertex: faces then agree to the bit about a side or corner that they share.
        ascending = np.argsort(self.faces[order], axis=1, kind="stable")
        vertices = np.take_along_axis(self.faces[order], ascending, axis=1)
        blocks = -(-leaves // LANES)
        self._mesh = Mesh(
            order, vertices, _drop_repeats(vertices.reshape(leaves, -1)), ascending, place,
            np.ascontiguousarray(centroids[order], np.float64), np.zeros((blocks, 6, LANES), np.float32),
            np.zeros(leaves, np.int64), np.zeros(leaves, np.int64), np.zeros((len(order), 3, 3)),
            np.zeros((9, LANES)), np.zeros((leaves, 5), np.float32),
            np.zeros((leaves, QUANTITIES * LANES), np.float32), np.zeros(1),
        )  # fmt: skip
        self._pose = Pose(0, np.empty((0, 3)), np.zeros(3))
        everywhere, rest, masks = np.arange(leaves), np.zeros((1, 3)), np.full(blocks, 2**LANES - 1)
        masks[-1] >>= LANES * blocks - leaves
        self._everywhere = Listed(
            place, np.zeros(1, np.int64), np.full(1, blocks), np.arange(blocks), masks, everywhere, rest,
            np.inf,
        )  # fmt: skip

    def refit(self, positions: np.ndarray) -> None:
        """Move the mesh to positions (B, 3) [m], which stay as they are until the next call."""
        positions = np.ascontiguousarray(positions, np.float64)
        origin = positions[len(positions) // 2].copy()
        self._pose = Pose(self._pose.number + 1, positions, origin)
        self._mesh.size[0] = 0.0

    def group(self, points: np.ndarray, region: float = np.inf) -> Listed:
        """Group samples at points (S, 3) [m], best at rest, and list the leaves that each group may meet.

        A sample meets only faces whose rest centroid lies no farther than `region` [m] from its point
        here; where there is none, all.
        """
        points = np.ascontiguousarray(points, np.float64)
        order, full_list = arrange(points), self._everywhere
        if region == np.inf:
            return full_list._replace(order=order)
        count, blocks = -(-len(points) // LANES), len(full_list.blocks)
        masks = np.zeros((count, blocks), np.int64)
        list_leaves(*_boxes(points[order]), *_boxes(self._mesh.centroids), region * region, masks)
        # Without strides, as in the list of all: numba compiles the search once.
        group, block = map(np.ascontiguousarray, masks.nonzero())
        ends = np.searchsorted(group, np.arange(count + 1))
        met = np.bitwise_or.reduce(masks, axis=0, initial=0)[:, None] >> np.arange(LANES) & 1
        return Listed(
            order, ends[:-1], ends[1:], block, masks[group, block], np.flatnonzero(met), points[order],
            region * region,
        )  # fmt: skip

    def nearest(
        self,
        points: np.ndarray,
        *,
        hints: np.ndarray | None = None,
        samples: Listed | None = None,
        exact: float = np.inf,
    ) -> Closest:
        """Find the points of the mesh closest to points (S, 3) [m].

        hints: (S,) faces to begin with, -1 for none. They change the cost and, but for `exact`, no
        answer. samples: as `group` gives it for the samples; without, any face may be met. exact: [m] a
        sample farther away than this may get any point at most twice as far as the closest: a remembered
        face then often does, for a third of the cost.
        """
        points = np.ascontiguousarray(points, np.float64)
        faces = np.full(len(points), -1) if hints is None else np.array(hints, np.int64)
        barycentric, closest = np.empty((len(points), 3)), np.empty((len(points), 3))
        if samples is None:
            samples = self.group(points)
        missed, mesh = np.empty(len(points), np.int64), self._mesh
        state = float(exact), mesh, self._pose, faces, barycentric, closest, missed
        strays = missed[: search(samples.order, points, samples, *state)].copy()
        if len(strays):  # whoever asks for NaN gets the first face
            faces[strays], barycentric[strays] = mesh.order[0], 1.0 / 3.0
            closest[strays] = self._pose.positions[mesh.vertices[0]].mean(axis=0)
            search(strays, points, self._everywhere, *state)
        return Closest(faces, barycentric, closest)


def _drop_repeats(vertices: np.ndarray) -> np.ndarray:
    """Return the different numbers of each row (L, n), filled up with the least to the longest of them."""
    rows = np.sort(vertices, axis=1)
    copies = rows[:, 1:] == rows[:, :-1]
    rows[:, 1:][copies] = np.broadcast_to(rows[:, :1], copies.shape)[copies]
    return np.ascontiguousarray(np.sort(rows, axis=1)[:, copies.sum(axis=1).min() :])


def _boxes(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the low and high corners (n, 3) of the boxes of points, LANES after LANES."""
    starts = np.arange(0, len(points), LANES)
    low, high = (ends.reduceat(points, starts, axis=0) for ends in (np.minimum, np.maximum))
    return low, high


def arrange(points: np.ndarray) -> np.ndarray:
    """Order points (N, 3) so that each LANES of them lie together: halved again and again; returns (N,)."""
    count = len(points)
    order, starts = np.arange(count), np.array([0, count])
    while np.diff(starts).max() > LANES:
        x = points[order]
        block = np.repeat(np.arange(len(starts) - 1), np.diff(starts))
        low, high = (ends.reduceat(x, starts[:-1], axis=0) for ends in (np.minimum, np.maximum))
        along = x[np.arange(count), (high - low).argmax(axis=1)[block]]
        order = order[np.lexsort((along, block))]
        middles = starts[:-1] + np.diff(starts) // (2 * LANES) * LANES
        middles = np.where(np.diff(starts) > LANES, np.maximum(middles, starts[:-1] + LANES), starts[:-1])
        starts = np.unique(np.append(np.append(starts[:-1], middles), count))
    return order
