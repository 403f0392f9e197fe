"""Closest points of a moving triangle mesh: a tree of boxes, built once and refitted to every frame.

In one pose the faces are halved again and again along the longest side of the box of their centroids. All
leaves lie equally deep, so node i has the children 2 i + 1 and 2 i + 2. A new frame only moves the boxes. A
search begins with the face that its caller remembers from before: any face is an upper bound, and a good one
leaves little to visit.

A sample may be restricted to the faces near its own place at rest. Nodes hold boxes of the faces' rest
centroids too, so that what is out of reach is left out by whole subtrees.

An answer depends on mesh and point alone, never on what was remembered: of faces at the same distance the one
of lowest index answers, and a box is left out only if it is farther by more than round-off. Arithmetic is in
float64 even where the mesh is kept in float32.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from reference_sim.contact.closest_point_groups import search
from reference_sim.geometry.triangle import SLIVER
from reference_sim.kernels.kernel_cache import njit

LEAF_SIZE = 16  # faces in a leaf, at most
CELL_HALVINGS = 6  # of the longest side, for samples that nothing is remembered of


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


class FaceTree:
    """Tree of boxes over the faces of a mesh whose vertices move. Refit it before the first search.

    Args:
        faces: (F, 3), at least one.
        centroids: (F, 3) [m], their centroids at rest, in a pose that spreads the mesh: by them the tree is
            built and the rule of regions decides. Positions are kept in their type, float64 or float32.
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
        self._discs = np.empty((len(faces), 7))  # centre, radius and normal of the flat disc around each face

    def refit(self, positions: np.ndarray) -> None:
        """Move the mesh to positions (B, 3) [m]."""
        positions = np.ascontiguousarray(positions, self._corners.dtype)
        _gather(positions, self._vertices, self._corners, self._discs)
        _enclose(self._corners, self._starts, self._boxes)

    def nearest(
        self,
        points: np.ndarray,
        *,
        hints: np.ndarray | None = None,
        rest_points: np.ndarray | None = None,
        region: float = np.inf,
        exact: float = np.inf,
        reach: np.ndarray | None = None,
        sequence: np.ndarray | None = None,
    ) -> Closest:
        """Find the closest points of the mesh.

        Args:
            points: (S, 3) [m] samples.
            hints: (S,) faces to begin with, -1 for none. They change the cost and, but for `exact`, no
                answer.
            rest_points: (S, 3) [m] where samples are at rest. With them, a sample meets only faces whose rest
                centroid lies no farther away than `region`; where there is none, all.
            region: [m].
            exact: [m] a sample farther away than this may get any point at most twice as far as the closest:
                a remembered face then often does, for a third of the cost.
            reach: (S,) [m] a sample farther away than this gets face -1, and its place and point mean
                nothing.
            sequence: (S,) order to search in, see `in_sequence`. It changes the cost and no answer.
        """
        if rest_points is None:
            rest_points, region = points, np.inf
        points, rest_points = (np.ascontiguousarray(x, self._corners.dtype) for x in (points, rest_points))
        faces = np.full(len(points), -1) if hints is None else np.array(hints, np.int64)
        if sequence is None:
            sequence = by_cells(points) if hints is None else self.in_sequence(faces)
        reach = np.full(len(points), np.inf) if reach is None else np.ascontiguousarray(reach, np.float64)
        barycentric, closest = np.empty((len(points), 3)), np.empty((len(points), 3))
        search(
            points, rest_points, float(region), float(exact), reach, self._corners, self._discs,
            self._centroids, self._boxes, self._rest_boxes, self._starts, self._order, self._place,
            self._ascending, sequence, faces, barycentric, closest,
        )  # fmt: skip
        return Closest(faces, barycentric, closest)

    def in_sequence(self, faces: np.ndarray) -> np.ndarray:
        """Order samples near these faces (S,) so that neighbours come one after another.

        They visit the same boxes, and do so together.
        """
        return np.argsort(self._place[faces])


def _halved(centroids: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return faces in the order of the leaves (F,), and where each of L leaves begins, (L + 1,) with end."""
    count = len(centroids)
    order, starts = np.arange(count), np.array([0, count])
    while np.diff(starts).max() > LEAF_SIZE:
        x = centroids[order]
        block = np.repeat(np.arange(len(starts) - 1), np.diff(starts))
        low, high = (ends.reduceat(x, starts[:-1], axis=0) for ends in (np.minimum, np.maximum))
        along = x[np.arange(count), (high - low).argmax(axis=1)[block]]
        order = order[np.lexsort((along, block))]
        middles = (starts[:-1] + starts[1:]) // 2
        starts = np.append(np.stack([starts[:-1], middles], axis=1).ravel(), count)
    return order, starts


def by_cells(points: np.ndarray) -> np.ndarray:
    """Order points (S, 3) by the cells of a grid, halved again and again like the faces; returns (S,)."""
    if len(points) == 0:
        return np.empty(0, np.int64)
    side = max(float(np.ptp(points, axis=0).max()), 1e-30)
    with np.errstate(invalid="ignore"):  # whoever asks for NaN gets some face
        cells = ((points - points.min(axis=0)) / side * (2**CELL_HALVINGS - 1)).astype(np.int64)
    bits, axes = np.arange(CELL_HALVINGS), np.arange(3)[:, None]
    return np.argsort((((cells[:, :, None] >> bits) & 1) << (3 * bits + axes)).sum(axis=(1, 2)))


@njit(cache=True)
def _gather(positions, vertices, corners, discs):
    s, t, n = np.empty(3), np.empty(3), np.empty(3)
    for place in range(len(vertices)):
        for i in range(3):
            centre = 0.0
            for a in range(3):
                corners[place, a, i] = positions[vertices[place, a], i]
                centre += corners[place, a, i]
            discs[place, i] = centre / 3.0
            s[i] = np.float64(corners[place, 1, i]) - corners[place, 0, i]
            t[i] = np.float64(corners[place, 2, i]) - corners[place, 0, i]
        largest = ss = tt = nn = 0.0
        for a in range(3):
            squared = 0.0
            for i in range(3):
                squared += (corners[place, a, i] - discs[place, i]) ** 2
            largest = max(largest, squared)
        discs[place, 3] = np.sqrt(largest)
        for i in range(3):
            n[i] = s[(i + 1) % 3] * t[(i + 2) % 3] - s[(i + 2) % 3] * t[(i + 1) % 3]
            ss, tt, nn = ss + s[i] * s[i], tt + t[i] * t[i], nn + n[i] * n[i]
        # The normal of a sliver is round-off: without one, its disc is a ball.
        scale = 1.0 / np.sqrt(nn) if nn > SLIVER * ss * tt else 0.0
        for i in range(3):
            discs[place, 4 + i] = scale * n[i]


@njit(cache=True)
def _enclose(points, starts, boxes):
    """Write boxes (N, 2, 3) of points (F, K, 3) in the order of the leaves: leaves, then up to the root."""
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
