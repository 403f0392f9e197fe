"""Contact planes for training: where each point of a garment may touch the body, remembered and renewed.

The loss needs, for each contact sample x of each frame, a plane (closest body point c, outward normal n), so
that d = n.(x - c). Searching it in every step would cost more than the rest of the step together. So an
anchor (a body face and barycentric coordinates) is kept for each frame and sample; body vertices of the
frame carry it to a plane in no time, and a few frames of each batch search anew from the current prediction,
with the simulator's own search and its rule of regions. All positions are float32, relative to the pelvis.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from reference_sim.closest_point import FaceTree
from reference_sim.obstacle import DEFAULT_REGION, vertex_normals

EXACT = 0.015  # m: a sample farther from the skin than this is in no contact, and its anchor may be rough


@dataclass(frozen=True)
class Patch:
    """The part of a body that one garment may touch.

    body_vertices (P,) into the whole body; faces (Q, 3) into the patch; rest (P, 3) and centroids (Q, 3) [m]
    in the T-pose; sample_rest (S, 3) [m] of the garment; a tree to search the faces with.
    """

    body_vertices: np.ndarray
    faces: np.ndarray
    rest: np.ndarray
    centroids: np.ndarray
    sample_rest: np.ndarray
    region: float
    tree: FaceTree

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
        return cls(
            body_vertices=body_vertices,
            faces=faces,
            rest=rest,
            centroids=centroids,
            sample_rest=samples.astype(np.float32),
            region=region,
            tree=FaceTree(faces, centroids),
        )

    def search(
        self, points: np.ndarray, positions: np.ndarray, anchor_faces: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Closest allowed body point of each sample in one frame.

        points (S, 3), positions (P, 3) of the patch [m], anchor_faces (S,) where to look first
        -> faces (S,) int32, barycentric (S, 2) float32 of the second and third corner. Beyond EXACT from the
        skin an old anchor stands as long as no face is half as far.
        """
        self.tree.refit(positions)
        found = self.tree.nearest(
            points,
            hints=anchor_faces,
            rest_points=self.sample_rest,
            region=self.region,
            exact=EXACT,
        )
        return found.faces.astype(np.int32), found.barycentric[:, 1:].astype(np.float32)

    def normals(self, positions: np.ndarray) -> np.ndarray:
        """Area-weighted vertex normals: positions (N, P, 3) float32 -> (N, P, 3) int8, 127 times unit length.

        A byte is enough (0.3 degrees): planes interpolate them and make the result unit length again. With
        thousands of frames remembered, memory counts.
        """
        normals = np.empty(positions.shape, np.int8)
        for frame, x in enumerate(positions):
            normals[frame] = np.rint(np.float32(127.0) * vertex_normals(x, self.faces))
        return normals


class Anchors:
    """One anchor per frame and sample, and when each frame's were last searched."""

    def __init__(self, patch: Patch, frames: int) -> None:
        faces, barycentric = patch.search(patch.sample_rest, patch.rest)
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
