"""Pairs of a cloth with itself, and with a body beside it, that are close together or about to meet.

The geometry is that of the package ipctk (IPC Toolkit, MIT licence): broad phase, closest pairs, continuous
collision detection, intersection test. What is kept here saves time between its calls: only those faces of
the obstacle take part that come within the distance of a box around the cloth, and candidate pairs serve as
long as nothing has moved further than they were searched for.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import ModuleType
from typing import Any

import numpy as np

from reference_sim.cloth import Cloth

BOX_MARGIN = 0.05  # [m] between the cloth and the sides of the box
LONGEST_STEP = 0.05  # [m] of a vertex in a line search: a step of a metre would meet nearly every pair
NO_OBSTACLE = (np.zeros((0, 3), dtype=np.int64), np.zeros((0, 3)), np.zeros((0, 3)))


@dataclass(frozen=True)
class NearMesh:
    """Mesh of ipctk: the vertices of the cloth, then those of the obstacle that are near.

    Attributes:
        mesh: ipctk.CollisionMesh.
        vertices: of the obstacle that it holds.
        faces: of the obstacle that it holds.
        low: corner of its box [m].
        high: the other corner [m].
    """

    mesh: Any
    vertices: np.ndarray
    faces: np.ndarray
    low: np.ndarray
    high: np.ndarray

    def stack(self, x: np.ndarray, obstacle: np.ndarray) -> np.ndarray:
        """Return the positions of the mesh in the memory order that ipctk reads."""
        return np.asfortranarray(np.concatenate([x, obstacle[self.vertices]]))

    def holds(self, x: np.ndarray) -> bool:
        """Return whether positions x (V, 3) [m] lie in the box, which has no sides where no obstacle is."""
        return self.low[0] == -np.inf or bool((x >= self.low).all() and (x <= self.high).all())


class Collisions:
    """Pairs of a cloth with itself and with an obstacle that moves through one step.

    Args:
        cloth: its faces and rest areas.
        distance: pairs closer than this are wanted [m].
        self_contact: whether the cloth meets itself.

    Attributes:
        package: the module ipctk.

    Raises:
        ImportError: ipctk is not installed.
    """

    def __init__(self, cloth: Cloth, distance: float, *, self_contact: bool = True) -> None:
        self.package = _load()
        self.cloth, self.distance, self.self_contact = cloth, float(distance), self_contact
        self._slack = self.distance / 4  # how far vertices may move before candidates are searched again
        self._ccd = self.package.AdditiveCCD()
        self._obstacle_faces = NO_OBSTACLE[0]
        self._near: NearMesh | None = None
        self.begin(*NO_OBSTACLE)

    def begin(self, faces: np.ndarray, before: np.ndarray, after: np.ndarray) -> None:
        """Begin a step in which an obstacle (faces (Fb, 3)) moves from before to after (B, 3) [m].

        It is put at the end. Nothing is kept from the step before but the mesh of a cloth alone, so that sums
        over pairs have one order, whatever was asked earlier.
        """
        if len(faces) or len(self._obstacle_faces):
            self._near = None
        self._obstacle_faces, self._before, self._after = faces, before, after
        self.place(1.0)

    def place(self, progress: float) -> None:
        """Put the obstacle at `progress` (0 to 1) of its way."""
        self.progress = progress
        self._forget()

    def obstacle_at(self, progress: float) -> np.ndarray:
        """Return the obstacle (B, 3) [m] at `progress` (0 to 1) of its way."""
        if progress == 1.0:
            return self._after
        return self._before + progress * (self._after - self._before)

    def _forget(self) -> None:
        self._way: tuple[np.ndarray, np.ndarray] | None = None  # what the candidates were searched for
        self._at: np.ndarray | None = None  # where the pairs were found

    def mesh_around(self, *positions: np.ndarray) -> NearMesh:
        """Return the mesh whose box holds all these positions (V, 3) [m]; the last one if it does."""
        if self._near is None or not all(map(self._near.holds, positions)):
            stacked = np.concatenate(positions)
            margin = BOX_MARGIN if len(self._obstacle_faces) else np.inf
            self._near = self._build(stacked.min(axis=0) - margin, stacked.max(axis=0) + margin)
            self._forget()
        return self._near

    def _build(self, low: np.ndarray, high: np.ndarray) -> NearMesh:
        cloth, ipctk = self.cloth, self.package
        faces = self._obstacle_faces
        corners = np.concatenate([self._before[faces], self._after[faces]], axis=1)
        # A line search may end at a side of the box, so faces that are close behind it belong to the mesh.
        reach = self.distance + self._slack
        near = ((corners.max(axis=1) >= low - reach) & (corners.min(axis=1) <= high + reach)).all(axis=1)
        kept, local = np.unique(faces[near], return_inverse=True)
        count = cloth.vertex_count
        rest = np.asfortranarray(np.concatenate([cloth.rest_positions, self._before[kept]]))
        triangles = np.concatenate([cloth.faces, local.reshape(-1, 3) + count])
        triangles = np.asfortranarray(triangles, dtype=np.int32)
        mesh = ipctk.CollisionMesh(rest, ipctk.edges(triangles), triangles)
        _give_areas(mesh, cloth)
        mesh.can_collide = (
            ipctk.make_static_obstacle_filter(count)
            if self.self_contact
            else ipctk.make_vertex_patches_filter((np.arange(len(rest)) >= count).astype(np.int32))
        )
        return NearMesh(mesh, kept, np.flatnonzero(near), low, high)

    def _candidates(self, a: np.ndarray, b: np.ndarray) -> Any:
        """Return pairs that may come within the distance near the way from a to b, within the slack."""
        near = self.mesh_around(a, b)
        if not (self._covers(a) and (b is a or self._covers(b))):
            obstacle = self.obstacle_at(self.progress)
            start, end = near.stack(a, obstacle), near.stack(b, obstacle)
            candidates = self.package.Candidates()
            candidates.build(near.mesh, start, end, self.distance / 2 + self._slack)
            self._candidate_pairs, self._way = candidates, (a.copy(), b.copy())
        return self._candidate_pairs

    def _covers(self, x: np.ndarray) -> bool:
        if self._way is None:
            return False
        a, b = self._way
        way, off = b - a, x - a
        if way.any():
            t = np.einsum("vi,vi->v", off, way) / np.maximum(np.einsum("vi,vi->v", way, way), 1e-300)
            off -= np.clip(t, 0.0, 1.0)[:, None] * way
        return bool(np.einsum("vi,vi->v", off, off).max() <= self._slack**2)

    def pairs(self, x: np.ndarray) -> tuple[Any, NearMesh, np.ndarray]:
        """Return the pairs closer than the distance at x (V, 3): ipctk's, their mesh, its positions."""
        if self._at is None or not np.array_equal(self._at, x):
            candidates = self._candidates(x, x)
            near = self.mesh_around(x)
            positions = near.stack(x, self.obstacle_at(self.progress))
            pairs = self.package.NormalCollisions()
            pairs.use_area_weighting = True
            pairs.build(candidates, near.mesh, positions, self.distance)
            self._pairs, self._at = (pairs, near, positions), x.copy()
        return self._pairs

    def largest_step(self, x: np.ndarray, direction: np.ndarray) -> float:
        """Return the share of `direction` (V, 3) [m] that the cloth may go while the obstacle stands."""
        pairs, near, positions = self.pairs(x)
        gap = min(self.distance, pairs.compute_minimum_distance(near.mesh, positions) ** 0.5)
        farthest = float(np.sqrt(np.einsum("vi,vi->v", direction, direction).max()))
        if 2 * farthest < gap:
            return 1.0  # nothing is close enough to be reached
        part = min(1.0, LONGEST_STEP / farthest)
        goal = x + part * direction
        candidates = self._candidates(x, goal)
        near, obstacle = self.mesh_around(x, goal), self.obstacle_at(self.progress)
        return part * candidates.compute_collision_free_stepsize(
            near.mesh, near.stack(x, obstacle), near.stack(goal, obstacle), 0.0, self._ccd
        )

    def ccd_fraction(self, x: np.ndarray, goal: np.ndarray, progress: float) -> float:
        """Return the free share of the way from x to goal (V, 3), the obstacle going on too.

        progress: (0 to 1) of the obstacle's way, where it begins.
        """
        near = self.mesh_around(x, goal)
        start, end = near.stack(x, self.obstacle_at(progress)), near.stack(goal, self._after)
        candidates = self.package.Candidates()
        candidates.build(near.mesh, start, end, 0.0)
        return candidates.compute_collision_free_stepsize(near.mesh, start, end, 0.0, self._ccd)

    def first_intersection(self, x: np.ndarray) -> str:
        """Return an edge and a face that cut each other at x (V, 3), in words; "" if there are none."""
        near = self.mesh_around(x)
        positions = near.stack(x, self.obstacle_at(self.progress))
        mesh, ipctk = near.mesh, self.package
        if not ipctk.has_intersections(mesh, positions):
            return ""
        search = ipctk.LBVH()
        search.can_vertices_collide = mesh.can_collide
        search.build(positions, mesh.edges, mesh.faces, 1e-6 * float(np.ptp(positions, axis=0).max()))
        for pair in search.detect_edge_face_candidates():
            edge, face = mesh.edges[pair.edge_id], mesh.faces[pair.face_id]
            if ipctk.is_edge_intersecting_triangle(*positions[edge], *positions[face]):
                return f"{self._edge_name(edge, near)} cuts {self._face_name(pair.face_id, near)}"
        return "an edge cuts a face"

    def _edge_name(self, edge: np.ndarray, near: NearMesh) -> str:
        count = self.cloth.vertex_count
        of_cloth = bool((edge < count).all())
        first, second = np.sort(edge if of_cloth else near.vertices[edge - count])
        return f"edge ({first}, {second}) of the {'cloth' if of_cloth else 'body'}"

    def _face_name(self, face: int, near: NearMesh) -> str:
        count = len(self.cloth.faces)
        return f"face {face} of the cloth" if face < count else f"face {near.faces[face - count]} of the body"


def _give_areas(mesh: Any, cloth: Cloth) -> None:
    """Set the areas that weigh the pairs: of the cloth those at rest, perhaps from its uv.

    Those of the obstacle are cut off at the cloth's mean: an edge across a floor would otherwise push every
    thread above it with the area of the floor.
    """
    vertices, edges = mesh.vertex_areas.copy(), mesh.edge_areas.copy()
    vertices[: cloth.vertex_count] = cloth.vertex_areas
    vertices[cloth.vertex_count :] = np.minimum(vertices[cloth.vertex_count :], cloth.vertex_areas.mean())
    sides = mesh.faces_to_edges[: len(cloth.faces)].ravel()
    cloth_areas = np.bincount(sides, np.repeat(cloth.areas / 3, 3), len(edges))
    mean = cloth_areas[np.unique(sides)].mean()
    mesh.vertex_areas, mesh.edge_areas = (
        vertices,
        np.where(cloth_areas > 0, cloth_areas, np.minimum(edges, mean)),
    )


def _load() -> ModuleType:
    try:
        import ipctk
    except ImportError:
        raise ImportError("a contact barrier needs the package ipctk: pip install ipctk") from None
    ipctk.set_logger_level(ipctk.error)  # its warnings go to standard output
    ipctk.set_num_threads(1)  # sums of several threads differ in the last digit from run to run
    return ipctk
