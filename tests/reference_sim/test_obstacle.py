"""The moving body: contact planes and distances of a sphere, a column and a bar."""

from __future__ import annotations

import numpy as np
import pytest

from reference_sim import Cloth, Obstacle, simulate
from reference_sim.energies import Gravity
from tests.reference_sim.meshes import random_rotation, sphere

RADIUS = 0.3
SPHERE, FACES = sphere(4, RADIUS)


def around(count: int, seed: int, low: float, high: float) -> tuple[np.ndarray, np.ndarray]:
    """Points at random distances between low and high from the true sphere, and those distances [m]."""
    random = np.random.default_rng(seed)
    distance, direction = random.uniform(low, high, count), random.normal(size=(count, 3))
    return (RADIUS + distance)[:, None] * direction / np.linalg.norm(direction, axis=1)[:, None], distance


def test_planes_of_a_sphere():
    obstacle = Obstacle(SPHERE, FACES)
    points, distance = around(300, 1, -0.1, 0.2)
    planes = obstacle.planes(points, 0)
    assert np.linalg.norm(planes.normals, axis=1) == pytest.approx(1.0, rel=1e-14)
    d = np.einsum("si,si->s", planes.normals, points - planes.points)
    # The plane gives the signed distance at the sample's own place: round-off alone.
    assert d == pytest.approx(obstacle.signed_distance(points, 0), abs=1e-14)
    place = np.einsum("sa,sai->si", planes.barycentric, SPHERE[FACES[planes.faces]])
    assert place == pytest.approx(planes.points, abs=1e-14)
    # The mesh lies inside the true sphere, by no more than the sagitta.
    assert (d - distance > -1e-14).all() and (d - distance < 2e-3).all()
    # A chord of length e deviates by e / 2R from the tangent; these are 3 cm long at most.
    cosine = np.einsum("si,si->s", planes.normals, points / np.linalg.norm(points, axis=1, keepdims=True))
    assert cosine.min() > 1 - 0.01


def test_normals_point_outwards_on_the_surface_itself():
    """At distance zero there is no direction to the sample: the smooth normal of the mesh takes over."""
    obstacle = Obstacle(SPHERE, FACES)
    points = np.concatenate([SPHERE[::7], SPHERE[FACES[::5]].mean(axis=1)])
    normals = obstacle.planes(points, 0).normals
    radial = points / np.linalg.norm(points, axis=1, keepdims=True)
    assert np.einsum("si,si->s", normals, radial).min() > 0.99
    # Just below and just above the skin the normal stays the same: contact has no jump there.
    for shift in (-1e-5, 1e-5):
        moved = obstacle.planes(points + shift * radial, 0).normals
        assert np.einsum("si,si->s", normals, moved).min() > 0.98


def column(height: float = 1.0, radius: float = 0.1) -> tuple[np.ndarray, np.ndarray]:
    """An upright cylinder with flat ends, of rings 1 cm apart."""
    rings, around = np.linspace(-height, height, 201), 2 * np.pi * np.arange(48) / 48
    circle = radius * np.column_stack([np.cos(around), np.zeros(48), np.sin(around)])
    vertices = [circle + np.array([0, y, 0]) for y in rings] + [
        np.array([[0, -height, 0], [0, height, 0]])
    ]
    k = np.arange(48)
    after, low = (k + 1) % 48, len(rings) * 48
    faces = [np.column_stack([np.full(48, low), k, after])]
    for ring in range(len(rings) - 1):
        a, b, c, d = ring * 48 + k, ring * 48 + after, (ring + 1) * 48 + k, (ring + 1) * 48 + after
        faces += [np.column_stack([a, c, b]), np.column_stack([b, c, d])]
    top = (len(rings) - 1) * 48
    faces.append(np.column_stack([np.full(48, low + 1), top + after, top + k]))
    return np.concatenate(vertices), np.concatenate(faces)


def test_beside_the_border_of_its_faces_a_sample_meets_a_ball():
    """Samples at the side of a column at rest may meet 20 cm of it up and down, and have moved along it."""
    rest, faces = column()
    obstacle = Obstacle(rest, faces, rest_positions=rest, region=0.2)
    home = np.array([[0.1, 0.003, 0.0]])  # its uppermost face ends at 0.2 m

    def at(along: float, depth: float) -> float:
        point = np.array([[0.1 - depth, 0.2 + along, 0.0]])
        planes = obstacle.planes(point, 0, home)
        assert np.linalg.norm(planes.normals) == pytest.approx(1.0, rel=1e-12)
        return np.vdot(planes.normals, point - planes.points)

    for depth in (0.03, 0.01, 0.002, -0.002, -0.03):  # on its faces: the distance to the skin, signed
        assert at(-0.05, depth) == pytest.approx(-depth, abs=3e-4)
    for depth in (0.03, 0.01, 0.002, -0.002, -0.03):  # far beyond them: no contact
        assert at(0.1, depth) > 0.03
    # Just beyond them the skin goes on as the tangent, and bends away as a ball of 10 cm.
    assert at(0.003, 0.01) == pytest.approx(-0.01, abs=3e-4)
    for along, depth in ((0.01, 0.01), (0.02, 0.02), (0.03, 0.01), (0.04, 0.04)):
        way = np.array(
            [0.1 - depth, along]
        )  # to the sample from the ball's far end, 10 cm below the border
        expected = np.array([-depth, along]) @ way / np.linalg.norm(way)
        assert at(along, depth) == pytest.approx(expected, abs=3e-4)
        assert (expected < 0) == (along**2 + (depth - 0.05) ** 2 < 0.05**2)


def test_as_many_samples_from_elsewhere_meet_their_own_faces():
    rest, faces = sphere(3)
    rest *= [0.55, 0.08, 0.08]  # a bar of 1.1 m
    obstacle = Obstacle(rest, faces, rest_positions=rest, region=0.15)
    left, right = rest[rest[:, 0] < -0.3][:40], rest[rest[:, 0] > 0.3][:40]
    for home in (left, right, left):
        planes = obstacle.planes(rest[:40], 0, home)
        fresh = Obstacle(rest, faces, rest_positions=rest, region=0.15).planes(rest[:40], 0, home)
        assert (planes.faces == fresh.faces).all() and (planes.points == fresh.points).all()


def test_each_frame_has_its_own_surface_and_the_last_one_stays():
    moving = SPHERE + np.array([0.0, 0.1, 0.0]) * np.arange(3)[:, None, None]
    obstacle = Obstacle(moving, FACES)
    assert obstacle.frames == 3 and Obstacle(SPHERE, FACES).frames == 1
    point = np.array([[0.0, 0.5, 0.0]])
    for frame, expected in ((0, 0.2), (1, 0.1), (2, 0.0), (3, 0.0), (9, 0.0), (1, 0.1)):
        # The pole is a vertex of the mesh, so the distance is that of the true sphere.
        assert obstacle.signed_distance(point, frame) == pytest.approx([expected], abs=1e-12)
        assert obstacle.planes(point, frame).points[0, 1] == pytest.approx(0.5 - expected, abs=1e-12)
        assert (obstacle.at(frame) == moving[min(frame, 2)]).all()
    for ask in (obstacle.signed_distance, Obstacle(moving, FACES).planes):
        with pytest.raises(ValueError, match="frames count from 0"):
            ask(point, -1)
    np.testing.assert_allclose(Obstacle(moving, FACES).transport(point, 0), point, atol=1e-12)


def test_carried_is_exact_for_a_rigid_motion():
    turn, shift = random_rotation(8), np.array([0.4, -0.2, 0.7])
    obstacle = Obstacle(np.stack([SPHERE, SPHERE @ turn.T + shift]), FACES)
    points, _ = around(200, 6, -0.1, 0.3)
    # Round-off of barycentric places and frames, at 1 m from the origin.
    for carried in (obstacle.transport(points, 1), obstacle.carrying(points)(1)):
        assert carried == pytest.approx(points @ turn.T + shift, abs=1e-12)


def test_pins_beside_an_obstacle_that_moves_are_not_left_behind_without_a_word():
    walking = Obstacle(SPHERE + np.array([0.03, 0.0, 0.0]) * np.arange(3)[:, None, None], FACES)
    beside, off = np.array([[0.0, 0.34, 0.0]]), np.array([[0.0, 0.36, 0.0]])
    triangle = np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.0, 0.1]])
    cloths = [Cloth(triangle + place, np.array([[0, 2, 1]]), pins=[0]) for place in (beside, off)]
    with pytest.raises(ValueError, match=r"1 pins moves: give pin_positions, as obstacle.carrying"):
        simulate(cloths[0], [Gravity(cloths[0])], obstacle=walking)
    still = Obstacle(np.repeat(SPHERE[None], 2, axis=0), FACES)
    for cloth, obstacle in ((cloths[1], walking), (cloths[0], still)):
        assert simulate(cloth, [Gravity(cloth)], obstacle=obstacle, frames=2).status == "converged"
