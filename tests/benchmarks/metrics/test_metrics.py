"""Metrics with known answers: energies by hand, distances, penetration, intersections, errors in time."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.meshes import icosphere, right_grid
from benchmarks.metrics.curvature import CurvatureSeries, histogram_distance
from benchmarks.metrics.energy import energy_series
from benchmarks.metrics.penetration_and_distances import measure_deformation, own_part_depth, penetration
from benchmarks.metrics.scene_facts import inside_itself, measure_body
from benchmarks.metrics.self_intersections import self_intersections
from reference_sim import Cloth, Obstacle
from tests.benchmarks.runner.tasks_by_hand import simulated, small_scene


class Slab:
    """Everything below y = frame is inside."""

    def signed_distance(self, points, frame):
        return points[:, 1] - frame


def test_penetration_counts_every_vertex_and_measures_depth():
    x = np.zeros((2, 4, 3))
    x[:, :, 1] = [0.5, -0.25, 2.0, -0.5]
    faces = np.array([[0, 1, 2], [1, 2, 3]])
    shorter, overlap = penetration([x[:1], x], [faces, faces], Slab())
    assert shorter.share == pytest.approx([0.5])
    assert overlap.share == pytest.approx([0.5, 0.75])
    assert overlap.depth[0] == pytest.approx([0, 0.25, 0, 0.5])
    assert overlap.depth[1] == pytest.approx([0.5, 1.25, 0, 1.5])


def test_penetration_sees_the_surface_between_vertices():
    """A tent whose vertices stand outside and whose ridge dips into a ball: 0 % of the vertices."""

    class Ball:
        def signed_distance(self, points, frame):
            return np.linalg.norm(points, axis=1) - 1.0

    x = np.array([[[-2.0, 0.1, 0.0], [2.0, 0.1, 0.0], [0.0, 0.1, 3.0]]])
    (overlap,) = penetration([x], [np.array([[0, 2, 1]])], Ball())
    # Of its seven points the midpoint of one side alone is in the ball; the centroid is at z = 1.
    assert overlap.share[0] == 0.0 and overlap.area[0] == pytest.approx(2 / 15)
    finer, faces = right_grid(81, 81, 4.0, 4.0)  # with a quarter of the ball's disc
    (overlap,) = penetration([np.pad(finer, ((0, 0), (0, 1)))[None]], [faces], Ball())
    assert overlap.area[0] == pytest.approx(np.pi / 64, rel=1e-2)
    (overlap,) = penetration([np.zeros((1, 3, 3)) + 2.0], [np.array([[0, 1, 2]])], Ball())
    assert overlap.area[0] == 0.0


def test_energies_of_a_rigid_acceleration_are_known_by_hand():
    scene = small_scene("hanging_sheet")
    heights = np.array([0.5, 0.6, 0.7, 0.8, 0.9])
    scene = dataclasses.replace(scene, origin_heights=heights)
    rest, acceleration = scene.cloth.rest_positions, np.array([3.0, 0.0, -4.0])
    times = scene.dt * np.arange(5)[:, None, None]
    positions = rest + 0.5 * times**2 * acceleration
    longer, shorter = energy_series(scene, [positions, positions[:3]])
    mass = scene.cloth.masses.sum()
    inertia = 0.5 * mass * 25.0 * scene.dt**2
    assert longer["inertia"] == pytest.approx([0, 0, inertia, inertia, inertia], rel=1e-9)
    height = (scene.cloth.masses * rest[:, 1]).sum() / mass
    assert longer["gravity"] == pytest.approx(mass * 9.81 * (height - heights), rel=1e-12)
    assert np.abs(longer["strain"]).max() < 1e-20 and set(longer) == {*scene.terms, "total"}
    assert longer["total"] == pytest.approx(longer["gravity"] + longer["inertia"])
    assert shorter["total"] == pytest.approx(longer["total"][:3])


def test_energies_are_those_that_the_simulator_minimised():
    scene = small_scene("sheet_on_sphere")
    trajectory = simulated(scene, frames=10)
    (series,) = energy_series(scene, [trajectory.positions])
    fields = trajectory.frame_fields
    for term in ("strain", "bending", "gravity", "inertia"):
        assert series[term][2:] == pytest.approx(fields[f"energy/{term}"][2:], rel=1e-9, abs=1e-15)
    # Planes of the simulator were searched at its initial guess, those of the metric where it ended.
    assert series["collision"][-1] == pytest.approx(fields["energy/collision"][-1], rel=0.3)
    assert series["collision"][-1] > 0.0


def test_own_part_depth_does_not_see_the_limb_beside():
    """Two balls: a vertex that belongs to the left one lies deep in the right one, outside its own."""
    points, faces = icosphere(3, 0.1)
    body = np.concatenate([points, points + np.array([0.25, 0, 0])])
    rest = np.concatenate([points, points + np.array([1.0, 0, 0])])  # far apart where the cloth was made
    obstacle = Obstacle(body, np.concatenate([faces, faces + len(points)]), rest_positions=rest)
    x = np.array([[[0.2, 0.0, 0.0], [0.09, 0.0, 0.0]]])  # 10 cm off the left ball; 1 cm inside it
    belongs = np.array([[0.11, 0.0, 0.0], [0.101, 0.0, 0.0]])
    # The ball is a mesh: its faces lie up to 1 % of the radius below the sphere.
    assert own_part_depth(x, obstacle, belongs)[0] == pytest.approx([0.0, 0.01], abs=1e-3)
    depth = penetration([x], [np.zeros((0, 3), int)], obstacle)[0].depth[0]
    assert depth == pytest.approx([0.05, 0.01], abs=1e-3)


def test_histogram_distance_is_the_shift_of_a_distribution_and_blind_to_places():
    random = np.random.default_rng(5)
    h, area = random.uniform(1.0, 9.0, (2, 50)), random.uniform(0.5, 1.5, (2, 50))
    still = CurvatureSeries(h, area)
    order = random.permutation(50)
    shuffled = CurvatureSeries(h[:, order], area[:, order])
    assert histogram_distance(shuffled, still) == pytest.approx(0, abs=1e-12)
    assert histogram_distance(CurvatureSeries(h + 2.5, area), still) == pytest.approx([2.5, 2.5])
    # Two heaps against one between them: all of the area moves by 3.
    frame = CurvatureSeries(np.array([[1.0, 7.0]]), np.array([[2.0, 2.0]]))
    weights = np.array([[0.3, 0.0]])  # a boundary vertex weighs nothing
    one = CurvatureSeries(np.array([[4.0, 99.0]]), weights)
    assert histogram_distance(frame, one) == pytest.approx([3.0])
    assert histogram_distance(CurvatureSeries(h, 0 * area), still) == pytest.approx([0.0, 0.0])


def test_intersections_are_those_of_two_crossing_strips():
    plane, faces = right_grid(6, 6, 1.0, 1.0)
    flat = np.column_stack([plane, 0.0 * plane[:, 0]])
    upright = np.column_stack([0.0 * plane[:, 0], plane]) + np.array([0.47, 0.013, -0.47])
    doubled = np.concatenate([faces, faces + len(flat)])
    above = np.concatenate([flat, flat + np.array([0.0, 0.0, 0.01])])
    same = np.concatenate([flat, flat])
    for apart in (above, same):
        hit, length = self_intersections(apart, doubled)
        assert not hit.any() and length == 0.0
    crossing = np.concatenate([flat, upright])
    corners = flat[faces]
    through = (corners[:, :, 0].min(1) < 0.47) & (corners[:, :, 0].max(1) > 0.47)
    hit, length = self_intersections(crossing, doubled)
    assert np.array_equal(hit[: len(faces)], through) and hit[len(faces) :].sum() == through.sum()
    # The plate that stands cuts the flat one from y = 0.013 to its edge.
    assert length == pytest.approx(1.0 - 0.013, rel=1e-12)
    tent = flat + np.abs(flat[:, [0]] - 0.5) * [0.0, 0.0, 2.0]  # folded, and nowhere through itself
    assert not self_intersections(tent, faces)[0].any()


def test_edges_and_areas_change_as_their_ratios_whichever_way():
    plane, faces = right_grid(4, 3, 1.0, 0.5)
    sheet = np.column_stack([plane, 0.0 * plane[:, 0]])
    frames = np.stack([sheet, 0.9 * sheet, 1.2 * sheet])  # the first is of the warm-up
    scene = SimpleNamespace(cloth=Cloth(sheet, faces))
    values = measure_deformation(SimpleNamespace(scene=scene, positions=frames, judged=slice(1, None)))
    assert values["deformation/edges"] == pytest.approx(15.0)
    assert values["deformation/areas"] == pytest.approx((19.0 + 44.0) / 2)


def two_spheres(apart):
    """Two spheres of radius 1 as one surface, their centres that far apart."""
    x, faces = icosphere(4, 1.0)
    return np.concatenate([x, x + np.array([apart, 0.0, 0.0])]), np.concatenate([faces, faces + len(x)])


def test_a_body_in_itself_is_counted_by_its_vertices_in_its_other_parts():
    # The cap of a sphere inside the other one has (1 - apart / 2) / 2 of its area.
    for apart, share in ((2.5, 0.0), (1.5, 0.125), (0.5, 0.375)):
        assert inside_itself(*two_spheres(apart)).mean() == pytest.approx(share, abs=0.012)


def test_the_worst_frame_is_found_beyond_what_is_so_at_rest_and_in_the_references_rows_alone():
    faces = two_spheres(1.5)[1]
    obstacle = Obstacle(np.stack([two_spheres(apart)[0] for apart in (0.2, 1.5, 0.5, 1.0)]), faces)
    body = SimpleNamespace(rest_vertices=lambda betas: two_spheres(1.5)[0])
    scene = SimpleNamespace(obstacle=obstacle, dressed=SimpleNamespace(body=body, betas=None), warm_up=1)
    entry = SimpleNamespace(role="reference")
    roll_out = SimpleNamespace(scene=scene, positions=np.zeros((4, 1, 3)), entry=entry)
    metrics = measure_body(roll_out)
    assert metrics["body/self_intersection"] == pytest.approx(100 * (0.375 - 0.125), abs=2.0)
    assert metrics["body/self_intersection_frame"] == 2.0
    roll_out.entry.role = "learned"
    assert measure_body(roll_out) == {}
