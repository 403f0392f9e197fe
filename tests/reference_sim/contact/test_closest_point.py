"""Closest points by the tree of boxes: against every face tried, against libigl, whatever is remembered."""

from __future__ import annotations

import igl
import numpy as np
import pytest

from reference_sim.contact.closest_point import FaceTree
from reference_sim.contact.closest_point_groups import GROUP_SIZE
from reference_sim.geometry.surface import vertex_normals
from reference_sim.geometry.triangle import closest_on_triangle
from tests.reference_sim.meshes import grid, random_rotation, sphere


def soup(seed: int, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Triangles with corners drawn at will: crossing, touching, slivers, some without area, some a point."""
    generator = np.random.default_rng(seed)
    size = max(3, count // 2)
    positions = generator.normal(size=(size, 3))
    positions[: size // 3] = np.round(positions[: size // 3])  # some coincide, many are in line
    return positions, generator.integers(0, size, (count, 3))


def mesh(name: str) -> tuple[np.ndarray, np.ndarray]:
    if name.startswith("soup"):
        return soup(3, int(name.split()[1]))
    if name == "sphere":
        return sphere(3)
    if name == "sheet":
        return grid(9, 5)
    if name == "sliver":
        return np.array([(0, 0, 0), (1, 0, 0), (0.4, 1e-7, 0), (2, 1e-12, 0), (0, 0, 1)]), np.array(
            [(0, 1, 2), (2, 1, 0), (0, 3, 1), (0, 1, 4)]
        )
    return np.array([(0.5, 0.5, 0.5)] * 3), np.array([(0, 1, 2)])  # one triangle, and that a point


MESHES = ("soup 1", "soup 2", "soup 7", "soup 400", "sphere", "sheet", "sliver", "point")


def samples(positions: np.ndarray, faces: np.ndarray, seed: int = 0) -> np.ndarray:
    """Points at random, far away, and on vertices, sides and faces."""
    generator = np.random.default_rng(seed)
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


def tree_of(positions: np.ndarray, faces: np.ndarray) -> FaceTree:
    tree = FaceTree(faces, positions[faces].mean(axis=1))
    tree.refit(positions)
    return tree


def assert_closest(tree: FaceTree, positions: np.ndarray, points: np.ndarray) -> None:
    closest = tree.nearest(points)
    squared, _, _ = igl.point_mesh_squared_distance(
        points.astype(np.float64), positions.astype(np.float64), tree.faces
    )
    distance = np.linalg.norm(points - closest.points, axis=1)
    # Far points lose digits by their own size; feet on slivers are known by fewer, theirs and ours.
    assert distance == pytest.approx(np.sqrt(squared), rel=1e-14, abs=1e-12)
    assert (closest.barycentric >= 0).all() and closest.barycentric.sum(axis=1) == pytest.approx(
        1.0, abs=1e-15
    )
    place = np.einsum(
        "sa,sai->si", closest.barycentric, positions[tree.faces[closest.faces]].astype(np.float64)
    )
    assert place == pytest.approx(closest.points, abs=1e-15 * float(np.abs(positions).max()))


@pytest.mark.parametrize("kind", [np.float64, np.float32])
@pytest.mark.parametrize("name", MESHES)
def test_distances_are_those_of_libigl(name, kind):
    positions, faces = mesh(name)
    positions = positions.astype(kind)
    assert_closest(tree_of(positions, faces), positions, samples(positions, faces).astype(kind))


def one_by_one(
    positions: np.ndarray, faces: np.ndarray, points: np.ndarray, allowed: np.ndarray | None = None
) -> np.ndarray:
    """Return the closest face (S,) among `allowed` (S, F), or among all; at a tie the lowest index."""
    corners = positions[np.sort(faces, axis=1)]
    squared = np.array([[closest_on_triangle(corners, f, *p)[2] for f in range(len(faces))] for p in points])
    if allowed is not None:
        squared[~allowed & allowed.any(axis=1, keepdims=True)] = np.inf
    return squared.argmin(axis=1)


@pytest.mark.parametrize("name", MESHES)
def test_of_faces_equally_near_the_lowest_answers(name):
    positions, faces = mesh(name)
    points = samples(positions, faces)[::5]
    points = np.concatenate([points, positions[:50], np.round(4 * points) / 4])
    expected = one_by_one(positions, faces, points)
    assert (tree_of(positions, faces).nearest(points).faces == expected).all()


def test_beyond_a_side_or_a_corner_the_lowest_of_its_faces_answers():
    """Whatever round-off does in the others: above a convex body every sharing face is equally near."""
    positions, faces = mesh("sphere")
    positions = positions @ random_rotation(5).T * [1.0, 0.7, 1.3]
    order = np.random.default_rng(6).permutation(len(faces))
    faces = np.stack([np.roll(face, k) for k, face in enumerate(faces[order])])
    normals = vertex_normals(positions, faces)
    closest = tree_of(positions, faces).nearest(positions + 0.01 * normals)
    corner = np.array([np.flatnonzero((faces == v).any(axis=1))[0] for v in range(len(positions))])
    assert (closest.faces == corner).mean() > 0.99  # a lopsided corner may lean over another face
    edges = np.unique(np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1), axis=0)
    closest = tree_of(positions, faces).nearest((positions + 0.01 * normals)[edges].mean(axis=1))
    on = (closest.barycentric == 0).sum(axis=1) == 1
    side = np.array([np.flatnonzero(np.isin(faces, edge).sum(axis=1) == 2)[0] for edge in edges])
    assert on.mean() > 0.9 and (closest.faces == side)[on].mean() > 0.99


@pytest.mark.parametrize("name", ["soup 7", "soup 400", "sphere", "sheet"])
def test_what_is_remembered_changes_nothing(name):
    positions, faces = mesh(name)
    tree, points = tree_of(positions, faces), samples(positions, faces)
    generator = np.random.default_rng(1)
    home = points[generator.permutation(len(points))]
    for rest in ({}, {"rest_points": home, "region": 1.0}):
        cold = tree.nearest(points, **rest)
        for hints in (cold.faces, generator.integers(-1, len(faces), len(points))):
            warm = tree.nearest(points, hints=hints, **rest)
            assert (warm.faces == cold.faces).all()
            assert (warm.barycentric == cold.barycentric).all() and (warm.points == cold.points).all()


@pytest.mark.parametrize("name", ["soup 400", "sphere", "sheet"])
def test_within_reach_answers_are_exact_and_beyond_there_are_none(name):
    """Bit for bit, each sample with a reach of its own, whatever is remembered."""
    positions, faces = mesh(name)
    tree, points = tree_of(positions, faces), samples(positions, faces)
    generator = np.random.default_rng(7)
    centroids = positions[faces].mean(axis=1)
    home = centroids[generator.integers(0, len(faces), len(points))] + 0.1
    for rest in ({}, {"rest_points": home, "region": 0.7}):
        exact = tree.nearest(points, **rest)
        distance = np.linalg.norm(points - exact.points, axis=1)
        reach = distance * generator.uniform(0.5, 1.5, len(points))
        reach[distance < 1e-9] = np.inf  # of these round-off decides
        near = distance < reach
        assert 0.3 < near.mean() < 0.95
        for hints in (None, exact.faces, generator.integers(-1, len(faces), len(points))):
            closest = tree.nearest(points, hints=hints, reach=reach, **rest)
            assert (closest.faces[near] == exact.faces[near]).all() and (closest.faces[~near] == -1).all()
            assert (closest.points[near] == exact.points[near]).all()
            assert (closest.barycentric[near] == exact.barycentric[near]).all()


@pytest.mark.parametrize("name", ["soup 400", "sphere", "sheet"])
def test_a_rough_answer_is_at_most_twice_as_far_and_exact_where_it_has_to_be(name):
    positions, faces = mesh(name)
    tree, points = tree_of(positions, faces), samples(positions, faces)
    best = tree.nearest(points)
    distance = np.linalg.norm(points - best.points, axis=1)
    hints, limit = np.random.default_rng(9).integers(-1, len(faces), len(points)), 0.3
    closest = tree.nearest(points, hints=hints, exact=limit)
    near = distance < limit
    assert (closest.faces[near] == best.faces[near]).all()
    rough = np.linalg.norm(points - closest.points, axis=1)[~near] / distance[~near]
    assert rough.max() <= 2 + 1e-12 and (rough > 1.01).mean() > 0.1


@pytest.mark.parametrize("region", [0.2, 0.7, 2.0])
@pytest.mark.parametrize("name", ["soup 7", "soup 400", "sphere", "sheet"])
def test_only_faces_near_the_place_at_rest_are_met(name, region):
    positions, faces = mesh(name)
    centroids = positions[faces].mean(axis=1)
    tree = FaceTree(faces, centroids)
    generator = np.random.default_rng(2)
    moved = positions[generator.permutation(len(positions))]  # nothing is where it was at rest
    tree.refit(moved)
    points, home = generator.normal(size=(2, 60, 3))
    offset = centroids[None] - home[:, None]
    allowed = np.einsum("sfi,sfi->sf", offset, offset) <= region**2
    closest = tree.nearest(points, rest_points=home, region=region).faces
    assert (closest == one_by_one(moved, faces, points, allowed)).all()
    assert name == "soup 7" or (closest != tree.nearest(points).faces).any()


def test_a_refitted_tree_answers_as_one_built_for_the_pose():
    positions, faces = mesh("sphere")
    tree = tree_of(positions, faces)
    generator = np.random.default_rng(4)
    for scale in (1.0, 100.0, 0.01):
        moved = scale * positions * [1.0, 0.1, 3.0] + generator.normal(0, 0.1 * scale, positions.shape)
        tree.refit(moved)
        points = moved[generator.permutation(len(moved))] * 1.1
        closest, fresh = tree.nearest(points), tree_of(moved, faces).nearest(points)
        assert (closest.faces == fresh.faces).all() and (closest.points == fresh.points).all()
    assert_closest(tree, moved, points)


@pytest.mark.parametrize("count", [1, GROUP_SIZE - 1, GROUP_SIZE, GROUP_SIZE + 1])
def test_company_changes_nothing(count):
    """Samples are searched in groups: each gets what it would alone, with hints or without, in any order."""
    positions, faces = mesh("sphere")
    tree, points = tree_of(positions, faces), samples(positions, faces)
    home, hints = points[::-1], np.where(np.arange(len(points)) % 3, np.arange(len(points)) % len(faces), -1)
    whole = tree.nearest(points, rest_points=home, region=0.8)
    chosen = np.random.default_rng(8).permutation(len(points))[:count]
    for some in (None, hints[chosen]):
        closest = tree.nearest(points[chosen], rest_points=home[chosen], region=0.8, hints=some)
        assert (closest.faces == whole.faces[chosen]).all() and (closest.points == whole.points[chosen]).all()


def test_the_direction_of_a_thin_gap_is_kept():
    """A point 1e-9 above a face 1 m wide: its closest point lies straight below."""
    positions, faces = mesh("sheet")
    points = samples(positions, faces)[-len(faces) :]
    points[:, 1] += 1e-9
    closest = tree_of(positions, faces).nearest(points)
    assert (closest.points[:, 1] == 0).all()
    assert np.abs((points - closest.points)[:, [0, 2]]).max() < 1e-15


def test_no_points_have_no_closest():
    closest = tree_of(*sphere(1)).nearest(np.empty((0, 3)))
    assert closest.faces.shape == (0,) and closest.points.shape == (0, 3)
