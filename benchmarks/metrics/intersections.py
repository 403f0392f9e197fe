"""Metrics intersections/swept, body/self_intersection*: cloth through itself, a body through itself.

Metric intersections/swept: cloth that passes through itself between two frames.

A frame without intersections may follow another one though a layer went through the other between them. On
the straight way of every vertex from one frame to the next a vertex meets a triangle, or an edge an edge,
where the four points are in one plane and their primitives touch (Provot 1997). Broad phase and test are
those of the package ipctk, by tight inclusion (Wang, Ferguson, Schneider, Jiang, Attene and Panozzo 2021).
Without the package nothing is measured, and nothing of a roll-out that has fallen apart.

Metrics body/self_intersection*: does the body pass through itself? Cloth in such a fold has no place.

Asked of the motion, so of the reference's rows alone.
"""

from __future__ import annotations

from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.metric import Measurements, Metric

if TYPE_CHECKING:
    from benchmarks.metric import RollOut

Floats = NDArray[np.float64]

SAMPLED_STEPS = 12  # pairs of consecutive frames that are looked at, evenly spread
FARTHEST = (
    1.0  # [m] beside the others that a vertex of a cloth moves in a frame: one that is lost moves further
)
MOST_PAIRS = 200_000  # to be tested one by one, in seconds: more have only lost cloths

SWEPT_METRICS = (
    Metric(
        name="intersections/swept", unit="1", title="Swept", table="intersections", lower_is_better=True,
        definition="pairs of a vertex and a triangle, or of two edges, of the cloth that pass through each "
        "other between two frames on straight ways; mean over 12 evaluated pairs of frames, needs ipctk",
    ),
)  # fmt: skip


def measure_swept(roll_out: RollOut) -> dict[str, float]:
    """Return the crossings of a step; empty without ipctk, where frames are left out, or of a lost cloth."""
    x, scene = roll_out.positions[roll_out.judged], roll_out.scene
    if len(x) < 2 or scene.kept is not None or find_spec("ipctk") is None:
        return {}
    steps = np.unique(np.linspace(0, len(x) - 2, SAMPLED_STEPS).round().astype(int))
    counts = [swept_crossings(x[step], x[step + 1], scene.cloth.faces) for step in steps]
    known = [count for count in counts if count is not None]
    return {"intersections/swept": float(np.mean(known))} if len(known) == len(counts) else {}


def swept_crossings(before: Floats, after: Floats, faces: NDArray[np.int64]) -> int | None:
    """Return how many pairs of primitives meet on the straight way from `before` to `after`; None if lost.

    A pair without a common vertex counts once. A motion of all vertices together changes nothing. A cloth is
    lost where a vertex moves by more than FARTHEST beside the others, or MOST_PAIRS are surpassed.

    Args:
        before: (V,3) [m].
        after: (V,3) [m].
        faces: (F,3).
    """
    import ipctk

    ipctk.set_logger_level(ipctk.error)  # its warnings go to standard output
    ipctk.set_num_threads(1)
    with np.errstate(over="ignore", invalid="ignore"):
        after = after - (after - before).mean(axis=0)  # shorter ways: fewer pairs to be tested
        if not np.abs(after - before).max() <= FARTHEST:
            return None
    triangles = np.asfortranarray(faces, dtype=np.int32)
    mesh = ipctk.CollisionMesh(np.asfortranarray(before), ipctk.edges(triangles), triangles)
    pairs = ipctk.Candidates()
    pairs.build(mesh, np.asfortranarray(before), np.asfortranarray(after), 0.0)
    if len(pairs) > MOST_PAIRS:
        return None
    # A rescaling of 1 asks for contact; with less, what comes within 0.1 mm counts already.
    test, edges = ipctk.TightInclusionCCD(conservative_rescaling=1.0), np.asarray(mesh.edges)
    points = [(pair.vertex_id, *faces[pair.face_id]) for pair in pairs.fv_candidates]
    sides = [(*edges[pair.edge0_id], *edges[pair.edge1_id]) for pair in pairs.ee_candidates]
    return _meeting(test.point_triangle_ccd, before, after, points) + _meeting(
        test.edge_edge_ccd, before, after, sides
    )


def _meeting(test: Any, before: Floats, after: Floats, quadruples: list[tuple[int, ...]]) -> int:
    """Return how many of the quadruples of vertices meet, by ipctk's test."""
    chosen = np.array(quadruples, dtype=np.int64).reshape(-1, 4)
    chosen = chosen[coplanar_on_the_way(before[chosen], after[chosen])]
    return sum(test(*a, *b)[0] for a, b in zip(before[chosen], after[chosen]))


def coplanar_on_the_way(before: Floats, after: Floats) -> NDArray[np.bool_]:
    """Return for which of N quadruples of points (N,4,3) [m] a plane may hold all four at once, (N,).

    Their volume is cubic in time: where its four Bernstein coefficients have one sign, it has no root.
    """
    u, v = before[:, 1:] - before[:, :1], after[:, 1:] - after[:, :1]

    def volumes(*ends: Floats) -> Floats:
        return np.linalg.det(np.stack([end[:, row] for row, end in enumerate(ends)], axis=1))

    coefficients = np.stack([
        volumes(u, u, u),
        volumes(v, u, u) + volumes(u, v, u) + volumes(u, u, v),
        volumes(v, v, u) + volumes(v, u, v) + volumes(u, v, v),
        volumes(v, v, v),
    ])  # fmt: skip
    low, high = coefficients.min(axis=0), coefficients.max(axis=0)
    return (low <= 0.0) & (high >= 0.0)


SAMPLED_FRAMES = 24  # frames that are looked at, evenly spaced
OFFSET = 1e-3  # [m] off the skin, where a point is inside the body only if another part of it is there

BODY_METRICS = (
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


def measure_body(roll_out: RollOut) -> dict[str, float]:
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


SWEPT = Measurements("swept", SWEPT_METRICS, measure=measure_swept)

BODY = Measurements("body", BODY_METRICS, measure=measure_body)
