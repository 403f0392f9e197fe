"""Contact planes for training: where each point of a garment may touch the body, remembered and renewed.

The loss needs, for each contact sample x of each frame, a plane (closest body point c, outward normal n), so
that d = n.(x - c). Searching it in every step would cost more than the rest of the step together. So an
anchor (a body face and barycentric coordinates) is kept for each frame and sample; body vertices of the
frame carry it to a plane in no time. Near the skin it slides to where its sample is now, whenever the energy
is taken (snug.sliding), and a few frames of each batch search anew from the current prediction, with the
simulator's own search and its rule of regions. All positions are float32, relative to the pelvis.
With thousands of frames remembered, an anchor has four bytes, two of them for its face: barycentric
coordinates are whole 255ths, which moves it along its face, by some 0.03 mm.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from reference_sim.closest_point import FaceTree
from reference_sim.energies import ContactPenalty
from reference_sim.kernel_cache import njit
from reference_sim.obstacle import DEFAULT_REGION, vertex_normals
from snug.sliding import SLACK, beyond_sides, slid

PARTS = 255.0  # of a barycentric coordinate
EXACT = 0.015  # m: a sample farther from the skin than this is in no contact, and its anchor may be rough


@dataclass(frozen=True)
class Patch:
    """The part of a body that one garment may touch.

    body_vertices (P,) into the whole body; faces (Q, 3) into the patch; rest (P, 3) and centroids (Q, 3) [m]
    in the T-pose; sample_rest (S, 3) [m] of the garment; beyond (Q, 3), see sliding.beyond_sides; a tree to
    search the faces with.
    """

    body_vertices: np.ndarray
    faces: np.ndarray
    rest: np.ndarray
    centroids: np.ndarray
    sample_rest: np.ndarray
    region: float
    beyond: np.ndarray
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
            beyond=beyond_sides(faces),
            tree=FaceTree(faces, centroids),
        )

    def search(
        self, points: np.ndarray, positions: np.ndarray, anchor_faces: np.ndarray | None = None, *,
        exact: bool = False,
    ) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
        """Closest allowed body point of each sample in one frame.

        points (S, 3), positions (P, 3) of the patch [m], anchor_faces (S,) where to look first
        -> faces (S,), barycentric (S, 2) of the second and third corner. Beyond EXACT from the skin an old
        anchor stands as long as no face is half as far, unless all are to be exact.
        """
        self.tree.refit(positions)
        found = self.tree.nearest(
            points,
            hints=anchor_faces,
            rest_points=self.sample_rest,
            region=self.region,
            exact=np.inf if exact else EXACT,
        )
        return found.faces, found.barycentric[:, 1:]

    def normals(self, positions: np.ndarray) -> np.ndarray:
        """Area-weighted vertex normals: positions (N, P, 3) float32 -> (N, P, 3) int8, 127 times unit length.

        A byte is enough (0.3 degrees): planes interpolate them and make the result unit length again. With
        thousands of frames remembered, memory counts.
        """
        return _byte_normals(positions, self.faces)


def kept(faces: np.ndarray, barycentric: np.ndarray, body_faces: int) -> tuple[np.ndarray, np.ndarray]:
    """Anchors on a body of so many faces as they are remembered: faces (S,) in as few bytes as hold them,
    barycentric (S, 2) as uint8 in 1 / PARTS, the two together never more than one.
    """
    parts = np.rint(PARTS * barycentric)
    parts[:, 1] = np.minimum(parts[:, 1], PARTS - parts[:, 0])
    return faces.astype(np.int16 if body_faces < 2**15 else np.int32), parts.astype(np.uint8)


class Anchors:
    """One anchor per frame and sample, and when each frame's were last searched, or lent."""

    def __init__(self, patch: Patch, frames: int) -> None:
        faces, barycentric = kept(*patch.search(patch.sample_rest, patch.rest, exact=True), len(patch.faces))
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

    def energy(
        self,
        contact: ContactPenalty,
        x: np.ndarray,
        frames: np.ndarray,
        rows: np.ndarray,
        positions: np.ndarray,
        normals: np.ndarray,
        *,
        slide: bool = False,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Contact energy of garments x (N, V, 3) float32 [m] in frames (N,), with the planes of `planes`.

        -> values (N,) [J], gradients (N, V, 3) [N], float32. slide: anchors near the skin first slide to
        where their samples are, and are remembered there. A sample that is out of reach costs no more than
        the look at its anchor, and no plane is stored.
        """
        values, gradients = np.empty(len(x), np.float32), np.zeros_like(x)
        _energy(
            x,
            *_samples(contact),
            contact.power,
            frames,
            rows,
            positions,
            normals,
            self.patch.faces.view(np.uint32),
            self.patch.beyond,
            self.patch.centroids,
            self.patch.sample_rest,
            np.float32(self.patch.region**2),
            np.float32(SLACK),
            slide,
            self.faces,
            self.barycentric,
            values,
            gradients,
        )
        return values, gradients

    def renew(self, frame: int, points: np.ndarray, positions: np.ndarray, *, exact: bool = False) -> None:
        """Search one frame's anchors anew: points (S, 3) float32, positions (P, 3) float32 of that frame.

        exact: no old anchor stands for being roughly right.
        """
        found = self.patch.search(points, positions, self.faces[frame], exact=exact)
        self.faces[frame], self.barycentric[frame] = kept(*found, len(self.patch.faces))
        self.age[frame] = 0

    def oldest(self, frames: np.ndarray, count: int) -> np.ndarray:
        """Places in `frames` of the `count` whose anchors are oldest; every frame passed here grows older."""
        self.age[frames] += 1
        return np.argsort(-self.age[frames], kind="stable")[:count]


@lru_cache(maxsize=16)
def _samples(contact: ContactPenalty) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.float32]:
    """Stencils, weights, stiffness and margin in the types of the kernel."""
    weights, stiffness = contact.weights.astype(np.float32), contact.stiffness.astype(np.float32)
    return contact.stencils.astype(np.uint32), weights, stiffness, np.float32(contact.margin)


@njit(cache=True, error_model="numpy")
def _byte_normals(positions, faces):
    normals = np.empty(positions.shape, np.int8)
    for frame in range(len(positions)):
        normals[frame] = np.rint(np.float32(127.0) * vertex_normals(positions[frame], faces))
    return normals


@njit(cache=True, inline="always", error_model="numpy")
def _carried(faces, face, parts, vectors, c):
    """Component c of what vectors (P, 3) of the body's vertices are at an anchor."""
    v, w = np.float32(parts[0]) / np.float32(PARTS), np.float32(parts[1]) / np.float32(PARTS)
    u = np.float32(1.0) - v - w
    return u * vectors[faces[face, 0], c] + v * vectors[faces[face, 1], c] + w * vectors[faces[face, 2], c]


@njit(cache=True, error_model="numpy")
def _planes(frames, rows, positions, normals, faces, anchor_faces, barycentric, out_points, out_normals):
    for n in range(len(frames)):
        x, m = positions[rows[n]], normals[rows[n]]
        anchors, parts = anchor_faces[frames[n]], barycentric[frames[n]]
        for s in range(anchors.shape[0]):
            length = np.float32(0.0)
            for c in range(3):
                out_points[n, s, c] = _carried(faces, anchors[s], parts[s], x, c)
                direction = _carried(faces, anchors[s], parts[s], m, c)
                out_normals[n, s, c] = direction
                length += direction * direction
            length = np.sqrt(length) + np.float32(1e-30)
            for c in range(3):
                out_normals[n, s, c] /= length


@njit(cache=True, inline="always", error_model="numpy")
def _above(x0, x1, x2, skin, m, faces, face, parts):
    """Height of a sample above its anchor's plane, times the length of the normal; and that normal."""
    i, j, k = faces[face, 0], faces[face, 1], faces[face, 2]
    whole = np.float32(1.0) / np.float32(PARTS)
    v, w = whole * np.float32(parts[0]), whole * np.float32(parts[1])
    u = np.float32(1.0) - v - w
    x0 -= u * skin[i, 0] + v * skin[j, 0] + w * skin[k, 0]
    x1 -= u * skin[i, 1] + v * skin[j, 1] + w * skin[k, 1]
    x2 -= u * skin[i, 2] + v * skin[j, 2] + w * skin[k, 2]
    n0 = u * m[i, 0] + v * m[j, 0] + w * m[k, 0]
    n1 = u * m[i, 1] + v * m[j, 1] + w * m[k, 1]
    n2 = u * m[i, 2] + v * m[j, 2] + w * m[k, 2]
    return n0 * x0 + n1 * x1 + n2 * x2, n0, n1, n2


# No assumption on NaN or infinity: the guard of training must see them.
@njit(cache=True, error_model="numpy", fastmath={"reassoc", "contract", "arcp", "nsz"})
def _energy(
    x, stencils, weights, stiffness, margin, power, frames, rows, positions, normals, faces, beyond,
    centroids, homes, region, slack, slide, anchor_faces, barycentric, values, gradients,
):  # fmt: skip
    """k max(margin - d, 0)^power of each sample, summed: values (N,), and added up: gradients (N, V, 3).

    stencils, faces: uint32, for a signed index is first asked whether it counts from the end.
    """
    # Normals have 127 times unit length, within 0.9 by rounding.
    reach = np.float32(128.0) * (margin + slack if slide else margin)
    zero, corners = np.float32(0.0), np.empty((1, 3, 3), np.float32)
    for n in range(len(x)):
        garment, gradient, skin, m = x[n], gradients[n], positions[rows[n]], normals[rows[n]]
        anchors, parts = anchor_faces[frames[n]], barycentric[frames[n]]
        total = 0.0
        for s in range(len(stencils)):
            face = np.uint32(anchors[s])
            a, b, c = stencils[s, 0], stencils[s, 1], stencils[s, 2]
            p, q, r = weights[s, 0], weights[s, 1], weights[s, 2]
            x0 = p * garment[a, 0] + q * garment[b, 0] + r * garment[c, 0]
            x1 = p * garment[a, 1] + q * garment[b, 1] + r * garment[c, 1]
            x2 = p * garment[a, 2] + q * garment[b, 2] + r * garment[c, 2]
            along, n0, n1, n2 = _above(x0, x1, x2, skin, m, faces, face, parts[s])
            if along >= reach:
                continue
            if slide and along < reach:  # not a sample that is no number
                face, v, w = slid(x0, x1, x2, face, skin, faces, beyond, centroids, homes[s], region, corners)
                anchors[s] = face
                parts[s, 0] = np.uint8(np.rint(np.float32(PARTS) * v))
                third = np.rint(np.float32(PARTS) * w)
                parts[s, 1] = np.uint8(min(third, np.float32(PARTS) - np.float32(parts[s, 0])))
                along, n0, n1, n2 = _above(x0, x1, x2, skin, m, faces, np.uint32(anchors[s]), parts[s])
            length = np.sqrt(n0 * n0 + n1 * n1 + n2 * n2) + np.float32(1e-30)
            depth = margin - along / length
            if depth <= zero:
                continue
            force = stiffness[s]
            for _ in range(power - 1):
                force *= depth
            total += force * depth
            force *= -np.float32(power) / length
            for corner, share in ((a, p), (b, q), (c, r)):
                gradient[corner, 0] += share * force * n0
                gradient[corner, 1] += share * force * n1
                gradient[corner, 2] += share * force * n2
        values[n] = total
