"""Collision clean-up after a prediction: vertices below or within 2 mm of the skin are pushed out to 2 mm.

    x' = x + max(2 mm - n.(x - c), 0) n      c: closest body point that x may touch, n: the skin's normal

The released SNUG models and Santesteban 2019 end with such a step, so numbers from them are post-processed.
Here it is never part of a network's row: it is a method of its own, and its time is on that method's clock.
One push for each vertex, none for edges and faces: where skin is hollow a vertex may end nearer than 2 mm,
and a long edge may still cut through the body.
"""

from __future__ import annotations

import numpy as np

from snug.contact import Anchors, Patch

MARGIN = 2e-3  # [m]


class CleanUp:
    """Pushes a garment off a body that moves in a known way.

    rest_positions (V, 3) of the garment and body_rest (B, 3), body_faces of the body in its T-pose, which say
    what may touch what; body_positions (T, B, 3) [m] of each frame, any origin shared with the garment.
    Raises ValueError where garment and body are nowhere near each other.
    """

    def __init__(
        self,
        rest_positions: np.ndarray,
        body_rest: np.ndarray,
        body_faces: np.ndarray,
        body_positions: np.ndarray,
    ) -> None:
        self.patch = Patch.around(rest_positions, body_rest, body_faces)
        self.anchors = Anchors(self.patch, 1)  # searched anew in each frame, from where they were in the last
        self.body = body_positions[:, self.patch.body_vertices].astype(np.float32)

    def __call__(self, x: np.ndarray, frame: int) -> np.ndarray:
        """Vertices (V, 3) [m] of a frame, pushed out where need be; the given ones are left as they are."""
        skin, only = self.body[frame : frame + 1], np.zeros(1, np.int64)
        self.anchors.renew(0, x.astype(np.float32), skin[0])
        points, normals = self.anchors.planes(only, only, skin, self.patch.normals(skin))
        lack = MARGIN - np.einsum("vi,vi->v", normals[0], x - points[0])
        return x + np.maximum(lack, 0.0)[:, None] * normals[0]
