"""An obstacle whose contact planes follow their samples over the surface, and are searched in rotation.

From frame to frame the closest point of a sample moves little. So it slides (surface_walk) from where it was
to the foot of its sample, which finds it wherever the surface is one smooth sheet. What sliding cannot find is
another limb that came near. Against that, in each frame:

- one sample in ROTATION is searched exactly, another one each time;
- a sample tries its neighbours' faces where its own is too far: distances of two samples to one surface differ
  by no more than the samples are apart;
- a sample deeper than DEEP below its plane is searched exactly: that is where a false plane costs most.

What the rotation finds reaches its neighbours by the second rule in the same frame. A plane is therefore that
of a place near the closest point, not always of the closest. The exact search (obstacle.Obstacle) is the
oracle; tests/test_compiled.py states how far they differ over hard motions.
"""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from ..closest_point import FaceTree
from ..kernel_cache import njit
from ..obstacle import Obstacle, Planes, _plane_normals, vertex_normals
from ..surface_walk import triangle_adjacency, walk_to_foot

ROTATION = 16
DEEP = 2e-3  # [m] below the plane
SLACK = 1e-4  # [m] by which a neighbour's distance must be the better one to be tried
NEIGHBOURS = 4
SWEEPS = 2  # of the trying of neighbours: what was found spreads by so many samples


class SlidingObstacle(Obstacle):
    """The same body and the same rule of regions as `obstacle`, with remembered places in between.

    Its answers depend on what it was asked before. Frames are asked for in order; after a jump, and for the
    first time, everything is searched.
    """

    def __init__(self, obstacle: Obstacle) -> None:
        self.__dict__.update(copy.copy(obstacle).__dict__)
        self._forget()

    def _forget(self) -> None:
        super()._forget()
        self._kinds: dict[tuple[int, bool], _Anchors] = {}
        self._patch: _Patch | None = None
        self._posed: tuple[int, np.ndarray, np.ndarray] | None = None  # frame, vertices, their normals

    def start_again(self) -> None:
        """Forget all places, as before a first frame."""
        for anchors in self._kinds.values():
            anchors.forget()

    def _pose(self, frame: int) -> tuple[np.ndarray, np.ndarray]:
        """Vertices and normals at a frame, with the tree fitted to it."""
        if self._posed is None or self._posed[0] != frame:
            assert self._patch is not None
            vertices = self.at(frame)
            self._patch.tree.refit(vertices)
            self._posed = frame, vertices, vertex_normals(vertices, self._patch.faces)
        return self._posed[1:]

    def _anchors(self, points: np.ndarray, rest_points: np.ndarray | None) -> _Anchors:
        if self.rest_centroids is None:
            rest_points = None
        kind = len(points), rest_points is not None
        if kind not in self._kinds:
            if self._patch is None:
                self._patch = _Patch(self, rest_points)
            self._kinds[kind] = _Anchors(points if rest_points is None else rest_points, rest_points)
        return self._kinds[kind]

    def planes(self, points: np.ndarray, frame: int, rest_points: np.ndarray | None = None) -> Planes:
        frame = min(frame, self.frames - 1)
        anchors = self._anchors(points, rest_points)
        assert self._patch is not None
        vertices, of_vertices = self._pose(frame)
        anchors.follow(points, frame, self._patch, vertices, self.region)
        normals = np.empty_like(points)

        def set_normals(at: np.ndarray | slice) -> None:
            some = np.empty_like(normals[at])
            _plane_normals(
                points[at], anchors.closest[at], anchors.faces[at], anchors.barycentric[at], vertices,
                self._patch.faces, of_vertices, some,
            )  # fmt: skip
            normals[at] = some

        set_normals(slice(None))
        deep = np.flatnonzero(_gaps(points, anchors.closest, normals) < -DEEP)
        if len(deep):
            anchors.search(deep, points, self._patch, self.region)
            set_normals(deep)
        anchors.frame = frame
        faces = self._patch.numbers[anchors.faces]
        return Planes(anchors.closest.copy(), normals, faces, anchors.barycentric.copy())

    def transported(
        self, points: np.ndarray, frame: int, rest_points: np.ndarray | None = None
    ) -> np.ndarray:
        before, after = (min(f, self.frames - 1) for f in (frame - 1, frame))
        anchors = self._anchors(points, rest_points)
        assert self._patch is not None
        vertices, _ = self._pose(before)
        anchors.follow(points, before, self._patch, vertices, self.region)
        anchors.frame = after
        out = np.empty_like(points)
        _carry(
            points, anchors.closest, anchors.faces, anchors.barycentric, self._patch.faces, vertices,
            self.at(after), out,
        )  # fmt: skip
        return out


class _Patch:
    """The faces that some sample may meet, and a tree of them."""

    def __init__(self, obstacle: Obstacle, rest_points: np.ndarray | None) -> None:
        centroids = obstacle.rest_centroids
        if centroids is None:
            centroids = obstacle.at(0)[obstacle.faces].mean(axis=1)
        self.numbers = np.arange(len(obstacle.faces))
        if rest_points is not None:
            near = cKDTree(rest_points).query(centroids, distance_upper_bound=obstacle.region)[0]
            alone = cKDTree(centroids).query(rest_points)[0].max() > obstacle.region
            if not alone:  # a sample without a face in its region meets all
                self.numbers = np.flatnonzero(np.isfinite(near))
        self.faces = np.ascontiguousarray(obstacle.faces[self.numbers])
        self.centroids = np.ascontiguousarray(centroids[self.numbers])
        self.adjacency = triangle_adjacency(self.faces)
        self.tree = FaceTree(self.faces, self.centroids)


class _Anchors:
    """The place of each of S samples on the patch."""

    def __init__(self, home: np.ndarray, rest_points: np.ndarray | None) -> None:
        count = len(home)
        self.rest_points = rest_points
        self.home = np.ascontiguousarray(home)
        near = cKDTree(home).query(home, k=min(NEIGHBOURS + 1, count))[1].reshape(count, -1)
        self.neighbours = np.ascontiguousarray(near[:, 1:])
        self.barycentric, self.closest = np.zeros((count, 3)), np.zeros((count, 3))
        self.distance = np.zeros(count)
        self.forget()

    def forget(self) -> None:
        self.faces = np.full(len(self.home), -1)
        self.frame = -9  # that the places belong to
        self.turn = 0

    def follow(
        self, points: np.ndarray, frame: int, patch: _Patch, vertices: np.ndarray, region: float
    ) -> None:
        """Take the places to the samples' at points (S, 3) [m], the body's vertices (B, 3) at `frame`."""
        if frame not in (self.frame, self.frame + 1):
            self.search(np.arange(len(points)), points, patch, region)
            return
        reach = np.inf if self.rest_points is None else region * region
        state = self.faces, self.barycentric, self.closest, self.distance
        skin = vertices, patch.faces, patch.adjacency, patch.centroids
        _slide(points, *skin, self.home, reach, *state)
        self.search(np.arange(self.turn, len(points), ROTATION), points, patch, region)
        self.turn = (self.turn + 1) % ROTATION
        _ask_neighbours(points, self.neighbours, *skin, self.home, reach, *state)

    def search(self, which: np.ndarray, points: np.ndarray, patch: _Patch, region: float) -> None:
        """Exact closest points for some samples."""
        rest = None if self.rest_points is None else self.rest_points[which]
        hints: Any = self.faces[which]
        found = patch.tree.nearest(
            points[which], hints=None if (hints < 0).any() else hints, rest_points=rest, region=region
        )
        self.faces[which] = found.faces
        self.barycentric[which], self.closest[which] = found.barycentric, found.points
        self.distance[which] = np.linalg.norm(points[which] - found.points, axis=1)


@njit(cache=True, inline="always")
def _set(s, points, face, v, w, vertices, faces, barycentric, closest):
    """Put the place of sample s on a face; returns its distance."""
    u, squared = 1.0 - v - w, 0.0  # weights are rounded to float32, their sum is not
    barycentric[s, 0], barycentric[s, 1], barycentric[s, 2] = u, v, w
    i, j, k = faces[face, 0], faces[face, 1], faces[face, 2]
    for c in range(3):
        closest[s, c] = u * vertices[i, c] + v * vertices[j, c] + w * vertices[k, c]
        squared += (points[s, c] - closest[s, c]) ** 2
    return np.sqrt(squared)


@njit(cache=True, error_model="numpy")
def _slide(
    points, vertices, faces, adjacency, centroids, home, reach, anchors, barycentric, closest, distance
):
    corners = np.empty((1, 3, 3))
    for s in range(len(points)):
        face, v, w = walk_to_foot(
            points[s, 0], points[s, 1], points[s, 2], np.uint32(anchors[s]), vertices, faces, adjacency,
            centroids, home[s], reach, corners,
        )  # fmt: skip
        anchors[s] = face
        distance[s] = _set(s, points, face, v, w, vertices, faces, barycentric, closest)


@njit(cache=True, error_model="numpy")
def _ask_neighbours(
    points, neighbours, vertices, faces, adjacency, centroids, home, reach, anchors, barycentric, closest,
    distance,
):  # fmt: skip
    """Let samples that are too far try the faces of their neighbours."""
    corners = np.empty((1, 3, 3))
    for _ in range(SWEEPS):
        for s in range(len(points)):
            for n in neighbours[s]:
                apart = 0.0
                for c in range(3):
                    apart += (points[s, c] - points[n, c]) ** 2
                if distance[s] <= distance[n] + np.sqrt(apart) + SLACK:
                    continue
                squared = 0.0
                for c in range(3):
                    squared += (centroids[anchors[n], c] - home[s, c]) ** 2
                if squared > reach:
                    continue
                face, v, w = walk_to_foot(
                    points[s, 0], points[s, 1], points[s, 2], np.uint32(anchors[n]), vertices, faces,
                    adjacency, centroids, home[s], reach, corners,
                )  # fmt: skip
                before = barycentric[s, 1], barycentric[s, 2]
                tried = _set(s, points, face, v, w, vertices, faces, barycentric, closest)
                if tried < distance[s]:
                    anchors[s], distance[s] = face, tried
                else:
                    _set(s, points, anchors[s], before[0], before[1], vertices, faces, barycentric, closest)


@njit(cache=True)
def _gaps(points, closest, normals):
    gaps = np.empty(len(points))
    for s in range(len(points)):
        gap = 0.0
        for c in range(3):
            gap += normals[s, c] * (points[s, c] - closest[s, c])
        gaps[s] = gap
    return gaps


@njit(cache=True, inline="always")
def _frame(x, i, j, k, axes):
    """Rows of axes (3, 3): orthonormal frame of a triangle."""
    first, second = 0.0, 0.0
    for c in range(3):
        axes[0, c] = x[j, c] - x[i, c]
        axes[1, c] = x[k, c] - x[i, c]
        first += axes[0, c] ** 2
    first = np.sqrt(first)
    for c in range(3):
        axes[0, c] /= first
    axes[2, 0] = axes[0, 1] * axes[1, 2] - axes[0, 2] * axes[1, 1]
    axes[2, 1] = axes[0, 2] * axes[1, 0] - axes[0, 0] * axes[1, 2]
    axes[2, 2] = axes[0, 0] * axes[1, 1] - axes[0, 1] * axes[1, 0]
    for c in range(3):
        second += axes[2, c] ** 2
    second = np.sqrt(second)
    for c in range(3):
        axes[2, c] /= second
    axes[1, 0] = axes[2, 1] * axes[0, 2] - axes[2, 2] * axes[0, 1]
    axes[1, 1] = axes[2, 2] * axes[0, 0] - axes[2, 0] * axes[0, 2]
    axes[1, 2] = axes[2, 0] * axes[0, 1] - axes[2, 1] * axes[0, 0]


@njit(cache=True, error_model="numpy")
def _carry(points, closest, anchors, barycentric, faces, before, after, out):
    """Where points go that keep their place in the frame of their face."""
    old, new = np.empty((3, 3)), np.empty((3, 3))
    for s in range(len(points)):
        i, j, k = faces[anchors[s], 0], faces[anchors[s], 1], faces[anchors[s], 2]
        _frame(before, i, j, k, old)
        _frame(after, i, j, k, new)
        for c in range(3):
            out[s, c] = (
                barycentric[s, 0] * after[i, c] + barycentric[s, 1] * after[j, c]
                + barycentric[s, 2] * after[k, c]
            )  # fmt: skip
        for a in range(3):
            local = 0.0
            for c in range(3):
                local += old[a, c] * (points[s, c] - closest[s, c])
            for c in range(3):
                out[s, c] += new[a, c] * local
