"""Metrics stretch/*, deformation/*, dihedral/*, mesh/*, body/shape: sizes and changes of shape.

Metrics stretch/*: percentiles of the principal stretches of triangles, tension and compression apart.

Of each triangle F = [x1 - x0, x2 - x0] Dm^-1 (3 x 2) is the deformation gradient, and the square roots of the
eigenvalues of the right Cauchy-Green tensor F^T F are its principal stretches (Bonet and Wood 2008, section
4.6). The larger one less 1 is called tension and the smaller one less 1 compression, whatever their signs:
a triangle may be stretched in one direction and compressed in the other.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from benchmarks.metric import Measurements, Metric

if TYPE_CHECKING:
    from benchmarks.metric import RollOut
    from reference_sim.cloth import Cloth

Floats = NDArray[np.float64]

PERCENTILES = (1, 50, 99)
SIDES = {"compression": "smaller", "tension": "larger"}  # in the order of `principal_stretches`

STRETCH_METRICS = tuple(
    Metric(
        name=f"stretch/{side}_p{percent:02}", unit="%", title=f"{side.capitalize()}, {percent} %",
        table="stretch" if percent != 50 else "",
        definition=f"{SIDES[side]} principal stretch of a triangle less 1: {percent} % of the rest area have "
        "less, over all evaluated frames",
    )
    for side in ("tension", "compression")
    for percent in PERCENTILES
)  # fmt: skip


def measure_stretch(roll_out: RollOut) -> dict[str, float]:
    """Return percentiles of tension and compression over triangles and evaluated frames [%]."""
    cloth = roll_out.scene.cloth
    strains = principal_stretches(roll_out.positions[roll_out.judged], cloth) - 1.0
    values: dict[str, float] = {}
    for side, strain in zip(SIDES, np.moveaxis(strains, -1, 0)):
        of_percentiles = weighted_percentiles(strain, np.broadcast_to(cloth.areas, strain.shape), PERCENTILES)
        values |= {f"stretch/{side}_p{p:02}": 100.0 * float(v) for p, v in zip(PERCENTILES, of_percentiles)}
    return values


def principal_stretches(positions: Floats, cloth: Cloth) -> Floats:
    """Return the smaller and the larger principal stretch of each triangle, (T,F,2) [1].

    positions: (T,V,3) [m].

    >>> from benchmarks.meshes import right_grid
    >>> from reference_sim.cloth import Cloth
    >>> plane, faces = right_grid(2, 2, 1.0, 1.0)
    >>> sheet = np.column_stack([plane, 0.0 * plane[:, 0]])
    >>> principal_stretches(sheet[None] * [1.2, 0.9, 1.0], Cloth(sheet, faces))[0, 0].round(12).tolist()
    [0.9, 1.2]
    """
    faces, inverse = cloth.faces, cloth.Dm_inverse
    first = positions[:, faces[:, 1]] - positions[:, faces[:, 0]]
    second = positions[:, faces[:, 2]] - positions[:, faces[:, 0]]
    along = first * inverse[:, 0, 0, None] + second * inverse[:, 1, 0, None]  # columns of F, (T,F,3)
    across = first * inverse[:, 0, 1, None] + second * inverse[:, 1, 1, None]
    mean = 0.5 * ((along**2).sum(-1) + (across**2).sum(-1))
    half = 0.5 * ((along**2).sum(-1) - (across**2).sum(-1))
    radius = np.hypot(half, (along * across).sum(-1))
    return np.sqrt(np.stack([np.maximum(mean - radius, 0.0), mean + radius], axis=-1))


def weighted_percentiles(values: Floats, weights: Floats, percentiles: tuple[int, ...]) -> Floats:
    """Return for each percentile the least of the values that, with all below it, has that share of weight.

    >>> weighted_percentiles(np.array([3.0, 1.0, 2.0]), np.array([1.0, 1.0, 8.0]), (5, 50, 95)).tolist()
    [1.0, 2.0, 3.0]
    """
    order = np.argsort(values, axis=None, kind="stable")
    cumulated = np.cumsum(weights.ravel()[order])
    places = np.searchsorted(cumulated, np.array(percentiles) / 100.0 * cumulated[-1])
    return values.ravel()[order][np.minimum(places, len(order) - 1)]


Indices = NDArray[np.int64]

_metric_shape = partial(Metric, table="shape")

SHAPE_METRICS = (
    _metric_shape(name="deformation/edges", unit="%", title="Edges",
            definition="|length / rest length - 1|, mean over edges and frames"),
    _metric_shape(name="deformation/areas", unit="%", title="Areas",
            definition="|area / rest area - 1|, mean over faces and frames"),
    _metric_shape(name="dihedral/mean", unit="deg", title="Folds",
            definition="angle between the normals of the two faces of an inner edge, mean over edges and "
            "frames"),
    _metric_shape(name="intersections/triangles", unit="%", title="Self-cut", lower_is_better=True,
            definition="triangles that pass through another one of the same cloth, mean over frames"),
    _metric_shape(name="intersections/contours", unit="m", title="Contours", table="intersections",
            lower_is_better=True,
            definition="length of the lines in which triangles of the cloth pass through others of it, mean "
            "over frames"),
)  # fmt: skip


def measure_shape(roll_out: RollOut) -> dict[str, float]:
    """Return changes of edges and areas [%], folds [degrees] and self-intersections [%], [m]."""
    from benchmarks.metrics.self_intersections import share_and_contours  # loads numba

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


_metric_mesh = partial(Metric, table="dependence")

MESH_METRICS = (
    _metric_mesh(name="mesh/vertices", unit="1", title="Vertices", definition="vertices of the garment"),
    _metric_mesh(name="mesh/edge", unit="mm", title="Edge", definition="mean length of its edges at rest"),
    _metric_mesh(name="mesh/steps", unit="1", title="Steps of a frame",
            definition="time steps that a frame is simulated in"),
)  # fmt: skip


def measure_mesh(roll_out: RollOut) -> dict[str, float]:
    """Return vertices, mean edge [mm] and steps of a frame; of the reference alone."""
    cloth = roll_out.scene.cloth
    if roll_out.entry.role != "reference":
        return {}
    return {
        "mesh/vertices": float(cloth.vertex_count),
        "mesh/edge": 1e3 * float(cloth.edge_lengths.mean()),
        "mesh/steps": float(roll_out.scene.substeps),
    }


BODY_SHAPE_METRICS = (
    Metric(
        name="body/shape", unit="1", title="Body shape",
        definition="norm of the body's shape coefficients, 0 for the mean body",
    ),
)  # fmt: skip


def measure_body_shape(roll_out: RollOut) -> dict[str, float]:
    """Return the norm of the shape coefficients; of the reference alone."""
    dressed = roll_out.scene.dressed
    if roll_out.entry.role != "reference" or dressed is None:
        return {}
    return {"body/shape": 0.0 if dressed.betas is None else float(np.linalg.norm(dressed.betas))}


SHAPE = Measurements("shape", SHAPE_METRICS, measure=measure_shape)

STRETCH = Measurements("stretch", STRETCH_METRICS, measure=measure_stretch)

MESH = Measurements("mesh", MESH_METRICS, measure=measure_mesh, where_named=True)

BODY_SHAPE = Measurements("body_shape", BODY_SHAPE_METRICS, measure=measure_body_shape, where_named=True)
