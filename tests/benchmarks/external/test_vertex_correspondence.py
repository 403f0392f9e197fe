"""Meshes whose vertices stand in another order are laid on each other by their triangles."""

from __future__ import annotations

import time

import numpy as np
import pytest

from benchmarks.external.vertex_correspondence import same_topology
from benchmarks.meshes import torus

RANDOM = np.random.default_rng(7)


@pytest.mark.parametrize("flip", [False, True])
def test_a_symmetric_mesh_is_laid_on_itself_where_it_is_nearest(flip):
    i, j = np.meshgrid(np.arange(6), np.arange(6), indexing="ij")
    points = np.stack([i, j, 0 * i], axis=-1).reshape(-1, 3).astype(float)
    a = (i[:-1, :-1] * 6 + j[:-1, :-1]).ravel()
    faces = np.concatenate([np.stack([a, a + 6, a + 7], 1), np.stack([a, a + 7, a + 1], 1)])
    two = np.concatenate([faces, faces + 36])  # two pieces of the same form
    both = np.concatenate([points, points + np.array([9.0, 0.0, 0.0])])
    order = RANDOM.permutation(72)
    theirs = np.argsort(order)[two][RANDOM.permutation(len(two))]
    correspondence = same_topology(theirs[:, ::-1] if flip else theirs, two, both[order], both)
    assert np.array_equal(order[correspondence], np.arange(72))
    theirs[0] = theirs[0, [1, 0, 2]]
    assert same_topology(theirs[:-1], two, both[order], both) is None


def test_parts_that_share_one_vertex_are_laid_on_each_other():
    ours = np.array([[0, 1, 2], [0, 3, 4]])
    points = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [-1, 0, 0], [-1, -1.5, 0]])
    order = np.array([3, 1, 4, 0, 2])
    theirs = np.argsort(order)[ours]
    assert np.array_equal(order[same_topology(theirs, ours, points[order], points)], np.arange(5))


def test_a_mesh_with_a_thousand_symmetries_is_laid_on_itself_in_a_moment():
    points, faces, _ = torus(24, 0.3, 0.1)
    order = RANDOM.permutation(len(points))
    clock = time.perf_counter()
    correspondence = same_topology(np.argsort(order)[faces], faces, points[order] + 0.01, points)
    assert np.array_equal(order[correspondence], np.arange(len(points)))
    assert time.perf_counter() - clock < 10.0
