"""Measurements of one trajectory under the names and in the units of the results table."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np

from .metrics.curvature import CurvatureSeries, curvature_error, histogram_distance
from .metrics.geometry import Penetration, distance_rms, hem_drift, own_part_depth
from .metrics.optimality import FINDERS
from .metrics.shape import area_change, dihedral_angle, edge_change

if TYPE_CHECKING:
    from .scene import BuiltScene

MM = 1e3
DEEP = 5e-3  # [m] below the skin: what an eye sees

UNITS = {
    "energy": "J", "curvature": "1/m", "distance": "mm", "penetration/vertices": "%",
    "penetration/deep": "%", "penetration": "mm", "intersections": "%", "deformation": "%",
    "dihedral": "deg", "drift": "mm", "dynamics": "mm", "dynamics/amplitude": "1",
    "dynamics/correlation": "1", "dynamics/gain": "1", "dynamics/spectrum": "1", "dynamics/lag": "frames",
    "gap": "1", "gap/energy": "J", "gradient": "1", "exact": "m",
    "time_error/curvature": "1/m", "time_error/order": "1", "time_error": "J",
    "cost/frame": "ms", "cost/batch": "ms", "cost/spread": "%", "cost/peak": "MB",
    "cost/data": "s", "cost/setup": "s", "cost/train": "s", "cost/memory": "MB",
} | {f"gap/found_by_{finder}": "frames" for finder in FINDERS}  # fmt: skip


def unit_of(metric: str) -> str:
    """The unit of a metric by its whole name, else by its family."""
    return UNITS.get(metric) or UNITS[metric.split("/")[0]]


@dataclasses.dataclass(frozen=True)
class Reference:
    """The simulation of a scene, with its curvature, which every other method is measured against.

    floor: how far [mm] the same simulation comes to lie from a start moved by 1e-9 m; None if not run.
    """

    positions: np.ndarray
    curvature: CurvatureSeries
    floor: float | None = None


def shape(scene: BuiltScene, x: np.ndarray) -> dict[str, float]:
    """Edges, areas and folds of x (T,V,3) [m], and triangles that pass through others: means over frames."""
    from .metrics.intersections import intersecting_share

    cloth = scene.cloth
    return {
        "deformation/edges": 100.0 * float(edge_change(x, cloth.edges, cloth.edge_lengths).mean()),
        "deformation/areas": 100.0 * float(area_change(x, cloth.faces, cloth.areas).mean()),
        "dihedral/mean": float(np.rad2deg(dihedral_angle(x, cloth.hinges).mean())),
        "intersections/triangles": 100.0 * float(intersecting_share(x, cloth.faces).mean()),
    }


def contact(scene: BuiltScene, x: np.ndarray, inside: Penetration) -> dict[str, float]:
    """How well the cloth keeps out of the obstacle and stays where it belongs."""
    assert scene.obstacle is not None
    own = own_part_depth(x, scene.obstacle, scene.cloth.rest_positions)
    found = {
        "penetration/vertices": 100.0 * float(inside.share.mean()),
        "penetration/deep": 100.0 * float((inside.depth > DEEP).mean()),
        "penetration/depth_p99": MM * float(np.percentile(inside.depth, 99)),
        "penetration/own_part_p999": MM * float(np.percentile(own, 99.9)),
    }
    if scene.dressed is not None and scene.origin_heights is not None:
        found["drift/hem"] = MM * hem_drift(x, scene.dressed.garment.hem, scene.origin_heights)
    return found


def against(x: np.ndarray, curvature: CurvatureSeries, reference: Reference) -> dict[str, float]:
    """Differences to the reference over the frames that both have."""
    frames = min(len(x), len(reference.positions))
    theirs = CurvatureSeries(reference.curvature.curvature[:frames], reference.curvature.area[:frames])
    ours = CurvatureSeries(curvature.curvature[:frames], curvature.area[:frames])
    apart = np.linalg.norm(x[:frames] - reference.positions[:frames], axis=2)
    found = {
        "curvature/error": float(curvature_error(ours, theirs).mean()),
        "curvature/histogram": float(histogram_distance(ours, theirs).mean()),
        "curvature/mean_difference": float((ours.means() - theirs.means()).mean()),
        "distance/rms": rms(x[:frames], reference.positions[:frames]),
        "distance/p95": MM * float(np.percentile(apart, 95)),
    }
    return found if reference.floor is None else found | {"distance/floor": reference.floor}


def rms(x: np.ndarray, y: np.ndarray) -> float:
    """Root mean square distance [mm] between the vertices of x and y (T,V,3) [m], over all frames."""
    return MM * float(np.sqrt((distance_rms(x, y) ** 2).mean()))
