"""Metrics distance/*, penetration/*, deformation/*: from other cloths, into the body, from rest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.metric import Measurements, metrics_of

if TYPE_CHECKING:
    from benchmarks.metric import Faces, Floats, Positions, RollOut, SceneRollOuts, Vertices
    from reference_sim.obstacle import Obstacle

MM = 1e3
DEEP = 5e-3  # [m] below the skin: what an eye sees


def compare(roll_out: RollOut, reference: RollOut) -> dict[str, float]:
    """Return distances [mm] of the same vertices to the reference's; empty of another mesh."""
    if roll_out.entry.other_mesh:
        return {}
    frames = roll_out.match_frames(reference.positions)
    x, y = roll_out.positions[frames], reference.positions[frames]
    return {
        "distance/rms": rms(x, y),
        "distance/p95": MM * float(np.percentile(np.linalg.norm(x - y, axis=2), 95)),
    }


def measure(roll_out: RollOut) -> dict[str, float]:
    """Return shares [%] of vertices and area inside the obstacle and depth [mm] over the evaluated frames."""
    scene, x, frames = roll_out.scene, roll_out.positions, roll_out.judged
    if scene.obstacle is None:
        return {}
    inside = inside_of(roll_out)
    depth = inside.depth[frames]
    values = {
        "penetration/vertices": 100.0 * float(inside.share[frames].mean()),
        "penetration/surface": 100.0 * float(inside.area[frames].mean()),
        "penetration/deep": 100.0 * float((depth > DEEP).mean()),
        "penetration/depth_p99": MM * float(np.percentile(depth, 99)),
    }
    if not roll_out.entry.other_mesh:
        part_depth = own_part_depth(x, scene.obstacle, scene.cloth.rest_positions)[frames]
        values["penetration/own_part_p999"] = MM * float(np.percentile(part_depth, 99.9))
    return values


def inside_of(roll_out: RollOut) -> Penetration:
    """Return the penetration of a roll-out; that of all of the scene's mesh is computed at once."""
    group = roll_out.group
    return (group.get(_measure) if roll_out in group.roll_outs else _inside([roll_out]))[roll_out]


def _measure(group: SceneRollOuts) -> dict[RollOut, Penetration]:
    return _inside(group.roll_outs)


def _inside(roll_outs: Sequence[RollOut]) -> dict[RollOut, Penetration]:
    obstacle = roll_outs[0].scene.obstacle
    assert obstacle is not None
    positions, faces = zip(*((roll_out.positions, roll_out.trajectory.faces) for roll_out in roll_outs))
    return dict(zip(roll_outs, penetration(positions, faces, obstacle)))


def rms(x: Positions, y: Positions) -> float:
    """Return the root mean square distance [mm] between the same vertices of x and y, over all frames.

    >>> import numpy as np
    >>> rms(np.zeros((2, 4, 3)), np.full((2, 4, 3), [0.003, 0.0, 0.004]))
    5.0
    """
    return MM * float(np.sqrt((distance_rms(x, y) ** 2).mean()))


def distance_rms(positions: Positions, reference: Positions) -> Floats:
    """Return the root mean square distance between the same vertices of each frame, (T,) [m].

    Two accurate solvers of one wrinkling step differ by centimetres, since it has several minima.
    """
    return np.sqrt(((positions - reference) ** 2).sum(2).mean(1))


@dataclass(frozen=True)
class Penetration:
    """Penetration of every frame: shares of vertices and of area, and depth (0 outside)."""

    share: Floats  # (T,) of the vertices [1]
    depth: Floats  # (T,V) [m]
    area: Floats  # (T,) share of the area [1]


class SurfaceSamples:
    """Points of a triangle mesh whose weights give integrals over its area.

    The seven-point rule of degree 3 for triangles: vertices, midpoints of edges and centroid have weights
    of 1/20, 2/15 and 9/20 of a triangle's area, and integrals of cubic polynomials are exact.

    >>> import numpy as np
    >>> x = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    >>> samples = SurfaceSamples(np.array([[0, 2, 1]]))
    >>> samples.points(x).shape, round(float(samples.weights(x) @ samples.points(x)[:, 0] ** 3), 12)
    ((7, 3), 0.05)
    """

    def __init__(self, faces: Faces) -> None:
        self.faces = faces
        sides = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
        self.edges, places = np.unique(sides, axis=0, return_inverse=True)
        self.edges_of_faces = places.reshape(-1, 3)

    def points(self, x: Vertices) -> Floats:
        """Return vertices, midpoints of edges and centroids (V+E+F,3) [m]."""
        return np.concatenate([x, x[self.edges].mean(axis=1), x[self.faces].mean(axis=1)])

    def weights(self, x: Vertices) -> Floats:
        """Return the weight [m^2] of each of these points (V+E+F,); their sum is the area."""
        sides = x[self.faces[:, 1:]] - x[self.faces[:, :1]]
        areas = 0.5 * np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
        of_vertices = np.bincount(self.faces.ravel(), np.repeat(areas / 20.0, 3), len(x))
        of_edges = np.bincount(
            self.edges_of_faces.ravel(), np.repeat(areas * 2.0 / 15.0, 3), len(self.edges)
        )
        return np.concatenate([of_vertices, of_edges, 0.45 * areas])


def penetration(
    trajectories: Sequence[Positions], faces: Sequence[Faces], obstacle: Obstacle
) -> list[Penetration]:
    """Return how far each trajectory lies in the obstacle, by its signed distance.

    All trajectories are asked about together at each frame: the obstacle's search tree is made once.
    """
    samples = [SurfaceSamples(mesh) for mesh in faces]
    results = [
        Penetration(share=np.empty(len(x)), depth=np.empty(x.shape[:2]), area=np.empty(len(x)))
        for x in trajectories
    ]
    for frame in range(max(map(len, trajectories), default=0)):
        present = [k for k, positions in enumerate(trajectories) if frame < len(positions)]
        points = [samples[k].points(trajectories[k][frame]) for k in present]
        distances = np.asarray(obstacle.signed_distance(np.concatenate(points), frame))
        ends = np.cumsum([len(part) for part in points])
        for k, distance in zip(present, np.split(distances, ends[:-1])):
            x, inside = trajectories[k][frame], distance < 0.0
            weights = samples[k].weights(x)
            results[k].depth[frame] = np.maximum(0.0, -distance[: len(x)])
            results[k].share[frame] = inside[: len(x)].mean()
            # Of a cloth drawn together to a point nothing is inside or outside by area.
            results[k].area[frame] = weights @ inside / max(weights.sum(), np.finfo(float).tiny)
    return results


def own_part_depth(positions: Positions, obstacle: Obstacle, rest_positions: Vertices) -> Floats:
    """Return the depth of each vertex under the part of the body that it belongs to, (T,V) [m].

    It is measured against the faces near a vertex's own rest position alone.
    """
    depth = np.empty(positions.shape[:2])
    for frame, x in enumerate(positions):
        planes = obstacle.planes(np.ascontiguousarray(x), frame, rest_positions)
        gap = np.einsum("vi,vi->v", planes.normals, x - planes.points)
        depth[frame] = np.maximum(0.0, -gap)
    return depth


def measure_exact(roll_out: RollOut) -> dict[str, float]:
    """Return the largest distance of any vertex at any frame [m]; empty without an exact answer."""
    exact = roll_out.scene.exact
    if exact is None:
        return {}
    gaps = np.linalg.norm(roll_out.positions - exact[: len(roll_out.positions)], axis=2)
    return {"exact/distance": float(gaps.max())}


def measure_deformation(roll_out: RollOut) -> dict[str, float]:
    """Return how far edges and faces are from their size at rest [%], as GAPS (Chen et al. 2024).

    Source: class StVKLoss of its losses.py. What is pushed together counts as what is stretched.
    """
    cloth, x = roll_out.scene.cloth, roll_out.positions[roll_out.judged]
    lengths = np.linalg.norm(x[:, cloth.edges[:, 1]] - x[:, cloth.edges[:, 0]], axis=2)
    sides = x[:, cloth.faces[:, 1:]] - x[:, cloth.faces[:, :1]]
    areas = 0.5 * np.linalg.norm(np.cross(sides[:, :, 0], sides[:, :, 1]), axis=2)
    return {
        "deformation/edges": 100.0 * float(np.abs(lengths / cloth.edge_lengths - 1.0).mean()),
        "deformation/areas": 100.0 * float(np.abs(areas / cloth.areas - 1.0).mean()),
    }


GEOMETRY = Measurements(
    "geometry",
    metrics_of(
        ("distance/rms", "mm", "Distance",
         "root mean square distance between the same vertices of method and simulation"),
        ("distance/p95", "mm", "95 %", "95 % of these distances are smaller"),
        ("penetration/vertices", "%", "Penetration",
         "vertices inside the body (winding number above 0), none left out, mean over frames"),
        ("penetration/surface", "%", "Surface inside",
         "share of the cloth's present area inside the body: in a triangle each vertex counts 1/20, each "
         "side's midpoint 2/15, the centroid 9/20; mean over frames"),
        ("penetration/deep", "%", "Deep", "vertices more than 5 mm inside the body"),
        ("penetration/depth_p99", "mm", "Depth, 99 %",
         "99 % of all vertices and frames are less deep; 0 outside", {"table": ""}),
        ("penetration/own_part_p999", "mm", "Own part, 99.9 %",
         "99.9th percentile of the depth below the part of the body that a vertex belongs to: cloth in "
         "the fold of a hip does not count"),
        table="penetration", lower_is_better=True,
    ),
    measure=measure, compare=compare, other_meshes=True,
)  # fmt: skip
DEFORMATION = Measurements(
    "deformation",
    metrics_of(
        ("deformation/edges", "%", "Edges", "|length / rest length - 1|, mean over edges and frames"),
        ("deformation/areas", "%", "Areas", "|area / rest area - 1|, mean over faces and frames"),
        table="deformation", lower_is_better=True,
    ),
    measure=measure_deformation,
)  # fmt: skip
EXACT = Measurements(
    "exact",
    metrics_of(
        ("exact/distance", "m", "From the exact answer",
         "largest distance of any vertex at any frame from backward Euler's own exact answer"),
        table="speed", lower_is_better=True,
    ),
    measure=measure_exact,
)  # fmt: skip
