"""Metrics mesh/*, body/*: how fine a scene is, how unusual its body; in the reference's rows alone."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from benchmarks.metric import Measurements, metrics_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from benchmarks.metric import Faces, RollOut, Vertices

SAMPLED_FRAMES = 24  # frames that are looked at, evenly spaced
# So far off the skin a point is inside the body only if another part of it is there.
OFFSET = 1e-3  # [m]


def measure_mesh(roll_out: RollOut) -> dict[str, float]:
    """Return vertices, mean edge [mm] and steps of a frame."""
    cloth = roll_out.scene.cloth
    if roll_out.entry.role != "reference":
        return {}
    return {
        "mesh/vertices": float(cloth.vertex_count),
        "mesh/edge": 1e3 * float(cloth.edge_lengths.mean()),
        "mesh/steps": float(roll_out.scene.substeps),
    }


def measure_body_shape(roll_out: RollOut) -> dict[str, float]:
    """Return the norm of the shape coefficients."""
    dressed = roll_out.scene.dressed
    if roll_out.entry.role != "reference" or dressed is None:
        return {}
    return {"body/shape": 0.0 if dressed.betas is None else float(np.linalg.norm(dressed.betas))}


def measure_body(roll_out: RollOut) -> dict[str, float]:
    """Return the share of the body's vertices inside another part of it [%] in the worst sampled frame.

    Cloth in such a fold has no place. Also that frame.
    """
    scene, frames = roll_out.scene, len(roll_out.positions)
    if roll_out.entry.role != "reference" or scene.dressed is None or scene.obstacle is None:
        return {}
    faces, rest = scene.obstacle.faces, scene.dressed.body.rest_vertices(scene.dressed.betas)
    at_rest = inside_itself(rest, faces)  # eyes in their sockets
    samples = np.unique(np.linspace(scene.warm_up, frames - 1, SAMPLED_FRAMES).round().astype(int))
    share = [(inside_itself(scene.obstacle.at(frame), faces) & ~at_rest).mean() for frame in samples]
    worst = int(np.argmax(share))
    return {
        "body/self_intersection": 100.0 * float(share[worst]),
        "body/self_intersection_frame": float(samples[worst]),
    }


def inside_itself(x: Vertices, faces: Faces) -> NDArray[np.bool_]:
    """Return which vertices of a closed surface are inside another part of it.

    There the winding number of the surface around a point a little off the vertex, along its normal, is
    one.
    """
    from reference_sim.geometry.surface import vertex_normals, winding_numbers  # loads numba

    return winding_numbers(x, faces, x + OFFSET * vertex_normals(x, faces)) > 0


MESH = Measurements(
    "mesh",
    metrics_of(
        ("mesh/vertices", "1", "Vertices", "vertices of the garment"),
        ("mesh/edge", "mm", "Edge", "mean length of its edges at rest"),
        ("mesh/steps", "1", "Steps of a frame", "time steps that a frame is simulated in"),
        table="dependence",
    ),
    measure=measure_mesh,
    where_named=True,
)
BODY_SHAPE = Measurements(
    "body_shape",
    metrics_of(
        ("body/shape", "1", "Body shape", "norm of the body's shape coefficients, 0 for the mean body"),
    ),
    measure=measure_body_shape,
    where_named=True,
)
BODY = Measurements(
    "body",
    metrics_of(
        ("body/self_intersection", "%", "Body in itself", "vertices of the body inside another part of it "
         "and not so at rest, in the worst of 24 evaluated frames", {"lower_is_better": True}),
        ("body/self_intersection_frame", "1", "Worst frame", "the frame of these in which most vertices of "
         "the body are inside another part of it"),
    ),
    measure=measure_body,
)  # fmt: skip
