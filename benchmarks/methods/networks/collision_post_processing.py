"""Collision post-processing: vertices below or within 2 mm of the skin are pushed out to 2 mm.

    x' = x + max(2 mm - n.(x - c), 0) n      c: closest body point that x may touch, n: the skin's normal

The released SNUG models and Santesteban 2019 end with such a step, so numbers from them are post-processed.
Here it is never part of a network's row: it is a method of its own, and its time is on that method's clock.
One push for each vertex, none for edges and faces: where skin is hollow a vertex may end nearer than 2 mm,
and a long edge may still cut through the body.
"""

from __future__ import annotations

import numpy as np

from reference_sim.geometry.surface import vertex_normals
from snug.training.contact_cache import Patch

MARGIN = 2e-3  # [m]


class CollisionPostProcessing:
    """Push-out of a garment from a body that moves in a known way.

    Args:
        rest_positions: (V, 3) [m] of the garment.
        body_rest, body_faces: (B, 3) [m] and (G, 3) of the body in T-pose, which say what may touch what.
        body_positions: (T, B, 3) [m] of each frame; any origin shared with the garment.

    Raises:
        ValueError: garment and body are nowhere near each other.
    """

    def __init__(
        self,
        rest_positions: np.ndarray,
        body_rest: np.ndarray,
        body_faces: np.ndarray,
        body_positions: np.ndarray,
    ) -> None:
        self.patch = Patch.around(rest_positions, body_rest, body_faces)
        self.body = body_positions[:, self.patch.body_vertices].astype(np.float32)
        self._faces: np.ndarray | None = None  # found last, where the next search begins

    def __call__(self, x: np.ndarray, frame: int) -> np.ndarray:
        """Return vertices (V, 3) [m] of a frame, pushed out where need be; `x` is left as it is."""
        patch, skin = self.patch, self.body[frame]
        patch.tree.refit(skin)
        # Exact at any depth, unlike the anchors of training: what lies deep must find the near way out.
        nearest = patch.tree.nearest(x, hints=self._faces, samples=patch.samples)
        self._faces = nearest.faces
        corners = vertex_normals(skin, patch.faces)[patch.faces[nearest.faces]]
        normals = np.einsum("va,vai->vi", nearest.barycentric, corners)
        normals /= np.linalg.norm(normals, axis=1, keepdims=True) + 1e-30
        lack = MARGIN - np.einsum("vi,vi->v", normals, x - nearest.points)
        return x + np.maximum(lack, 0.0)[:, None] * normals
