"""Closest points: against every face tried, against libigl, whatever is remembered."""

from __future__ import annotations

import igl
import numpy as np
import pytest

from reference_sim.geometry.closest_point import FaceSearch
from reference_sim.geometry.leaf_bounds import closest_on_triangle
from reference_sim.kernels.kernel_cache import njit
from tests.reference_sim.meshes import grid, sphere


def soup(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Triangles with corners drawn at will: crossing, touching, slivers, some without area, some a point."""
    generator = np.random.default_rng(3)
    size = max(3, count // 2)
    positions = generator.normal(size=(size, 3))
    positions[: size // 3] = np.round(positions[: size // 3])  # some coincide, many are in line
    return positions, generator.integers(0, size, (count, 3))


SLIVER = np.array([(0, 0, 0), (1, 0, 0), (0.4, 1e-7, 0), (2, 1e-12, 0), (0, 0, 1)])
MESHES = {
    "soup 2": soup(2),
    "soup 7": soup(7),
    "soup 400": soup(400),
    "sphere": sphere(3),
    "sheet": grid(9, 5),
    "sliver": (SLIVER, np.array([(0, 1, 2), (2, 1, 0), (0, 3, 1), (0, 1, 4)])),
    "point": (np.array([(0.5, 0.5, 0.5)] * 3), np.array([(0, 1, 2)])),
}


def samples(positions: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Points at random, far away, and on vertices, sides and faces."""
    generator = np.random.default_rng(0)
    corners = positions[faces]
    weights = generator.dirichlet(np.ones(3), len(faces))
    return np.concatenate(
        [
            generator.normal(size=(200, 3)),
            1e3 * generator.normal(size=(20, 3)),
            positions,
            corners[:, :2].mean(axis=1),
            np.einsum("fa,fai->fi", weights, corners),
        ]
    )


def tree_of(positions: np.ndarray, faces: np.ndarray) -> FaceSearch:
    tree = FaceSearch(faces, positions[faces].mean(axis=1))
    tree.refit(positions)
    return tree


@pytest.mark.parametrize("kind", [np.float64, np.float32])
@pytest.mark.parametrize("name", MESHES)
def test_distances_are_those_of_libigl(name, kind):
    positions, faces = MESHES[name]
    positions, points = positions.astype(kind), samples(positions, faces).astype(kind)
    closest = tree_of(positions, faces).nearest(points)
    squared = igl.point_mesh_squared_distance(
        *(x.astype(np.float64) for x in (points, positions)), faces
    )[0]
    distance = np.linalg.norm(points - closest.points, axis=1)
    # Far points lose digits by their own size; feet on slivers are known by fewer, theirs and ours.
    assert distance == pytest.approx(np.sqrt(squared), rel=1e-14, abs=1e-12)
    weights = closest.barycentric
    assert (weights >= 0).all() and weights.sum(axis=1) == pytest.approx(1.0, abs=1e-15)
    place = np.einsum("sa,sai->si", weights, positions[faces[closest.faces]].astype(np.float64))
    assert place == pytest.approx(closest.points, abs=1e-15 * float(np.abs(positions).max()))


@njit(cache=False, error_model="numpy")
def one_by_one(corners, points, centroids, home, region):
    """Closest face (S,) and its distance squared, by every face in the region; by all if none is in it.

    At a tie it is the lowest index.
    """
    faces, distances = np.full(len(points), -1), np.full(len(points), np.inf)
    for s in range(len(points)):
        for reach in (region, np.inf):
            for f in range(len(corners) if faces[s] < 0 else 0):
                offset = centroids[f] - home[s]
                if offset[0] ** 2 + offset[1] ** 2 + offset[2] ** 2 <= reach**2:
                    squared = closest_on_triangle(corners, f, points[s, 0], points[s, 1], points[s, 2])[2]
                    if squared < distances[s]:
                        faces[s], distances[s] = f, squared
    return faces, distances


@pytest.mark.parametrize("name", MESHES)
def test_of_faces_equally_near_the_lowest_answers(name):
    positions, faces = MESHES[name]
    points = samples(positions, faces)[::5]
    points = np.concatenate([points, positions[:50], np.round(4 * points) / 4])
    corners = positions[np.sort(faces, axis=1)]
    expected, _ = one_by_one(corners, points, corners.mean(axis=1), points, np.inf)
    assert (tree_of(positions, faces).nearest(points).faces == expected).all()


@pytest.mark.parametrize("name", ["soup 400", "sphere"])
def test_what_is_remembered_changes_nothing(name):
    positions, faces = MESHES[name]
    tree, points = tree_of(positions, faces), samples(positions, faces)
    generator = np.random.default_rng(1)
    home = points[generator.permutation(len(points))]
    for rest in ({}, {"samples": tree.group(home, 1.0)}):
        cold = tree.nearest(points, **rest)
        for hints in (cold.faces, generator.integers(-1, len(faces), len(points))):
            warm = tree.nearest(points, hints=hints, **rest)
            assert (warm.faces == cold.faces).all()
            assert (warm.barycentric == cold.barycentric).all() and (warm.points == cold.points).all()


@pytest.mark.parametrize("name", ["soup 400", "sphere"])
def test_a_rough_answer_is_at_most_twice_as_far_and_exact_where_it_has_to_be(name):
    positions, faces = MESHES[name]
    tree, points = tree_of(positions, faces), samples(positions, faces)
    best = tree.nearest(points)
    distance = np.linalg.norm(points - best.points, axis=1)
    hints, limit = np.random.default_rng(9).integers(-1, len(faces), len(points)), 0.3
    closest = tree.nearest(points, hints=hints, exact=limit)
    near = distance < limit
    assert (closest.faces[near] == best.faces[near]).all()
    rough = np.linalg.norm(points - closest.points, axis=1)[~near] / distance[~near]
    assert rough.max() <= 2 + 1e-12 and (rough > 1.01).mean() > 0.1


@pytest.mark.parametrize("region", [0.2, 0.7])
@pytest.mark.parametrize("name", ["soup 7", "soup 400", "sheet"])
def test_only_faces_near_the_place_at_rest_are_met(name, region):
    positions, faces = MESHES[name]
    centroids = positions[faces].mean(axis=1)
    tree = FaceSearch(faces, centroids)
    generator = np.random.default_rng(2)
    moved = positions[generator.permutation(len(positions))]  # nothing is where it was at rest
    tree.refit(moved)
    points, home = generator.normal(size=(2, 60, 3))
    expected, _ = one_by_one(moved[np.sort(faces, axis=1)], points, centroids, home, region)
    closest = tree.nearest(points, samples=tree.group(home, region)).faces
    assert (closest == expected).all()
    assert name == "soup 7" or (closest != tree.nearest(points).faces).any()
