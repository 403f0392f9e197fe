"""Metrics surface/*: a roll-out against the reference as surfaces, whatever their meshes.

With d the distance from a vertex to the nearest point of the other surface, and theta the angle between
the normals there, both weighted by a third of the triangles around the vertex,

    Chamfer distance   (mean of d from A to B + mean of d from B to A) / 2    [mm]
    angle of normals   the same of theta                                      [degrees]

(Cignoni, Rocchini and Scopigno 1998). They are blind to cloth that slides along itself. What moves on
another mesh than the scene's has these numbers and its penetration alone.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from benchmarks.metric import Measurements, metrics_of
from benchmarks.metrics.penetration_and_distances import MM
from reference_sim.geometry.topology import corner_areas

if TYPE_CHECKING:
    from benchmarks.metric import Faces, Floats, RollOut, Vertices

SAMPLED_FRAMES = 12  # frames that are looked at, evenly spread
# A vertex so far from the origin is on no surface, and its square may overflow.
LOST = 1e6  # [m]


def compare(roll_out: RollOut, reference: RollOut) -> dict[str, float]:
    """Return Chamfer distance [mm] and angle of normals [degrees] to the reference.

    Empty of a cloth that is lost, or has no area in some frame.
    """
    common = roll_out.match_frames(reference.positions)
    x, y = roll_out.positions[common], reference.positions[common]
    if not len(x) or np.abs(x).max() > LOST:
        return {}
    faces, others = roll_out.trajectory.faces, reference.trajectory.faces
    if not all(corner_areas(frame[faces]).any() for frame in x):
        return {}
    sampled = np.unique(np.linspace(0, len(x) - 1, SAMPLED_FRAMES).round().astype(int))
    measures = [chamfer_and_angle(x[frame], faces, y[frame], others) for frame in sampled]
    distance, angle = np.mean(measures, axis=0)
    return {"surface/chamfer": MM * float(distance), "surface/normals": float(np.rad2deg(angle))}


def chamfer_and_angle(x: Vertices, faces: Faces, y: Vertices, others: Faces) -> tuple[float, float]:
    """Return Chamfer distance [m] and mean angle of normals [rad] between two surfaces."""
    forth, back = _one_way(x, faces, y, others), _one_way(y, others, x, faces)
    return (forth[0] + back[0]) / 2.0, (forth[1] + back[1]) / 2.0


def _one_way(x: Vertices, faces: Faces, y: Vertices, others: Faces) -> tuple[float, float]:
    """Return mean distance [m] and angle [rad] from the vertices x to the surface of y."""
    import igl

    from reference_sim.geometry.surface import vertex_normals  # loads numba

    squared, nearest, points = igl.point_mesh_squared_distance(x, y, others)
    corners = others[nearest]
    shares = _barycentric(points, y[corners])
    of_nearest = np.einsum("vk,vki->vi", shares, vertex_normals(np.ascontiguousarray(y), others)[corners])
    here = vertex_normals(np.ascontiguousarray(x), faces)
    angles = np.arctan2(
        np.linalg.norm(np.cross(here, of_nearest), axis=1), (here * of_nearest).sum(axis=1)
    )
    weights = np.bincount(faces.ravel(), np.repeat(corner_areas(x[faces]), 3), len(x))
    means = np.average(np.stack([np.sqrt(squared), angles]), axis=1, weights=weights)
    return float(means[0]), float(means[1])


def _barycentric(points: Floats, corners: Floats) -> Floats:
    """Return the weights (N,3) [1] by which points (N,3) lie between the corners (N,3,3) of triangles."""
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normals, away = np.cross(first, second), points - corners[:, 0]
    squares = np.maximum((normals**2).sum(axis=1), np.finfo(float).tiny)
    u = (np.cross(away, second) * normals).sum(axis=1) / squares
    v = (np.cross(first, away) * normals).sum(axis=1) / squares
    return np.stack([1.0 - u - v, u, v], axis=1)


SURFACE = Measurements(
    "surface",
    metrics_of(
        ("surface/chamfer", "mm", "Chamfer",
         "mean distance from vertices to the nearest point of the reference's surface and from its vertices "
         "back, by area, mean of both ways and of 12 evaluated frames"),
        ("surface/normals", "deg", "Normals",
         "angle between the normals of the two surfaces at these nearest points, mean as above"),
        table="surface", lower_is_better=True,
    ),
    compare=compare, other_meshes=True,
)  # fmt: skip
