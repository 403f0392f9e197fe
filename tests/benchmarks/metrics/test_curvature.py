"""Curvature and its errors: noise, slivers, and wrinkles that move.

The suite `validation` holds it to spheres, tori and cylinders.
"""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from benchmarks.meshes import right_grid
from benchmarks.metric import RollOut, SceneRollOuts
from benchmarks.metrics.curvature import (
    CurvatureSeries,
    boundary_mask,
    compare,
    curvature_change,
    curvature_error,
    curvature_series,
    histogram_distance,
    mean_curvature,
    measure,
)
from reference_sim import Trajectory
from reference_sim.geometry.topology import corner_areas
from reports.statistics.paper_claims import CLAIMS


def test_curvature_of_random_points_on_a_sphere_is_right_and_of_irregular_slivers_too_large():
    """Mean curvature on a sphere and on slivers has the errors that the documents state."""
    random = np.random.default_rng(0)
    x = random.normal(size=(500, 3))
    x /= np.linalg.norm(x, axis=1)[:, None]
    faces = ConvexHull(x).simplices.astype(np.int64)
    assert not boundary_mask(faces, len(x)).any()
    curvature, areas = mean_curvature(x, faces)
    assert np.average(curvature, weights=areas) == pytest.approx(1.002, abs=5e-4)
    _, faces = right_grid(20, 20, 1.0, 1.0)
    place = np.stack(np.unravel_index(np.arange(21 * 21), (21, 21)), axis=1)
    across, along = ((place + random.uniform(-0.3, 0.3, place.shape)) * (0.03, 0.003)).T
    x = np.stack([np.cos(along) * np.cos(across), np.cos(along) * np.sin(across), np.sin(along)], axis=1)
    inside = ((place > 0) & (place < 20)).all(axis=1)
    curvature, areas = mean_curvature(x, faces)
    assert 2.5 < np.average(curvature[inside], weights=areas[inside]) < 3.5


def test_a_ribbon_without_interior_vertices_has_no_curvature():
    x = np.array([[[0.1 * n, 0.0, 0.1 * side] for n in range(5) for side in (0, 1)]])
    faces = np.array([t for n in range(0, 8, 2) for t in ((n, n + 1, n + 2), (n + 1, n + 3, n + 2))])
    scene = SimpleNamespace(cloth=SimpleNamespace(faces=faces), warm_up=0)
    group = SceneRollOuts(scene)
    roll_outs = [RollOut(group, SimpleNamespace(), Trajectory(x, faces, np.zeros(1))) for _ in range(2)]
    assert measure(roll_outs[0]) == {} and compare(*roll_outs) == {}


def test_curvature_of_a_plane_is_zero_and_noise_gives_the_published_floor():
    random = np.random.default_rng(3)
    cells, h = 40, 0.015
    i, j = np.meshgrid(np.arange(cells + 1), np.arange(cells + 1), indexing="ij")
    flat = np.stack([h * i, 0.0 * i, h * j], -1).reshape(-1, 3)
    faces = right_grid(cells, cells, 1.0, 1.0)[1]
    inside = ~boundary_mask(faces, len(flat))
    assert mean_curvature(flat, faces)[0][inside].max() < 1e-10
    noisy = flat + random.normal(0, 0.5e-3, flat.shape)
    series = curvature_series(noisy[None], faces)
    assert 3.0 < series.means()[0] < 5.0  # 3.8 on an even mesh; right triangles lie near it


def test_area_is_shared_out_whole_also_by_obtuse_triangles():
    x = np.array([[0, 0, 0], [1, 0, 0], [0.5, 0.2, 0], [0.5, 1, 0.3]], float)
    faces = np.array([[0, 1, 2], [1, 3, 2], [3, 0, 2]])
    assert mean_curvature(x, faces)[1].sum() == pytest.approx(corner_areas(x[faces]).sum(), rel=1e-12)


def test_claims_on_wrinkles_see_their_depth_and_number_and_the_vertex_wise_error_their_place_too():
    i, j = np.meshgrid(np.arange(49.0), np.arange(49.0), indexing="ij")
    faces = right_grid(48, 48, 1.0, 1.0)[1]

    def waves(depth: float = 0.002, number: float = 1.0, phase: float = 0.0) -> CurvatureSeries:
        height = depth * np.sin(number * np.pi / 8.0 * i + phase)
        return curvature_series(np.stack([0.01 * i, height, 0.01 * j], -1).reshape(1, -1, 3), faces)

    still = waves()
    changed = waves(phase=np.pi / 2.0), waves(depth=0.001), waves(number=0.5)  # moved, less deep, fewer
    judges = {"curvature/histogram": histogram_distance, "curvature/error": curvature_error}
    (judge,) = judges.keys() & {claim.metric for claim in CLAIMS}
    moved, *errors = (judges[judge](one, still)[0] / still.means()[0] for one in changed)
    assert moved < 0.05 and min(errors) > 0.4
    assert min(curvature_error(one, still)[0] for one in changed) > 0.4 * still.means()[0]
    assert curvature_error(still, still)[0] == 0.0
    assert curvature_error(waves(depth=0.0), still)[0] == pytest.approx(still.means()[0], rel=1e-9)


def test_change_of_wrinkles_is_the_part_of_all_deviations_that_is_in_time():
    # Two vertices keep 1 and 3, two of twice their area swap: of 1 + 1 + 2 + 2 about the mean of 2 the
    # last.
    h = np.array([[1.0, 3.0, 1.0, 3.0], [1.0, 3.0, 3.0, 1.0]])
    area = np.array([1.0, 1.0, 2.0, 2.0]) * [[0.5], [1.5]]
    assert curvature_change(CurvatureSeries(h, area)) == pytest.approx(4.0 / 6.0)
    flat = CurvatureSeries(np.zeros((2, 4)), area)
    assert curvature_change(flat) is None
    series = CurvatureSeries(np.repeat(h[:1], 2, axis=0), area)
    assert curvature_change(series) == 0.0
