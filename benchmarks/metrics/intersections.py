"""Metrics intersections/*: a cloth through itself, in a frame and between two frames.

On the straight way of every vertex from one frame to the next a vertex meets a triangle, or an edge an
edge, where the four points are in one plane and their primitives touch (Provot 1997). Broad phase and test
are those of the package ipctk, by tight inclusion (Wang et al. 2021).
"""

from __future__ import annotations

from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.metric import Measurements, metrics_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from benchmarks.metric import Faces, Floats, RollOut, Vertices

SAMPLED_STEPS = 12  # pairs of consecutive frames that are looked at, evenly spread
# No vertex moves as far beside the others in a frame, but one that is lost.
FARTHEST = 1.0  # [m]
MOST_PAIRS = 200_000  # tested one by one, in seconds: lost cloths have more, and fine ones in motion


def measure_triangles(roll_out: RollOut) -> dict[str, float]:
    """Return the share of triangles that intersect another [%] and the length of contours [m]."""
    from benchmarks.metrics.self_intersections import self_intersections  # loads numba

    faces = roll_out.scene.cloth.faces
    frames = [
        self_intersections(np.ascontiguousarray(x), faces) for x in roll_out.positions[roll_out.judged]
    ]
    return {
        "intersections/triangles": 100.0 * float(np.mean([hit.mean() for hit, _ in frames])),
        "intersections/contours": float(np.mean([length for _, length in frames])),
    }


def measure_swept(roll_out: RollOut) -> dict[str, float]:
    """Return the crossings of a step; empty without ipctk, in left-out frames, of too many pairs."""
    x, scene = roll_out.positions[roll_out.judged], roll_out.scene
    if len(x) < 2 or scene.kept is not None or find_spec("ipctk") is None:
        return {}
    steps = np.unique(np.linspace(0, len(x) - 2, SAMPLED_STEPS).round().astype(int))
    counts = [swept_crossings(x[step], x[step + 1], scene.cloth.faces) for step in steps]
    crossings = [count for count in counts if count is not None]
    return {"intersections/swept": float(np.mean(crossings))} if len(crossings) == len(counts) else {}


def swept_crossings(before: Vertices, after: Vertices, faces: Faces) -> int | None:
    """Return how many pairs of primitives meet on the straight way from `before` to `after`, or None.

    A pair without a common vertex counts once. A motion of all vertices together changes nothing. None
    where a vertex moves by more than FARTHEST beside the others, or MOST_PAIRS are surpassed.
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


def _meeting(test: Any, before: Vertices, after: Vertices, quadruples: list[tuple[int, ...]]) -> int:
    """Return how many of the quadruples of vertices meet, by ipctk's test."""
    chosen = np.array(quadruples, dtype=np.int64).reshape(-1, 4)
    chosen = chosen[find_coplanar(before[chosen], after[chosen])]
    return sum(test(*a, *b)[0] for a, b in zip(before[chosen], after[chosen]))


def find_coplanar(before: Floats, after: Floats) -> NDArray[np.bool_]:
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


INTERSECTIONS = Measurements(
    "intersections",
    metrics_of(
        ("intersections/triangles", "%", "Self-cut",
         "triangles that pass through another one of the cloth without a common vertex, mean over frames"),
        ("intersections/contours", "m", "Contours",
         "length of the lines in which triangles of the cloth pass through others of it without a common "
         "vertex, mean over frames"),
        ("intersections/swept", "1", "Swept",
         "pairs of a vertex and a triangle, or of two edges, without a common vertex that meet on straight "
         "ways to the next frame; mean over 12 steps, needs ipctk"),
        table="intersections", lower_is_better=True,
    ),
    measure=lambda roll_out: measure_triangles(roll_out) | measure_swept(roll_out),
)  # fmt: skip
