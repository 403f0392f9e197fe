"""A moving closed triangle mesh that cloth may touch: contact planes for a step, and true distances.

The simulator knows a body as nothing more than this.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass
from functools import cached_property

import igl
import numpy as np
from numba import njit
from scipy.spatial import cKDTree

from .closed_mesh import check_closed
from .cloth import MeshError
from .resume import fingerprint

DEFAULT_REGION = 0.20  # [m]


@dataclass(frozen=True)
class Planes:
    """One contact plane per sample: points (S, 3) [m], unit outward normals (S, 3), and where it was found.

    faces: (S,) face of the obstacle; barycentric: (S, 3) place on it.
    """

    points: np.ndarray
    normals: np.ndarray
    faces: np.ndarray
    barycentric: np.ndarray


class Obstacle:
    """A closed mesh that moves through T frames.

    Args:
        positions: (T, B, 3) [m], or (B, 3) for one that stands still.
        faces: (F, 3) outward wound.
        rest_positions: (B, 3) [m], the obstacle in the pose in which the cloth was made. With it, a cloth
            sample only ever meets faces whose rest centroid lies within `region` of the sample's own rest
            position (the whole mesh, where there is none): without that rule arms grab the shirt and legs
            catch the hem.
        region: radius of that rule [m].

    Raises:
        MeshError: wrong shapes, NaN, a mesh that is no closed surface (see `check_closed`).
    """

    def __init__(
        self,
        positions: np.ndarray,
        faces: np.ndarray,
        *,
        rest_positions: np.ndarray | None = None,
        region: float = DEFAULT_REGION,
    ) -> None:
        positions = np.asarray(positions, dtype=np.float64)
        self.positions = positions[None] if positions.ndim == 2 else positions
        self.faces = np.ascontiguousarray(faces, dtype=np.int64)
        check_closed(self.positions, self.faces)
        self.region = float(region)
        self.rest_centroids: np.ndarray | None = None
        if rest_positions is not None:
            rest = np.asarray(rest_positions, dtype=np.float64)
            if rest.shape != self.positions.shape[1:] or not np.isfinite(rest).all():
                raise MeshError(
                    f"obstacle rest_positions {rest.shape}: expected finite {self.positions.shape[1:]}"
                )
            self.rest_centroids = np.ascontiguousarray(rest[self.faces].mean(axis=1))
        self._substeps = 1
        self._forget()

    def _forget(self) -> None:
        self._seen: list[np.ndarray] = []  # rest points asked about so far, and
        self._reachable = np.arange(len(self.faces))  # the faces that any of them may meet
        self._trees: dict[bool, tuple[int, igl.AABB, np.ndarray, np.ndarray]] = {}

    @property
    def frames(self) -> int:
        return (len(self.positions) - 1) * self._substeps + 1

    def at(self, frame: int) -> np.ndarray:
        """Vertices (B, 3) at `frame`; the last frame holds on for ever."""
        whole, part = divmod(min(frame, self.frames - 1), self._substeps)
        if part == 0:
            return self.positions[whole]
        share = part / self._substeps
        return (1 - share) * self.positions[whole] + share * self.positions[whole + 1]

    def refined(self, substeps: int) -> Obstacle:
        """The same motion, linear in between, with `substeps` frames for each frame here."""
        fine = copy.copy(self)
        fine._substeps = self._substeps * substeps
        fine._forget()
        return fine

    @cached_property
    def fingerprint(self) -> str:
        """Hash of everything that decides how it touches."""
        return fingerprint(self.positions, self.faces, self.rest_centroids, np.array(self.region))

    def _closest(self, points: np.ndarray, frame: int, *, reachable: bool) -> tuple[np.ndarray, np.ndarray]:
        """Nearest face and point, on the whole mesh or on the reachable faces; the last tree is kept."""
        frame = min(frame, self.frames - 1)
        if reachable not in self._trees or self._trees[reachable][0] != frame:
            vertices = np.asfortranarray(self.at(frame))
            faces = self.faces[self._reachable] if reachable else self.faces
            tree = igl.AABB()
            tree.init(vertices, faces)
            self._trees[reachable] = (frame, tree, vertices, faces)
        _, tree, vertices, faces = self._trees[reachable]
        _, face, nearest = tree.squared_distance(vertices, faces, np.asfortranarray(points))
        face = np.asarray(face, dtype=np.int64).ravel()
        return self._reachable[face] if reachable else face, np.ascontiguousarray(nearest)

    def _reach(self, rest_points: np.ndarray) -> None:
        """Let the tree of reachable faces cover what these rest points may meet.

        Most of a body is head, hands and feet; leaving them out makes the tree several times smaller and
        changes no answer.
        """
        if any(rest_points is seen for seen in self._seen):
            return
        assert self.rest_centroids is not None
        self._seen.append(rest_points)
        gap, _ = cKDTree(np.concatenate(self._seen)).query(
            self.rest_centroids, distance_upper_bound=self.region
        )
        near = np.flatnonzero(np.isfinite(gap))
        self._reachable = near if near.size else np.arange(len(self.faces))
        self._trees.pop(True, None)

    def _nearest_allowed(
        self, points: np.ndarray, frame: int, rest_points: np.ndarray | None
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Face (S,), closest point (S, 3) and its barycentric place (S, 3), under the rule of regions."""
        vertices = self.at(frame)
        if self.rest_centroids is None or rest_points is None:
            face, nearest = self._closest(points, frame, reachable=False)
        else:
            self._reach(rest_points)
            face, nearest = self._closest(points, frame, reachable=True)
            offset = self.rest_centroids[face] - rest_points
            far = np.flatnonzero(np.einsum("si,si->s", offset, offset) > self.region**2)
            rest = (rest_points, self.rest_centroids, self.region)
            _closest_allowed(points, far, *rest, vertices, self.faces, face, nearest)
            lost = np.flatnonzero(face < 0)
            if lost.size:
                face[lost], nearest[lost] = self._closest(points[lost], frame, reachable=False)
        return face, nearest, _barycentric(nearest, vertices[self.faces[face]])

    def planes(self, points: np.ndarray, frame: int, rest_points: np.ndarray | None = None) -> Planes:
        """Contact planes at `frame` for samples at points (S, 3) with rest positions rest_points (S, 3).

        The plane goes through the closest allowed point of the surface; its normal points from there to the
        sample (from the sample, when that is inside), which makes n.(x - c) the signed distance at the
        sample's own position.
        """
        face, nearest, barycentric = self._nearest_allowed(points, frame, rest_points)
        smooth = np.einsum("sa,sai->si", barycentric, self._vertex_normals(frame)[self.faces[face]])
        smooth /= np.linalg.norm(smooth, axis=1, keepdims=True)
        offset = points - nearest
        length = np.linalg.norm(offset, axis=1, keepdims=True)
        cosine = np.einsum("si,si->s", offset, smooth)[:, None] / np.maximum(length, 1e-300)
        # Within a micrometre, or looking along the surface, the offset has no direction to trust.
        trusted = (length > 1e-6) & (np.abs(cosine) > 0.3)
        normals = np.where(trusted, np.sign(cosine) * offset / np.maximum(length, 1e-300), smooth)
        return Planes(nearest, normals, face, barycentric)

    def carried(self, points: np.ndarray, frame: int, rest_points: np.ndarray | None = None) -> np.ndarray:
        """Where points (N, 3) at frame - 1 would go if each kept its place beside its nearest face.

        The best known initial guess for a garment: the body's own motion, face by face.
        """
        face, nearest, barycentric = self._nearest_allowed(points, frame - 1, rest_points)
        corners = self.at(frame)[self.faces[face]]
        before, after = _face_frames(self.at(frame - 1)[self.faces[face]]), _face_frames(corners)
        local = np.einsum("sij,si->sj", before, points - nearest)
        return np.einsum("sa,sai->si", barycentric, corners) + np.einsum("sij,sj->si", after, local)

    def signed_distance(self, points: np.ndarray, frame: int) -> np.ndarray:
        """True distance of points (N, 3) to the surface [m], negative inside (fast winding number)."""
        _, nearest = self._closest(points, frame, reachable=False)
        distance = np.linalg.norm(points - nearest, axis=1)
        vertices = np.asfortranarray(self.at(frame))
        # Only what lies in the bounding box can be inside.
        low, high = vertices.min(axis=0), vertices.max(axis=0)
        boxed = np.flatnonzero(((points > low) & (points < high)).all(axis=1))
        winding = igl.fast_winding_number(vertices, self.faces, np.asfortranarray(points[boxed]))
        distance[boxed] *= np.where(np.asarray(winding).ravel() > 0.5, -1.0, 1.0)
        return distance

    def _vertex_normals(self, frame: int) -> np.ndarray:
        return np.asarray(igl.per_vertex_normals(np.asfortranarray(self.at(frame)), self.faces))


def _face_frames(corners: np.ndarray) -> np.ndarray:
    """Orthonormal frames (N, 3, 3), axes as columns, of triangles (N, 3, 3)."""
    first = corners[:, 1] - corners[:, 0]
    first = first / np.linalg.norm(first, axis=1, keepdims=True)
    normal = np.cross(first, corners[:, 2] - corners[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    return np.stack([first, np.cross(normal, first), normal], axis=-1)


def _barycentric(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Barycentric coordinates (N, 3) of points on triangles (N, 3, 3)."""
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    r = points - corners[:, 0]
    aa, ab, bb = (np.einsum("ni,ni->n", p, q) for p, q in ((a, a), (a, b), (b, b)))
    ra, rb = np.einsum("ni,ni->n", r, a), np.einsum("ni,ni->n", r, b)
    det = np.maximum(aa * bb - ab * ab, 1e-300)
    v, w = (bb * ra - ab * rb) / det, (aa * rb - ab * ra) / det
    return np.clip(np.stack([1 - v - w, v, w], axis=1), 0.0, 1.0)


@njit(cache=True)
def _closest_allowed(points, which, rest_points, rest_centroids, region, vertices, faces, face, nearest):
    """For the samples `which`, replace face and nearest by the closest among allowed faces.

    A sample with no allowed face at all gets face -1.
    """
    best_point = np.empty(3)
    q = np.empty(3)
    for s in which:
        best = np.inf
        face[s] = -1
        for f in range(faces.shape[0]):
            dx = rest_centroids[f, 0] - rest_points[s, 0]
            dy = rest_centroids[f, 1] - rest_points[s, 1]
            dz = rest_centroids[f, 2] - rest_points[s, 2]
            if dx * dx + dy * dy + dz * dz > region * region:
                continue
            distance = _closest_on_triangle(
                points[s], vertices[faces[f, 0]], vertices[faces[f, 1]], vertices[faces[f, 2]], q
            )
            if distance < best:
                best = distance
                face[s] = f
                best_point[:] = q
        if best < np.inf:
            nearest[s] = best_point


@njit(cache=True)
def _closest_on_triangle(p, a, b, c, q):
    """Squared distance from p to triangle abc, the point itself in q (Ericson 2005, section 5.1.5)."""
    ab, ac, ap = b - a, c - a, p - a
    d1, d2 = np.dot(ab, ap), np.dot(ac, ap)
    bp = p - b
    d3, d4 = np.dot(ab, bp), np.dot(ac, bp)
    cp = p - c
    d5, d6 = np.dot(ab, cp), np.dot(ac, cp)
    va, vb, vc = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2
    if d1 <= 0 and d2 <= 0:
        v, w = 0.0, 0.0
    elif d3 >= 0 and d4 <= d3:
        v, w = 1.0, 0.0
    elif d6 >= 0 and d5 <= d6:
        v, w = 0.0, 1.0
    elif vc <= 0 and d1 >= 0 and d3 <= 0:
        v, w = d1 / (d1 - d3), 0.0
    elif vb <= 0 and d2 >= 0 and d6 <= 0:
        v, w = 0.0, d2 / (d2 - d6)
    elif va <= 0 and d4 - d3 >= 0 and d5 - d6 >= 0:
        w = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        v = 1.0 - w
    else:
        v, w = vb / (va + vb + vc), vc / (va + vb + vc)
    total = 0.0
    for i in range(3):
        q[i] = a[i] + v * ab[i] + w * ac[i]
        total += (p[i] - q[i]) ** 2
    return total
