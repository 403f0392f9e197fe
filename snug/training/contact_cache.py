"""Cache of contact anchors: where each sample of a garment may touch the body, searched anew in training.

The loss needs, for each contact sample x of each frame, a plane (closest body point c, outward normal n),
so that d = n.(x - c). Searching it in every step would cost more than the rest of the step together. So
an anchor (a body face and barycentric coordinates) is kept for each frame and sample; body vertices of
the frame carry it to a plane in no time. It walks with its sample (snug.kernels.contact), and a few
frames of each batch are searched anew (snug.training.contact_planes), by the simulator's own search and
rule of regions. Positions are float32, relative to the pelvis. An anchor has four bytes: barycentric
coordinates are whole 255ths, which moves it along its face by some 0.03 mm.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from reference_sim.energies import ContactPenalty
from reference_sim.geometry.closest_point import FaceSearch
from reference_sim.kernels.fast_kernels import LANES
from reference_sim.obstacle import DEFAULT_REGION, reachable_faces
from snug.kernels.contact import PARTS, WALK_SLACK, byte_normals, contact_energy, triangle_adjacency

# A sample farther from the skin than this is in no contact, and its anchor may be rough.
EXACT = 0.015  # m


class Patch:
    """The part of a body that one garment may touch.

    It has faces (Q, 3) between vertices (P,) of the body, at most `region` [m] in the T-pose from a
    sample of the garment (S, 3) [m].

    Raises:
        ValueError: no face of the body lies within `region` of the garment.
    """

    def __init__(
        self,
        samples: np.ndarray,
        body_positions: np.ndarray,
        body_faces: np.ndarray,
        *,
        region: float = DEFAULT_REGION,
    ) -> None:
        from scipy.spatial import cKDTree

        middles = body_positions[body_faces].mean(axis=1)
        if cKDTree(middles).query(samples)[0].min() >= region:
            raise ValueError(
                f"no body face lies within {region} m of the garment: they do not fit together"
            )
        patch = body_faces[reachable_faces(samples, middles, region)]
        self.body_vertices, flat = np.unique(patch, return_inverse=True)
        self.faces = flat.reshape(-1, 3).astype(np.int32)
        self.rest = body_positions[self.body_vertices].astype(np.float32)
        self.centroids = self.rest[self.faces].mean(axis=1)
        self.sample_rest, self.region = samples.astype(np.float32), region
        self.adjacency = triangle_adjacency(self.faces)
        self.tree = FaceSearch(self.faces, self.centroids)
        self.samples = self.tree.group(self.sample_rest, region)

    def search(
        self, points: np.ndarray, positions: np.ndarray, anchor_faces: np.ndarray | None = None, *,
        exact: bool = False,
    ) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
        """Find the closest allowed body point of samples (S, 3) [m] in one frame of the patch (P, 3) [m].

        Beyond EXACT from the skin an old anchor (S,) stands as long as no face is half as far, unless the
        search is `exact`. Returns faces (S,), barycentric coordinates (S, 2) of second and third corners.
        """
        self.tree.refit(positions)
        nearest = self.tree.nearest(
            points, hints=anchor_faces, samples=self.samples, exact=np.inf if exact else EXACT
        )
        return nearest.faces, nearest.barycentric[:, 1:]


def quantise(barycentric: Any) -> Any:
    """Round barycentric coordinates (..., 2), an array or a tensor, to whole PARTS, in all at most PARTS."""
    parts = (PARTS * barycentric).round()
    parts[..., 1] = parts[..., 1].clip(max=PARTS - parts[..., 0])
    return parts


class ContactCache:
    """One anchor per frame and sample."""

    def __init__(self, patch: Patch, frames: int) -> None:
        faces, barycentric = patch.search(patch.sample_rest, patch.rest, exact=True)
        kind = np.int16 if len(patch.faces) < 2**15 else np.int32
        self.patch, self.faces = patch, np.repeat(faces[None].astype(kind), frames, axis=0)
        self.barycentric = np.repeat(quantise(barycentric)[None].astype(np.uint8), frames, axis=0)

    def normals(self, positions: np.ndarray) -> np.ndarray:
        """Return area-weighted vertex normals (N, P, 3) of positions (N, P, 3), 127 times unit length."""
        return byte_normals(positions, self.patch.faces)

    def energy(
        self,
        contact: ContactPenalty,
        x: np.ndarray,
        gradients: np.ndarray,
        frames: np.ndarray,
        rows: np.ndarray,
        positions: np.ndarray,
        normals: np.ndarray,
        *,
        walk: bool = False,
    ) -> np.ndarray:
        """Return the contact energy (C, LANES) [J] of garments; add its gradient to `gradients`.

        Garments x (C, V, 3, LANES) lie as in snug.kernels.skinning, the patch of each of the
        frames (N, T) in its row (N, T) of positions [m] and normals (R, P, 3). With `walk`, anchors near
        the skin first walk to where their samples are, and stay there. Lanes beyond the last frame are
        zero.
        """
        values, patch = np.zeros((len(x), LANES), np.float32), self.patch
        body = positions, normals, patch.faces.view(np.uint32), patch.adjacency, patch.centroids
        limits = np.float32(patch.region**2), np.float32(WALK_SLACK), walk
        contact_energy(
            x, *_samples(contact), contact.power, frames, rows, *body, patch.sample_rest, *limits,
            self.faces, self.barycentric, values, gradients,
        )  # fmt: skip
        return values

    def requery(
        self, frame: int, points: np.ndarray, positions: np.ndarray, *, exact: bool = False
    ) -> None:
        """Search one frame's anchors anew: points (S, 3) float32, positions (P, 3) float32 of that frame.

        exact: no old anchor stands for being roughly right.
        """
        faces, barycentric = self.patch.search(points, positions, self.faces[frame], exact=exact)
        self.faces[frame], self.barycentric[frame] = faces, quantise(barycentric)


@lru_cache(maxsize=16)
def _samples(contact: ContactPenalty) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.float32]:
    """Return stencils, weights, stiffness and margin in the types of the kernel."""
    weights, stiffness = contact.weights.astype(np.float32), contact.stiffness.astype(np.float32)
    return contact.stencils.astype(np.uint32), weights, stiffness, np.float32(contact.margin)
