"""Closest points of a moving triangle mesh, exactly: lists of leaves, bounds in float32, answers in float64.

In one pose the faces are halved again and again along the longest side of the box of their centroids, down to
leaves of LANES neighbouring faces; samples likewise to groups, by their places at rest. A sample may be
restricted to the faces near its own place at rest: which leaves a group may meet is then known for good. A
search begins with the face that its caller remembers from before: any face is an upper bound, and a good one
leaves little to look at.

An answer depends on mesh and point alone, never on what was remembered: of faces at the same distance the one
of lowest index answers, and a face is left out only if it is farther by more than round-off. Distances are in
float64 even where the mesh is kept in float32.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from reference_sim.contact.closest_point_lanes import Listed, list_leaves, search
from reference_sim.contact.leaf_bounds import LANES, QUANTITIES, Mesh, Pose


@dataclass(frozen=True)
class Closest:
    """Closest points of samples.

    Attributes:
        faces: (S,).
        barycentric: (S, 3) place on the face.
        points: (S, 3) [m].
    """

    faces: np.ndarray
    barycentric: np.ndarray
    points: np.ndarray


class FaceSearch:
    """Search of closest faces of a mesh whose vertices move. Call `refit` before the first search.

    Args:
        faces: (F, 3), at least one.
        centroids: (F, 3) [m], their centroids at rest, in a pose that spreads the mesh: by them leaves are
            made and the rule of regions decides. Positions are kept in their type, float64 or float32.
    """

    def __init__(self, faces: np.ndarray, centroids: np.ndarray) -> None:
        self.faces = np.ascontiguousarray(faces, dtype=np.int64)
        order = halved(centroids)
        place = np.argsort(order)
        leaves = -(-len(order) // LANES)
        order = np.append(order, np.repeat(order[-1], LANES * leaves - len(order)))
        # Corners by ascending vertex: faces then agree to the bit about a side or a corner that they share.
        ascending = np.argsort(self.faces[order], axis=1, kind="stable")
        vertices = np.take_along_axis(self.faces[order], ascending, axis=1)
        kind, blocks = centroids.dtype, -(-leaves // LANES)
        self._mesh = Mesh(
            order, vertices, _each_once(vertices.reshape(leaves, -1)), ascending, place,
            np.ascontiguousarray(centroids[order]), np.zeros((blocks, 6, LANES), np.float32),
            np.zeros(leaves, np.int64), np.zeros(leaves, np.int64), np.zeros((len(order), 3, 3), kind),
            np.zeros((9, LANES)), np.zeros((leaves, 5), np.float32),
            np.zeros((leaves, QUANTITIES * LANES), np.float32), np.zeros(1),
        )  # fmt: skip
        self._pose = Pose(0, np.empty((0, 3), kind), np.zeros(3))
        everywhere, none, masks = np.arange(leaves), np.zeros((1, 3), kind), np.full(blocks, 2**LANES - 1)
        masks[-1] >>= LANES * blocks - leaves
        self._everywhere = Listed(
            place, np.zeros(1, np.int64), np.full(1, blocks), np.arange(blocks), masks, everywhere, none,
            np.inf,
        )  # fmt: skip

    def refit(self, positions: np.ndarray) -> None:
        """Move the mesh to positions (B, 3) [m], which stay as they are until the next call."""
        positions = np.ascontiguousarray(positions, self._mesh.corners.dtype)
        origin = positions[len(positions) // 2].astype(np.float64)
        self._pose = Pose(self._pose.number + 1, positions, origin)
        self._mesh.size[0] = 0.0

    def listed(self, points: np.ndarray, region: float = np.inf) -> Listed:
        """Group samples at points (S, 3) [m], best at rest, and list the leaves that each group may meet.

        A sample meets only faces whose rest centroid lies no farther than `region` [m] from its point here;
        where there is none, all.
        """
        points = np.ascontiguousarray(points, self._mesh.corners.dtype)
        order, whole = halved(points), self._everywhere
        if region == np.inf:
            return whole._replace(order=order)
        count, blocks = -(-len(points) // LANES), len(whole.blocks)
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
        """Find the closest points of the mesh.

        Args:
            points: (S, 3) [m] samples.
            hints: (S,) faces to begin with, -1 for none. They change the cost and, but for `exact`, no
                answer.
            samples: as `listed` gives it for the samples; without, any face may be met.
            exact: [m] a sample farther away than this may get any point at most twice as far as the closest:
                a remembered face then often does, for a third of the cost.
        """
        points = np.ascontiguousarray(points, self._mesh.corners.dtype)
        faces = np.full(len(points), -1) if hints is None else np.array(hints, np.int64)
        barycentric, closest = np.empty((len(points), 3)), np.empty((len(points), 3))
        if samples is None:
            samples = self.listed(points)
        search(
            points, samples, self._everywhere, float(exact), self._mesh, self._pose, faces, barycentric,
            closest,
        )  # fmt: skip
        return Closest(faces, barycentric, closest)


def _each_once(vertices: np.ndarray) -> np.ndarray:
    """Return the different numbers of each row (L, n), filled up with the least to the longest of them."""
    rows = np.sort(vertices, axis=1)
    again = rows[:, 1:] == rows[:, :-1]
    rows[:, 1:][again] = np.broadcast_to(rows[:, :1], again.shape)[again]
    return np.ascontiguousarray(np.sort(rows, axis=1)[:, again.sum(axis=1).min() :])


def _boxes(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the low and high corners (n, 3) of the boxes of points, LANES after LANES."""
    starts = np.arange(0, len(points), LANES)
    low, high = (ends.reduceat(points, starts, axis=0) for ends in (np.minimum, np.maximum))
    return low, high


def halved(points: np.ndarray) -> np.ndarray:
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
