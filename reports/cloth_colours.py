"""Colours of cloths: values of vertices by method, and the scales that show them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse

from benchmarks.metrics.curvature import curvature_series
from reference_sim.geometry.topology import corner_areas
from reference_sim.obstacle import Obstacle
from reports.figures.chosen_roll_outs import SceneRollOuts
from reports.run.stored_files import STEP

if TYPE_CHECKING:
    from matplotlib.colors import Colormap

MM = 1e3


def mean_curvature(positions: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return the magnitude of the mean curvature (T,V) [1/m] of positions (T,V,3) [m]; 0 on boundaries."""
    series = curvature_series(positions, faces)
    return np.where(series.area > 0.0, series.curvature, 0.0)


def area_change(positions: np.ndarray, faces: np.ndarray, rest_areas: np.ndarray) -> np.ndarray:
    """Return area over rest area less 1 (T,V) [%], mean over a vertex's faces by rest_areas (F,) [m^2]."""
    areas = corner_areas(positions[:, faces].reshape(-1, 3, 3)).reshape(len(positions), -1)
    gather = _gather(faces, positions.shape[1])
    rest = gather @ np.repeat(rest_areas, 3)
    now = (gather @ np.repeat(areas, 3, axis=1).T).T
    return 100.0 * (np.divide(now, rest, out=np.ones_like(now), where=rest > 0.0) - 1.0)


def distance(positions: np.ndarray, reference: np.ndarray) -> np.ndarray:
    """Return the distance (T,V) [mm] between the same vertices of positions (T,V,3) [m] and a reference.

    The reference has as many frames or more.
    """
    return MM * np.linalg.norm(positions - reference[: len(positions)], axis=-1)


def depth(points: np.ndarray, skin: Obstacle, frame: int) -> np.ndarray:
    """Return the penetration (P,) [mm] of points (P,3) [m] into the body at that frame, 0 outside.

    Inside is the side behind the normal of the nearest point: a winding number takes six times as long.
    """
    planes = skin.planes(np.ascontiguousarray(points, dtype=float), frame)
    return MM * np.maximum(-np.einsum("pi,pi->p", planes.normals, points - planes.points), 0.0)


def skin_of(positions: np.ndarray, faces: np.ndarray) -> Obstacle | None:
    """Return a body (T,B,3) [m], or (B,3), as an obstacle; None where its faces (F,3) do not close."""
    try:
        return Obstacle(positions, faces)
    except ValueError:
        return None


def _gather(corners: np.ndarray, count: int) -> scipy.sparse.csr_array:
    """Return (V,3F), which sums values at the corners of faces (F,3) over each vertex."""
    size = corners.size
    return scipy.sparse.csr_array((np.ones(size), (corners.ravel(), np.arange(size))), shape=(count, size))


FULL = 97.0  # percentile of the values of the worst method: it has the darkest colour
NOTHING = 1e-6  # of a scale's unit: what is less everywhere is not shown


@dataclass(frozen=True)
class Scale:
    """Scale that cloths are coloured by: title with its unit, and method -> (V,) values from 0 up."""

    title: str
    values: Mapping[str, np.ndarray]

    @property
    def top(self) -> float:
        """Value with the darkest colour."""
        return max(float(np.percentile(np.nan_to_num(values), FULL)) for values in self.values.values())

    def colours(self, method: str) -> np.ndarray:
        """Return colours (V,3), pale to dark in grey too."""
        share = np.nan_to_num(self.values[method]) / max(self.top, np.finfo(float).tiny)
        return colour_map()(np.clip(share, 0.0, 1.0))[:, :3]


def colour_map() -> Colormap:
    """Return the colours from pale to dark."""
    from matplotlib import colormaps

    return colormaps["YlOrRd"]


def error_scale(roll_outs: SceneRollOuts, methods: Sequence[str], frame: int, reference: str) -> Scale | None:
    """Return the scale of one-step errors at that frame where all methods have them, else of distances."""
    cloths = {method: roll_outs.series[method] for method in methods}
    values: dict[str, np.ndarray] = {}
    title = "one-step error [mm]"
    if roll_outs.has_steps(methods):
        values = {m: cloth.frame_fields[STEP][frame] for m, cloth in cloths.items()}
    elif reference in cloths:
        title, first = "from the simulation [mm]", cloths[reference]
        if all(np.array_equal(cloth.faces, first.faces) for cloth in cloths.values()):
            at = first.positions[frame]
            values = {m: distance(c.positions[frame][None], at[None])[0] for m, c in cloths.items()}
    scale = Scale(title, values)
    return scale if values and scale.top > NOTHING else None
