"""Metrics deformation/*, dihedral/mean, intersections/*: changes of shape, and a cloth through itself."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from benchmarks.metric import Metric

if TYPE_CHECKING:
    from benchmarks.metric import RollOut

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]

_metric = partial(Metric, table="shape")

METRICS = (
    _metric(name="deformation/edges", unit="%", title="Edges",
            definition="|length / rest length - 1|, mean over edges and frames"),
    _metric(name="deformation/areas", unit="%", title="Areas",
            definition="|area / rest area - 1|, mean over faces and frames"),
    _metric(name="dihedral/mean", unit="deg", title="Folds",
            definition="angle between the normals of the two faces of an inner edge, mean over edges and "
            "frames"),
    _metric(name="intersections/triangles", unit="%", title="Self-cut", lower_is_better=True,
            definition="triangles that pass through another one of the same cloth, mean over frames"),
    _metric(name="intersections/contours", unit="m", title="Contours", table="intersections",
            lower_is_better=True,
            definition="length of the lines in which triangles of the cloth pass through others of it, mean "
            "over frames"),
)  # fmt: skip


def measure(roll_out: RollOut) -> dict[str, float]:
    """Return changes of edges and areas [%], folds [degrees] and self-intersections [%], [m]."""
    from benchmarks.metrics.surface.self_intersections import share_and_contours  # loads numba

    cloth, x = roll_out.scene.cloth, roll_out.positions[roll_out.judged]
    share, contours = share_and_contours(x, cloth.faces)
    return {
        "deformation/edges": 100.0 * float(edge_change(x, cloth.edges, cloth.edge_lengths).mean()),
        "deformation/areas": 100.0 * float(area_change(x, cloth.faces, cloth.areas).mean()),
        "dihedral/mean": float(np.rad2deg(dihedral_angle(x, cloth.hinges).mean())),
        "intersections/triangles": 100.0 * float(share.mean()),
        "intersections/contours": float(contours.mean()),
    }


def edge_change(positions: Floats, edges: Indices, rest_lengths: Floats) -> Floats:
    """Return the mean over edges of |length / rest length - 1| of each frame, (T,) [1].

    positions: (T,V,3) [m]; edges: (E,2); rest_lengths: (E,) [m].
    """
    vectors = positions[:, edges[:, 1]] - positions[:, edges[:, 0]]
    return np.abs(np.linalg.norm(vectors, axis=2) / rest_lengths - 1.0).mean(1)


def area_change(positions: Floats, faces: Indices, rest_areas: Floats) -> Floats:
    """Return the mean over faces of |area / rest area - 1| of each frame, (T,) [1].

    positions: (T,V,3) [m]; faces: (F,3); rest_areas: (F,) [m^2].
    """
    corners = positions[:, faces]
    normals = np.cross(corners[:, :, 1] - corners[:, :, 0], corners[:, :, 2] - corners[:, :, 0])
    return np.abs(0.5 * np.linalg.norm(normals, axis=2) / rest_areas - 1.0).mean(1)


def dihedral_angle(positions: Floats, hinges: Indices) -> Floats:
    """Return the mean angle between normals of neighbouring faces of each frame, (T,) [rad]; 0 where flat.

    hinges: (H,4) the edge's ends, then the tip of either face.
    """
    if not len(hinges):
        return np.zeros(len(positions))
    a, b, left, right = (positions[:, hinges[:, k]] for k in range(4))
    edge = b - a
    n1, n2 = np.cross(edge, left - a), np.cross(right - a, edge)
    sine = np.linalg.norm(np.cross(n1, n2), axis=2)
    return np.arctan2(sine, (n1 * n2).sum(2)).mean(1)
