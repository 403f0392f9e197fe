"""Chamfer distance and angle of normals between surfaces whose distance is known."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.meshes import icosphere, in_space, random_rotation, right_grid
from benchmarks.metric import RollOut, SceneRollOuts
from benchmarks.metrics.penetration_and_distances import measure, rms
from benchmarks.metrics.surface_distance import _one_way, chamfer_and_angle, compare
from reference_sim import Trajectory

COARSE, FINE = right_grid(3, 4, 1.0, 1.0), right_grid(7, 5, 1.0, 1.0)


def test_parallel_sheets_of_other_triangles_are_their_gap_apart():
    above = in_space(FINE[0]) + np.array([0.0, 0.0, 0.03])
    distance, angle = chamfer_and_angle(in_space(COARSE[0]), COARSE[1], above, FINE[1])
    assert (distance, angle) == pytest.approx((0.03, 0.0), abs=1e-12)
    turn = random_rotation(1)
    moved = [x @ turn.T + 3.0 for x in (in_space(COARSE[0]), above)]
    assert chamfer_and_angle(moved[0], COARSE[1], moved[1], FINE[1])[0] == pytest.approx(0.03)


@pytest.mark.parametrize("angle", [0.3, 2.0])
def test_the_angle_between_planes_and_of_the_other_side(angle):
    sine, cosine = np.sin(angle), np.cos(angle)
    turned = in_space(FINE[0]) @ np.array([[1, 0, 0], [0, cosine, sine], [0, -sine, cosine]])
    assert chamfer_and_angle(in_space(COARSE[0]), COARSE[1], turned, FINE[1])[1] == pytest.approx(angle)
    other_side = chamfer_and_angle(in_space(COARSE[0]), COARSE[1], turned, FINE[1][:, ::-1])
    assert other_side[1] == pytest.approx(np.pi - angle)


def test_a_mean_is_by_area_and_not_by_vertices():
    points, faces = right_grid(8, 8, 1.0, 1.0)
    crowded = points**3  # most of its vertices lie at x = 0
    slope = np.column_stack([crowded, 0.1 + 0.2 * crowded[:, 0]])
    large, below = right_grid(2, 2, 4.0, 4.0)
    distance, angle = _one_way(slope, faces, in_space(large) - [1.5, 1.5, 0.0], below)
    assert (distance, angle) == pytest.approx((0.2, np.arctan(0.2)), rel=1e-9)
    assert slope[:, 2].mean() < 0.17


def test_a_gap_that_one_way_cannot_see_counts_half():
    # A half of the sheet lies on the whole one: from there to the half, x - 1/2 over one half of the
    # area.
    whole, half = right_grid(60, 60, 1.0, 1.0), right_grid(9, 9, 1.0, 0.5)
    distance = chamfer_and_angle(in_space(half[0]), half[1], in_space(whole[0]), whole[1])[0]
    assert distance == pytest.approx(0.5 * (0.0 + 0.125), rel=1e-3)


def test_a_sphere_that_turns_in_itself_has_not_moved():
    x, faces = icosphere(4, 0.3)
    turned = x @ random_rotation(3).T
    distance, angle = chamfer_and_angle(turned, faces, *icosphere(3, 0.3))
    assert distance < 0.003 * 0.3 and angle < 0.03
    assert rms(turned[None], x[None]) > 100.0  # mm


def roll_out(
    frames: np.ndarray, faces: np.ndarray, *, other_mesh: bool, obstacle: object = None
) -> RollOut:
    group = SceneRollOuts(SimpleNamespace(warm_up=1, obstacle=obstacle))
    trajectory = Trajectory(frames, faces, np.arange(len(frames)) / 30.0)
    return RollOut(group, SimpleNamespace(other_mesh=other_mesh), trajectory)


def test_frames_are_compared_after_the_warm_up_each_with_its_own():
    heights = np.array([0.0, 1.0, 3.0, 6.0])[:, None, None] * [0.0, 0.0, 1e-3]
    reference = roll_out(in_space(COARSE[0]) + heights, COARSE[1], other_mesh=False)
    same = roll_out(in_space(FINE[0]) + heights, FINE[1], other_mesh=True)
    nothing = {"surface/chamfer": 0.0, "surface/normals": 0.0}
    assert compare(same, reference) == pytest.approx(nothing, abs=1e-9)
    late = np.roll(heights, 1, axis=0)  # 1, 2 and 3 mm behind
    behind = compare(roll_out(in_space(FINE[0]) + late, FINE[1], other_mesh=True), reference)
    assert behind["surface/chamfer"] == pytest.approx(2.0)


def test_a_cloth_that_is_lost_or_collapsed_to_a_point_has_no_surface():
    frames = np.repeat(in_space(COARSE[0])[None], 3, axis=0)
    lost = frames.copy()
    lost[2, 4] = 1e200
    reference = roll_out(frames, COARSE[1], other_mesh=False)
    for spoilt in (lost, 0.0 * frames):
        assert compare(roll_out(spoilt, COARSE[1], other_mesh=False), reference) == {}


def test_penetration_is_measured_of_another_mesh():
    slab = SimpleNamespace(signed_distance=lambda points, frame: points[:, 0] - 0.25)
    frames = np.repeat(in_space(COARSE[0])[None], 3, axis=0)  # x = 0, 1/4 ... 1 in equal numbers
    metrics = measure(roll_out(frames, COARSE[1], other_mesh=True, obstacle=slab))
    assert metrics["penetration/vertices"] == pytest.approx(20.0)
    # What lies in the plane is outside.
    assert metrics["penetration/surface"] == pytest.approx(25.0 * (1 - 17 / 120))
    assert metrics["penetration/deep"] == pytest.approx(20.0)
    assert metrics["penetration/depth_p99"] == pytest.approx(250.0)
    assert measure(roll_out(frames, COARSE[1], other_mesh=True)) == {}
