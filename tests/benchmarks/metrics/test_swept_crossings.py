"""Crossings between two frames, where they can be counted by hand."""

from __future__ import annotations

from types import SimpleNamespace

import ipctk
import numpy as np
import pytest

from benchmarks.meshes import in_space, random_rotation, right_grid
from benchmarks.metrics import intersections as module
from benchmarks.metrics.intersections import find_coplanar, measure_swept, swept_crossings
from benchmarks.metrics.self_intersections import self_intersections

FACES = np.array([[0, 1, 2], [3, 4, 5]])
LARGE = np.array([[-1.0, -1.0, 0.0], [3.0, -1.0, 0.0], [-1.0, 3.0, 0.0]])
SMALL = np.array([[0.0, 0.0, 0.1], [0.3, 0.0, 0.2], [0.0, 0.3, 0.3]])
DOWN = np.array([0.0, 0.0, -0.5])
NEEDLE = np.array([[-1.0, -0.01, 0.0], [1.0, 0.0, 0.0], [-1.0, 0.01, 0.0]])


def roll_out_of(*frames, judged=slice(None)):
    scene = SimpleNamespace(cloth=SimpleNamespace(faces=FACES), kept=None)
    return SimpleNamespace(scene=scene, positions=np.stack(frames), judged=judged)


def test_a_triangle_that_falls_through_another_takes_its_three_corners_with_it():
    before, after = np.concatenate([LARGE, SMALL]), np.concatenate([LARGE, SMALL + DOWN])
    for frame in (before, after):
        assert not self_intersections(frame, FACES)[0].any()  # no frame shows it
    assert swept_crossings(before, after, FACES) == swept_crossings(after, before, FACES) == 3
    turn = random_rotation(2)
    assert swept_crossings(before @ turn.T, after @ turn.T + 0.8, FACES) == 3


def test_two_needles_that_cross_meet_by_their_four_long_sides():
    across = NEEDLE[:, [1, 0, 2]] + [0.0, 0.0, 0.2]
    before, after = np.concatenate([NEEDLE, across]), np.concatenate([NEEDLE, across + DOWN])
    assert swept_crossings(before, after, FACES) == 4


def test_what_only_comes_near_or_moves_as_one_does_not_cross():
    before = np.concatenate([LARGE, SMALL])
    near = np.concatenate([LARGE, SMALL - [0.0, 0.0, 0.099]])
    assert swept_crossings(before, near, FACES) == 0
    beside = SMALL + np.array([1.00002, 1.00002, 0.0])  # 0.03 mm outside the large one's long edge
    assert swept_crossings(*(np.concatenate([LARGE, beside + way]) for way in (0.0, DOWN)), FACES) == 0
    plane, faces = right_grid(6, 6, 1.0, 1.0)
    sheet = in_space(plane)
    rolled = np.stack([np.sin(sheet[:, 0]), sheet[:, 1], np.cos(sheet[:, 0])], axis=1)
    assert swept_crossings(sheet, rolled, faces) == 0
    assert swept_crossings(sheet, sheet + np.array([50.0, 0.0, 0.0]), faces) == 0


def test_a_cloth_that_has_fallen_apart_is_left_out(monkeypatch):
    before = np.concatenate([LARGE, SMALL])
    for far in (2.0, 1e160, 1e300):
        lost = before.copy()
        lost[1] += far
        assert swept_crossings(before, lost, FACES) is None
        assert measure_swept(roll_out_of(before, before, lost)) == {}
    monkeypatch.setattr(module, "MOST_PAIRS", 2)
    assert swept_crossings(before, np.concatenate([LARGE, SMALL + DOWN]), FACES) is None


def test_what_ipctk_finds_to_meet_may_be_in_one_plane():
    points = np.random.default_rng(0).normal(size=(2, 600, 4, 3))
    test = ipctk.TightInclusionCCD(conservative_rescaling=1.0)
    maybe = find_coplanar(*points)
    for ask in (test.point_triangle_ccd, test.edge_edge_ccd):
        meet = np.array([ask(*a, *b)[0] for a, b in zip(*points)])
        assert meet.sum() > 20 and not (meet & ~maybe).any()
    assert maybe.mean() < 0.9


def test_the_mean_is_of_steps_after_the_warm_up(monkeypatch):
    above, below = np.concatenate([LARGE, SMALL]), np.concatenate([LARGE, SMALL + DOWN])
    roll_out = roll_out_of(above, below, above, above, above, below, judged=slice(2, None))
    assert measure_swept(roll_out) == {"intersections/swept": pytest.approx(1.0)}
    roll_out.judged = slice(5, None)
    assert measure_swept(roll_out) == {}
    roll_out.judged = slice(2, None)
    monkeypatch.setattr(module, "find_spec", lambda name: None)
    assert measure_swept(roll_out) == {}
