"""Contact planes for training: where each point of a garment may touch the body, remembered and renewed.

The loss needs, for each contact sample x of each frame, a plane (closest body point c, outward normal n), so
that d = n.(x - c). Searching it exactly in every step would cost more than the rest of the step together. So
an anchor (a body face and barycentric coordinates) is kept for each frame and sample; body vertices of the
frame carry it to a plane in no time, and a few frames of each batch search anew from the current prediction.

A sample may touch only faces whose T-pose centroid lies within `region` of its own rest position: without
that rule arms grab the shirt. All positions are float32, relative to the pelvis.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from reference_sim.obstacle import DEFAULT_REGION

SEED_SPACING = 0.04  # m: one starting vertex per cell of this size is tried before descending the surface


@dataclass(frozen=True)
class Patch:
    """The part of a body that one garment may touch.

    body_vertices (P,) into the whole body; faces (Q, 3) into the patch; rest (P, 3) and centroids (Q, 3) [m]
    in the T-pose; neighbours and incident faces of each vertex as (start, flat) lists; seeds of each sample
    likewise.
    """

    body_vertices: np.ndarray
    faces: np.ndarray
    rest: np.ndarray
    centroids: np.ndarray
    neighbours: tuple[np.ndarray, np.ndarray]
    incident: tuple[np.ndarray, np.ndarray]
    sample_rest: np.ndarray
    seeds: tuple[np.ndarray, np.ndarray]
    region: float

    @classmethod
    def around(
        cls,
        samples: np.ndarray,
        body_positions: np.ndarray,
        body_faces: np.ndarray,
        *,
        region: float = DEFAULT_REGION,
    ) -> Patch:
        """Cut the patch for samples (S, 3) [m] out of a body in its T-pose (B, 3) [m], (Fb, 3)."""
        from scipy.spatial import cKDTree

        distance, _ = cKDTree(samples).query(
            body_positions[body_faces].mean(axis=1), distance_upper_bound=region
        )
        kept = body_faces[np.isfinite(distance)]
        if len(kept) == 0:
            raise ValueError(f"no body face lies within {region} m of the garment: they do not fit together")
        body_vertices, flat = np.unique(kept, return_inverse=True)
        faces = flat.reshape(-1, 3).astype(np.int32)
        rest = body_positions[body_vertices].astype(np.float32)
        centroids = rest[faces].mean(axis=1)
        pairs = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
        pairs = np.unique(np.concatenate([pairs, pairs[:, ::-1]]), axis=0)
        corners = np.stack([faces.ravel(), np.repeat(np.arange(len(faces)), 3)], axis=1)
        cells = np.floor(rest / SEED_SPACING).astype(np.int64)
        _, coarse = np.unique(cells, axis=0, return_index=True)
        near = cKDTree(rest[coarse]).query_ball_point(samples, region)
        seeds = [coarse[n] if len(n) else coarse for n in near]
        return cls(
            body_vertices=body_vertices,
            faces=faces,
            rest=rest,
            centroids=centroids.astype(np.float32),
            neighbours=_lists(pairs, len(rest)),
            incident=_lists(corners, len(rest)),
            sample_rest=samples.astype(np.float32),
            seeds=(
                np.cumsum([0, *map(len, seeds)]).astype(np.int32),
                np.concatenate(seeds).astype(np.int32),
            ),
            region=region,
        )

    def search(
        self, points: np.ndarray, positions: np.ndarray, anchor_faces: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Closest allowed body point of each sample in one frame.

        points (S, 3), positions (P, 3) of the patch [m], anchor_faces (S,) where to look first
        -> faces (S,) int32, barycentric (S, 2) float32 of the second and third corner.
        The search starts at the nearest of the old anchor and of the sample's seeds and walks down the
        surface; it is exact but for local minima between two seeds.
        """
        faces = np.empty(len(points), np.int32)
        barycentric = np.empty((len(points), 2), np.float32)
        _search(
            points, positions, self.sample_rest, self.rest, self.centroids, self.faces, anchor_faces,
            *self.neighbours, *self.incident, *self.seeds, self.region**2, faces, barycentric,
        )  # fmt: skip
        return faces, barycentric

    def normals(self, positions: np.ndarray) -> np.ndarray:
        """Area-weighted vertex normals: positions (N, P, 3) float32 -> (N, P, 3) int8, 127 times unit length.

        A byte is enough (0.3 degrees): planes interpolate them and make the result unit length again. With
        thousands of frames remembered, memory counts.
        """
        normals = np.empty(positions.shape, np.int8)
        _vertex_normals(positions, self.faces, normals)
        return normals


class Anchors:
    """One anchor per frame and sample, and when each frame's were last searched."""

    def __init__(self, patch: Patch, frames: int) -> None:
        samples = len(patch.sample_rest)
        start = np.zeros(samples, np.int32)
        faces, barycentric = patch.search(patch.sample_rest, patch.rest, start)
        self.patch = patch
        self.faces = np.repeat(faces[None], frames, axis=0)
        self.barycentric = np.repeat(barycentric[None], frames, axis=0)
        self.age = np.zeros(frames, np.int64)

    def planes(
        self, frames: np.ndarray, rows: np.ndarray, positions: np.ndarray, normals: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Planes of frames (N,), whose patch positions and normals are rows (N,) of (R, P, 3) arrays.

        -> points, unit normals (N, S, 3) float32
        """
        shape = (len(frames), self.faces.shape[1], 3)
        points, directions = np.empty(shape, np.float32), np.empty(shape, np.float32)
        _planes(
            frames,
            rows,
            positions,
            normals,
            self.patch.faces,
            self.faces,
            self.barycentric,
            points,
            directions,
        )
        return points, directions

    def renew(self, frame: int, points: np.ndarray, positions: np.ndarray) -> None:
        """Search one frame's anchors anew: points (S, 3) float32, positions (P, 3) float32 of that frame."""
        self.faces[frame], self.barycentric[frame] = self.patch.search(points, positions, self.faces[frame])
        self.age[frame] = 0

    def oldest(self, frames: np.ndarray, count: int) -> np.ndarray:
        """Places in `frames` of the `count` whose anchors are oldest; every frame passed here grows older."""
        self.age[frames] += 1
        return np.argsort(-self.age[frames], kind="stable")[:count]


def _lists(pairs: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """(key, value) rows -> (start (count+1,), values sorted by key)."""
    ordered = pairs[np.argsort(pairs[:, 0], kind="stable")]
    start = np.searchsorted(ordered[:, 0], np.arange(count + 1))
    return start.astype(np.int32), np.ascontiguousarray(ordered[:, 1]).astype(np.int32)


@numba.njit(cache=True, error_model="numpy", inline="always")
def _squared(a, b):
    return (a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2


@numba.njit(cache=True, error_model="numpy", inline="always")
def _closest_on_triangle(aa, cc, m, d, e):
    """Where on a triangle the closest point lies: (v, w), the weights of its second and third corner.

    With sides s, t from the first corner to the others and r from it to the point:
    aa = s.s, cc = t.t, m = s.t, d = s.r, e = t.r. The squared distance is |r|^2 + q(v, w) with
    q = v^2 aa + w^2 cc + 2 v w m - 2 v d - 2 w e.
    """
    det = aa * cc - m * m
    if det > 0.0:
        v, w = (cc * d - m * e) / det, (aa * e - m * d) / det
        if v >= 0.0 and w >= 0.0 and v + w <= 1.0:
            return v, w
    # The foot is outside: the nearest of the three edges, each clamped to its ends.
    on_s = min(max(d / aa, 0.0), 1.0)
    on_t = min(max(e / cc, 0.0), 1.0)
    on_u = min(max((e - d + aa - m) / (aa + cc - 2.0 * m), 0.0), 1.0)
    best_s = on_s * (on_s * aa - 2.0 * d)
    best_t = on_t * (on_t * cc - 2.0 * e)
    v = 1.0 - on_u
    best_u = v * v * aa + on_u * on_u * cc + 2.0 * v * on_u * m - 2.0 * v * d - 2.0 * on_u * e
    if best_s <= best_t and best_s <= best_u:
        return on_s, 0.0
    if best_t <= best_u:
        return 0.0, on_t
    return v, on_u


@numba.njit(cache=True, error_model="numpy")
def _search(
    points, positions, sample_rest, rest, centroids, faces, anchor_faces, near_start, near, face_start,
    face_list, seed_start, seeds, region2, out_faces, out_barycentric,
):  # fmt: skip
    for s in range(len(points)):
        p, home = points[s], sample_rest[s]
        vertex = faces[anchor_faces[s], 0]
        best = (
            _squared(positions[vertex], p) if _squared(rest[vertex], home) < region2 else np.float32(np.inf)
        )
        for k in range(seed_start[s], seed_start[s + 1]):
            distance = _squared(positions[seeds[k]], p)
            if distance < best:
                best, vertex = distance, seeds[k]
        moved = True
        while moved:
            moved, here = False, vertex
            for k in range(near_start[here], near_start[here + 1]):
                distance = _squared(positions[near[k]], p)
                if distance < best and _squared(rest[near[k]], home) < region2:
                    best, vertex, moved = distance, near[k], True
        _best_face(p, home, vertex, positions, centroids, faces, face_start, face_list, region2, s, out_faces,
                   out_barycentric)  # fmt: skip


@numba.njit(cache=True, error_model="numpy")
def _best_face(
    p,
    home,
    vertex,
    positions,
    centroids,
    faces,
    face_start,
    face_list,
    region2,
    s,
    out_faces,
    out_barycentric,
):
    """Of the faces around a vertex, allowed ones before others, the one that comes closest to p."""
    best = np.inf
    for n in range(face_start[vertex], face_start[vertex + 1]):
        face = face_list[n]
        i, j, k = faces[face, 0], faces[face, 1], faces[face, 2]
        x, y, z = positions[i, 0], positions[i, 1], positions[i, 2]
        s0, s1, s2 = positions[j, 0] - x, positions[j, 1] - y, positions[j, 2] - z
        t0, t1, t2 = positions[k, 0] - x, positions[k, 1] - y, positions[k, 2] - z
        r0, r1, r2 = p[0] - x, p[1] - y, p[2] - z
        aa, cc, m = s0 * s0 + s1 * s1 + s2 * s2, t0 * t0 + t1 * t1 + t2 * t2, s0 * t0 + s1 * t1 + s2 * t2
        v, w = _closest_on_triangle(aa, cc, m, s0 * r0 + s1 * r1 + s2 * r2, t0 * r0 + t1 * r1 + t2 * r2)
        q0, q1, q2 = r0 - v * s0 - w * t0, r1 - v * s1 - w * t1, r2 - v * s2 - w * t2
        distance = q0 * q0 + q1 * q1 + q2 * q2
        if _squared(centroids[face], home) >= region2:
            distance += 1.0
        if distance < best:
            best = distance
            out_faces[s] = face
            out_barycentric[s, 0], out_barycentric[s, 1] = v, w


@numba.njit(cache=True, error_model="numpy")
def _vertex_normals(positions, faces, normals):
    out = np.empty(positions.shape[1:], np.float32)
    for n in range(len(positions)):
        x = positions[n]
        out[:] = 0.0
        for f in range(len(faces)):
            i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
            a0, a1, a2 = x[j, 0] - x[i, 0], x[j, 1] - x[i, 1], x[j, 2] - x[i, 2]
            b0, b1, b2 = x[k, 0] - x[i, 0], x[k, 1] - x[i, 1], x[k, 2] - x[i, 2]
            n0, n1, n2 = a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0
            for v in (i, j, k):
                out[v, 0] += n0
                out[v, 1] += n1
                out[v, 2] += n2
        for v in range(out.shape[0]):
            length = np.sqrt(out[v, 0] ** 2 + out[v, 1] ** 2 + out[v, 2] ** 2) + np.float32(1e-30)
            for c in range(3):
                normals[n, v, c] = np.int8(np.rint(np.float32(127.0) * out[v, c] / length))


@numba.njit(cache=True, error_model="numpy")
def _planes(frames, rows, positions, normals, faces, anchor_faces, barycentric, out_points, out_normals):
    for n in range(len(frames)):
        x, m = positions[rows[n]], normals[rows[n]]
        anchors, weights = anchor_faces[frames[n]], barycentric[frames[n]]
        for s in range(anchors.shape[0]):
            i, j, k = faces[anchors[s], 0], faces[anchors[s], 1], faces[anchors[s], 2]
            v, w = weights[s, 0], weights[s, 1]
            u = np.float32(1.0) - v - w
            length = np.float32(0.0)
            for c in range(3):
                out_points[n, s, c] = u * x[i, c] + v * x[j, c] + w * x[k, c]
                direction = u * m[i, c] + v * m[j, c] + w * m[k, c]
                out_normals[n, s, c] = direction
                length += direction * direction
            length = np.sqrt(length) + np.float32(1e-30)
            for c in range(3):
                out_normals[n, s, c] /= length
