"""The collision clean-up: what is out stays, what is in comes out to 2 mm, and it is a method of its own."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.methods.networks import MARGIN, CollisionPostProcessing
from reference_sim import Obstacle
from tests.snug.training.dressing import swaying, tube_dress


@pytest.fixture(scope="module")
def scene():
    dressed, motion = tube_dress(), swaying(8)
    body = dressed.body
    skin = body.vertices(motion.poses, motion.translations)
    clean = CollisionPostProcessing(dressed, skin)
    obstacle = Obstacle(skin, body.faces, rest_positions=body.rest_vertices())
    return clean, obstacle, dressed.skin(motion, smoothing=20)


def test_what_lies_below_the_skin_comes_out_to_two_millimetres_and_all_else_stays(scene):
    """The trunk is squeezed by 30 %: most vertices begin below the skin. Hollows are allowed for."""
    clean, obstacle, x = scene
    far = obstacle.signed_distance(x[3], 3) > 0.01
    assert far.mean() > 0.5 and np.array_equal(clean(x[3], 3)[far], x[3][far])
    for frame in (0, 5):
        middle = x[frame].mean(axis=0)
        squeezed = middle + (x[frame] - middle) * [0.7, 1.0, 0.7]
        before = obstacle.signed_distance(squeezed, frame)
        after = obstacle.signed_distance(clean(squeezed, frame), frame)
        assert (before < 0).mean() > 0.3
        assert (after < 0).mean() < 0.01 and (after < 0.9 * MARGIN).mean() < 0.1
        moved = np.linalg.norm(clean(squeezed, frame) - squeezed, axis=1)
        deep = before < 0
        # The way out is the depth and the margin, along a normal that bends over the surface.
        assert np.median(np.abs(moved[deep] - (MARGIN - before[deep]))) < 1e-3


def test_what_lies_deep_finds_the_near_way_out_whatever_came_before(scene):
    """Faces remembered from another pose may speed the search up, and change nothing."""
    clean, obstacle, x = scene
    middle = x[0].mean(axis=0)
    squeezed = middle + (x[0] - middle) * [0.4, 1.0, 0.4]
    assert (obstacle.signed_distance(squeezed, 0) < -0.03).mean() > 0.3
    clean(x[5], 5)
    first = clean(squeezed, 0)
    clean(middle - 3 * (x[4] - middle), 4)
    assert np.array_equal(clean(squeezed, 0), first)
    nearest = obstacle.planes(squeezed.astype(np.float32).astype(float), 0, clean.patch.sample_rest)
    depth = np.linalg.norm(squeezed - nearest.points, axis=1)
    moved = np.linalg.norm(first - squeezed, axis=1)
    deep = depth > 0.03
    assert (moved[deep] < depth[deep] + 1.5 * MARGIN).all()
