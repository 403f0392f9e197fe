"""Metrics body/self_intersection*: does the body pass through itself? Cloth in such a fold has no place.

Asked of the motion, so of the reference's rows alone.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from benchmarks.metric import Metric

if TYPE_CHECKING:
    from benchmarks.metric import RollOut

SAMPLED_FRAMES = 24  # frames that are looked at, evenly spaced
OFFSET = 1e-3  # [m] off the skin, where a point is inside the body only if another part of it is there

METRICS = (
    Metric(
        name="body/self_intersection", unit="%", title="Body in itself", lower_is_better=True,
        definition="vertices of the body inside another part of it and not so at rest, in the worst of 24 "
        "evaluated frames",
    ),
    Metric(
        name="body/self_intersection_frame", unit="1", title="Worst frame",
        definition="the frame of these in which most vertices of the body are inside another part of it",
    ),
)  # fmt: skip


def measure(roll_out: RollOut) -> dict[str, float]:
    """Return the share of vertices in the worst sampled frame [%], and that frame; of the reference alone."""
    scene, frames = roll_out.scene, len(roll_out.positions)
    if roll_out.entry.role != "reference" or scene.dressed is None or scene.obstacle is None:
        return {}
    faces, rest = scene.obstacle.faces, scene.dressed.body.shaped(scene.dressed.betas)
    at_rest = inside_itself(rest, faces)  # eyes in their sockets
    judged = np.unique(np.linspace(scene.warm_up, frames - 1, SAMPLED_FRAMES).round().astype(int))
    share = [(inside_itself(scene.obstacle.at(frame), faces) & ~at_rest).mean() for frame in judged]
    worst = int(np.argmax(share))
    return {
        "body/self_intersection": 100.0 * float(share[worst]),
        "body/self_intersection_frame": float(judged[worst]),
    }


def inside_itself(x: NDArray[np.float64], faces: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Return which vertices x (B,3) [m] of a closed surface, faces (F,3) outward, are inside another part.

    There the winding number of the surface around a point a little off the vertex, along its normal, is one.
    """
    from reference_sim.geometry.surface import vertex_normals, winding_numbers  # loads numba

    return winding_numbers(x, faces, x + OFFSET * vertex_normals(x, faces)) > 0
