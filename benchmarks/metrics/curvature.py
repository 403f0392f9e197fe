"""Metrics curvature/*: mean curvature of a triangle mesh, and its difference from another surface's.

At an interior vertex i with neighbours j and the two angles a_ij, b_ij opposite edge ij,

    H_i = | sum_j (cot a_ij + cot b_ij) (x_i - x_j) | / (4 A_i)                             [1/m]

with A_i the mixed Voronoi area (Meyer, Desbrun, Schröder and Barr 2003): the Voronoi cell where the
triangle is not obtuse, else half or a quarter of its area. H is a magnitude: it has no sign. At a
boundary vertex the formula means nothing, so those are left out.

The paper reports a "mean curvature error" without a definition. Wrinkles are compared by the
distribution of H over the area of a frame, wherever they lie:
    integral | F(H) - F^ref(H) | dH              F the share of the area with less curvature,
averaged over frames; the difference of the two means of H says to which side. The error of each vertex,
    sum_i A_i | H_i - H_i^ref | / sum_i A_i      over interior vertices, A_i of the reference,
punishes a wrinkle in another place twice: a simulation from another start has a large one too.

Whether wrinkles stay the same while the body moves ("the same despite the significant change in body
pose", the paper says of PBNS) is told by
    sum_ti A_i | H_ti - median_t H_ti | / sum_ti A_i | H_ti - mean H |      with A_i the mean over frames,
however deep the wrinkles are.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.metric import Measurements, metrics_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from benchmarks.metric import Faces, Floats, Positions, RollOut, Vertices

FLAT = 1e-6  # spread of H times the cloth's length: less is round-off


def measure(roll_out: RollOut) -> dict[str, float]:
    """Return mean curvature and change of wrinkles over evaluated frames; empty without interior."""
    part = roll_out.get(series_of).part(roll_out.judged)
    if not part.area.any():
        return {}
    values = {"curvature/mean": float(part.means().mean())}
    change = curvature_change(part)
    return values if change is None else values | {"curvature/change": change}


def compare(roll_out: RollOut, reference: RollOut) -> dict[str, float]:
    """Return distance of distributions, difference of means and vertex-wise error against the reference.

    Empty where the mesh has no interior vertex.
    """
    frames = roll_out.match_frames(reference.positions)
    ours, theirs = roll_out.get(series_of).part(frames), reference.get(series_of).part(frames)
    if not theirs.area.any():
        return {}
    return {
        "curvature/histogram": float(histogram_distance(ours, theirs).mean()),
        "curvature/mean_difference": float((ours.means() - theirs.means()).mean()),
        "curvature/error": float(curvature_error(ours, theirs).mean()),
    }


def series(roll_out: RollOut) -> dict[str, Floats]:
    """Return the mean curvature of each frame, (T,) [1/m]."""
    return {"curvature/mean": roll_out.get(series_of).means()}


def series_of(roll_out: RollOut) -> CurvatureSeries:
    """Return curvature and areas of all frames of a roll-out."""
    return curvature_series(roll_out.positions, roll_out.scene.cloth.faces)


def boundary_mask(faces: Faces, vertices: int) -> NDArray[np.bool_]:
    """Return a mask (V,), True on vertices of edges with one triangle and on vertices of none."""
    edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    unique, counts = np.unique(edges, axis=0, return_counts=True)
    mask = np.ones(vertices, dtype=bool)
    mask[faces] = False
    mask[unique[counts == 1]] = True
    return mask


def mean_curvature(x: Vertices, faces: Faces) -> tuple[Floats, Floats]:
    """Return the magnitude of mean curvature (V,) [1/m] and the mixed Voronoi area (V,) [m^2] of each vertex.

    Values at boundary vertices are returned as computed; mask them with `boundary_mask`. A vertex of zero
    area gets curvature 0.

    >>> from benchmarks.meshes import icosphere
    >>> round(float(mean_curvature(*icosphere(3, 0.25))[0].mean()), 3)
    4.0
    """
    corners, count, tiny = x[faces], len(x), np.finfo(float).tiny  # (F,3,3)
    opposite = np.roll(corners, -1, axis=1) - np.roll(corners, -2, axis=1)  # edge facing each corner
    squared = (opposite**2).sum(-1)  # (F,3) its squared length
    doubled = np.linalg.norm(np.cross(opposite[:, 0], opposite[:, 1]), axis=-1)  # (F,) twice the area
    # cos times the two adjacent lengths, over sin times the same lengths
    dots = 0.5 * squared.sum(-1, keepdims=True) - squared
    cotangents = dots / np.maximum(doubled, tiny)[:, None]  # (F,3)

    weighted = squared * cotangents
    voronoi = (weighted.sum(-1, keepdims=True) - weighted) / 8.0
    obtuse = dots < 0.0
    share = np.where(obtuse, 0.25, 0.125) * doubled[:, None]
    areas = np.where(obtuse.any(-1, keepdims=True), share, voronoi)

    area = np.asarray(np.bincount(faces.ravel(), areas.ravel(), count), dtype=float)
    pulls = cotangents[..., None] * opposite
    after, before = np.roll(faces, -1, axis=1).ravel(), np.roll(faces, -2, axis=1).ravel()
    laplacian = np.empty((count, 3))  # sum_j (cot a_ij + cot b_ij) (x_i - x_j)
    for axis in range(3):
        pull = pulls[..., axis].ravel()
        laplacian[:, axis] = np.bincount(after, pull, count) - np.bincount(before, pull, count)
    norm = np.linalg.norm(laplacian, axis=-1)
    return np.divide(norm, 4.0 * area, out=np.zeros(count), where=area > tiny), area


@dataclass(frozen=True)
class CurvatureSeries:
    """Curvature (T,V) [1/m], and area (T,V) [m^2] with 0 at boundary vertices, which so weigh nothing."""

    curvature: Floats
    area: Floats

    def means(self) -> Floats:
        """Return the area-weighted mean over interior vertices, (T,) [1/m]."""
        return _average(self.curvature, self.area)

    def part(self, frames: slice) -> CurvatureSeries:
        """Return the series of these frames."""
        return CurvatureSeries(self.curvature[frames], self.area[frames])


def curvature_series(positions: Positions, faces: Faces) -> CurvatureSeries:
    """Return curvature and areas of every frame."""
    frames = [mean_curvature(x, faces) for x in positions]
    curvature, area = (
        np.array([pair[k] for pair in frames]).reshape(positions.shape[:2]) for k in (0, 1)
    )
    area[:, boundary_mask(faces, positions.shape[1])] = 0.0
    return CurvatureSeries(curvature, area)


def curvature_error(series: CurvatureSeries, reference: CurvatureSeries) -> Floats:
    """Return the mean |H - H_ref| of each frame, (T,) [1/m], by the areas of the reference."""
    return _average(np.abs(series.curvature - reference.curvature), reference.area)


def _average(values: Floats, weights: Floats) -> Floats:
    total = weights.sum(1)
    return np.divide((values * weights).sum(1), total, out=np.zeros(len(total)), where=total > 0.0)


def curvature_change(series: CurvatureSeries) -> float | None:
    """Return the part of all spread of curvature that is in time [1], 0 to 1; None for a constant H.

    A vertex's absolute deviations are least about its own median, so the quotient is at most 1.
    """
    h, area = series.curvature, series.area.mean(0)
    total_area = float(area.sum())
    mean = float((h @ area).mean()) / total_area if total_area > 0.0 else 0.0
    spread = float((np.abs(h - mean) @ area).mean())
    if spread <= FLAT * np.sqrt(total_area):
        return None
    return float((np.abs(h - np.median(h, axis=0)) @ area).mean()) / spread


def histogram_distance(series: CurvatureSeries, reference: CurvatureSeries) -> Floats:
    """Return the Wasserstein-1 distance of the distributions of H by area in each frame, (T,) [1/m]."""
    pairs = zip(series.curvature, series.area, reference.curvature, reference.area)
    return np.array([_wasserstein(*pair) for pair in pairs])


def _wasserstein(h: Floats, area: Floats, h_ref: Floats, area_ref: Floats) -> float:
    """Return the integral of |F - F_ref| over H; 0 where one side has no interior vertex."""
    if area.sum() == 0.0 or area_ref.sum() == 0.0:
        return 0.0
    values = np.concatenate([h, h_ref])
    steps = np.concatenate([area / area.sum(), -area_ref / area_ref.sum()])
    order = np.argsort(values, kind="stable")
    between = np.diff(values[order])
    return float(np.abs(np.cumsum(steps[order])[:-1]) @ between)


CURVATURE = Measurements(
    "curvature",
    metrics_of(
        ("curvature/mean", "1/m", "Mean curvature",
         "H, magnitude of the mean curvature (cotangent Laplacian over mixed Voronoi areas), mean over "
         "interior vertices by area and over frames"),
        ("curvature/histogram", "1/m", "Curvature, distribution",
         "Wasserstein-1 distance between the area-weighted distributions of H in each frame, mean",
         {"lower_is_better": True}),
        ("curvature/mean_difference", "1/m", "Difference of means",
         "area-weighted mean of H less that of the reference"),
        ("curvature/error", "1/m", "Curvature, vertex-wise error",
         "|H - H_ref| of the same vertices and frames, mean by the reference's areas",
         {"lower_is_better": True}),
        ("curvature/change", "1", "Change of wrinkles",
         "share of the scatter of curvature that is change over time: mean |H - median of the vertex over "
         "frames| divided by mean |H - mean of all vertices and frames|, weighted by each vertex's mean "
         "area; 0 where wrinkles never change, at most 1"),
        table="curvature",
    ),
    measure=measure, compare=compare, series=series,
)  # fmt: skip
