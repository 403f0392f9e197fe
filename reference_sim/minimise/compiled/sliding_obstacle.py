"""An obstacle whose contact planes follow their samples over the surface, and are searched in rotation.

From frame to frame the closest point of a sample moves little. So it slides (surface_walk) from where it was
to the foot of its sample, which finds it wherever the surface is one smooth sheet. What sliding cannot find
is another limb that came near. Against that, in each frame:

- one group of neighbouring samples in ROTATION is searched exactly, another one each time;
- a sample tries its neighbours' faces where its own is too far: distances of two samples to one surface
  differ by no more than the samples are apart;
- a sample whose place is farther away than the step's reach looks for another surface within that reach;
- a sample deeper than DEEP below its plane is searched exactly: that is where a false plane costs most.

What the rotation finds reaches its neighbours by the second rule in the same frame. A plane is therefore that
of a place near the closest point, not always of the closest. The exact search (obstacle.Obstacle) is the
oracle in tests/reference_sim/minimise/test_compiled.py.
"""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from reference_sim.contact.anchor_walk import triangle_adjacency
from reference_sim.contact.closest_point import FaceTree, by_cells
from reference_sim.contact.closest_point_groups import GROUP_SIZE
from reference_sim.geometry.surface import carry, plane_normals, vertex_normals
from reference_sim.minimise.compiled.sliding import ask_neighbours, gaps_of, not_outside, slide
from reference_sim.obstacle import Obstacle, Planes, reachable_faces

ROTATION = 16
DEEP = 2e-3  # [m] below the plane
NEIGHBOURS = 4


class SlidingObstacle(Obstacle):
    """The same body and the same rule of regions as `obstacle`, with remembered places in between.

    A bounded one: see Obstacle.planes. Its answers depend on what it was asked before. Frames are asked for
    in order; after a jump, and for the first time, everything is searched.
    """

    bounded = True

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
        """Return vertices and normals at a frame, with the tree fitted to it."""
        if self._posed is None or self._posed[0] != frame:
            assert self._patch is not None
            vertices = self._patch.posed(self.at(frame))
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

    def planes(
        self,
        points: np.ndarray,
        frame: int,
        rest_points: np.ndarray | None = None,
        reach: np.ndarray | None = None,
    ) -> Planes:
        """Return planes as the exact obstacle does; without `reach` the rotation alone finds other limbs."""
        frame = min(frame, self.frames - 1)
        anchors = self._anchors(points, rest_points)
        assert self._patch is not None
        vertices, of_vertices = self._pose(frame)
        anchors.follow(points, frame, self._patch, vertices, self.region, reach)
        normals, patch = np.empty_like(points), self._patch

        def set_normals(at: np.ndarray | slice) -> None:
            some = np.empty_like(normals[at])
            plane_normals(
                points[at], anchors.closest[at], anchors.faces[at], anchors.barycentric[at], vertices,
                patch.faces, of_vertices, some,
            )  # fmt: skip
            normals[at] = some

        set_normals(slice(None))
        deep = np.flatnonzero(gaps_of(points, anchors.closest, normals) < -DEEP)
        if len(deep):
            anchors.search(deep, points, self._patch, self.region)
            set_normals(deep)
        anchors.frame = frame
        faces = self._patch.numbers[anchors.faces]
        far = None if reach is None else anchors.distance > reach
        return Planes(anchors.closest.copy(), normals, faces, anchors.barycentric.copy(), far)

    def transported(
        self, points: np.ndarray, frame: int, rest_points: np.ndarray | None = None
    ) -> np.ndarray:
        """Carry points along as the exact obstacle does.

        Points that are the first of a larger set of samples ride with the places of those, where they were
        when planes were last asked for.
        """
        before, after = (min(f, self.frames - 1) for f in (frame - 1, frame))
        anchors = self._anchors(points, rest_points)
        assert self._patch is not None
        vertices, _ = self._pose(before)
        leader = next((a for a in self._kinds.values() if a.frame == before and a.leads(anchors)), None)
        if leader is None:
            leader = anchors
            anchors.follow(points, before, self._patch, vertices, self.region)
            anchors.frame = after
        out = np.empty_like(points)
        carry(
            points, leader.closest, leader.faces, leader.barycentric, vertices,
            self._patch.posed(self.at(after)), self._patch.faces, out,
        )  # fmt: skip
        return out


class _Patch:
    """Faces that some sample may meet, and a tree of them."""

    def __init__(self, obstacle: Obstacle, rest_points: np.ndarray | None) -> None:
        centroids = obstacle.rest_centroids
        if centroids is None:
            centroids = obstacle.at(0)[obstacle.faces].mean(axis=1)
        self.numbers = np.arange(len(obstacle.faces))
        if rest_points is not None:
            self.numbers = reachable_faces(rest_points, centroids, obstacle.region)
        self.vertices, faces = np.unique(obstacle.faces[self.numbers], return_inverse=True)
        self.faces = np.ascontiguousarray(faces.reshape(-1, 3))
        self.centroids = np.ascontiguousarray(centroids[self.numbers])
        self.adjacency = triangle_adjacency(self.faces)
        self.tree = FaceTree(self.faces, self.centroids)

    def posed(self, positions: np.ndarray) -> np.ndarray:
        """Return its own vertices among those of the body (B, 3)."""
        return positions[self.vertices]


class _Anchors:
    """Place of each of S samples on the patch."""

    def __init__(self, home: np.ndarray, rest_points: np.ndarray | None) -> None:
        count = len(home)
        self.rest_points = rest_points
        self.home = np.ascontiguousarray(home)
        near = cKDTree(home).query(home, k=min(NEIGHBOURS + 1, count))[1].reshape(count, -1)
        self.neighbours = np.ascontiguousarray(near[:, 1:])
        self._order = by_cells(home)
        self._led: dict[int, bool] = {}
        self._home: np.ndarray | None = None
        self.barycentric, self.closest = np.zeros((count, 3)), np.zeros((count, 3))
        self.distance = np.zeros(count)
        self.forget()

    def leads(self, other: _Anchors) -> bool:
        """Return whether the other's samples are the first of these."""
        if id(other) not in self._led:
            first = self.home[: len(other.home)]
            self._led[id(other)] = other is not self and np.array_equal(first, other.home)
        return self._led[id(other)]

    def _home_faces(self, patch: _Patch) -> np.ndarray:
        """Return the face (S,) whose rest centroid is nearest to each sample at rest."""
        if self._home is None:
            self._home = cKDTree(patch.centroids).query(self.home)[1]
        return self._home

    def forget(self) -> None:
        self.faces = np.full(len(self.home), -1)
        self.frame = -9  # that the places belong to
        self.turn = 0

    def follow(
        self,
        points: np.ndarray,
        frame: int,
        patch: _Patch,
        vertices: np.ndarray,
        region: float,
        reach: np.ndarray | None = None,
    ) -> None:
        """Take the places to the samples' at points (S, 3) [m], the body's vertices (B, 3) at `frame`.

        reach: (S,) [m] within which no surface is missed by a sample whose own place is farther away.
        """
        if frame not in (self.frame, self.frame + 1):
            self.search(self._order, points, patch, region)
            return
        limit = np.inf if self.rest_points is None else region * region
        state = self.faces, self.barycentric, self.closest, self.distance
        skin = vertices, patch.faces, patch.adjacency, patch.centroids
        slide(points, self.turn, *skin, self.home, limit, *state)
        near = self._order
        if reach is not None:
            away = (self.distance > reach)[self._order]
            near = self._order[~away]
            self.search(self._order[away], points, patch, region, reach)
            if self.rest_points is not None:  # what is deep is not far
                out = np.where(self.distance > reach, -1, self.faces)
                deep = not_outside(out, points, self._home_faces(patch), vertices, patch.faces)
                self.search(deep, points, patch, region)
        groups = np.arange(-(-len(near) // GROUP_SIZE))[self.turn :: ROTATION]
        which = (GROUP_SIZE * groups[:, None] + np.arange(GROUP_SIZE)).ravel()
        self.search(near[which[which < len(near)]], points, patch, region)
        self.turn = (self.turn + 1) % ROTATION
        ask_neighbours(points, self.neighbours, *skin, self.home, limit, *state)

    def search(
        self,
        which: np.ndarray,
        points: np.ndarray,
        patch: _Patch,
        region: float,
        reach: np.ndarray | None = None,
    ) -> None:
        """Search the closest points of some samples exactly.

        With a reach (S,) [m], only samples that have one within it get another place.
        """
        if not len(which):
            return
        rest = None if self.rest_points is None else self.rest_points[which]
        hints: Any = self.faces[which]
        nearest = patch.tree.nearest(
            points[which],
            hints=None if (hints < 0).any() else hints,
            rest_points=rest,
            region=region,
            reach=None if reach is None else reach[which],
            sequence=np.arange(len(which)),
        )
        known = nearest.faces >= 0
        which = which[known]
        self.faces[which] = nearest.faces[known]
        self.barycentric[which], self.closest[which] = nearest.barycentric[known], nearest.points[known]
        self.distance[which] = np.linalg.norm(points[which] - self.closest[which], axis=1)
