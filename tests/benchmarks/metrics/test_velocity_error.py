"""Errors of velocity and acceleration where the difference of two motions is known."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.metric import RollOut, SceneRollOuts
from benchmarks.metrics.time_errors import compare
from reference_sim import Trajectory

DT, FRAMES, WARM_UP = 0.1, 12, 3
TIMES = DT * np.arange(FRAMES)[:, None, None]
RANDOM = np.random.default_rng(4)
PULL = np.array([0.0, -1.2, 1.6])  # [m/s^2] of length 2


def roll_out(positions: np.ndarray, kept: np.ndarray | None = None) -> RollOut:
    group = SceneRollOuts(SimpleNamespace(warm_up=WARM_UP, dt=DT, kept=kept))
    times = DT * np.arange(len(positions))
    return RollOut(group, None, Trajectory(positions, np.zeros((0, 3), int), times))


def test_a_pull_that_the_other_lacks_is_the_error_of_the_acceleration():
    motion = RANDOM.normal(size=(FRAMES, 5, 3))
    errors = compare(roll_out(motion + 0.5 * TIMES**2 * PULL), roll_out(motion))
    between = TIMES[WARM_UP + 1 :] - 0.5 * DT  # a difference is the velocity there
    assert errors == pytest.approx(
        {"velocity/error": 2.0 * np.sqrt((between**2).mean()), "acceleration/error": 2.0}, rel=1e-9
    )


def test_a_motion_one_frame_late_is_slower_by_one_frame_of_its_acceleration():
    whole = 0.5 * (DT * np.arange(FRAMES + 1)[:, None, None]) ** 2 * PULL + RANDOM.normal(size=(5, 3))
    errors = compare(roll_out(whole[:-1]), roll_out(whole[1:]))
    assert errors == pytest.approx({"velocity/error": 2.0 * DT, "acceleration/error": 0.0}, abs=1e-9)


def test_a_place_alone_is_no_error_and_the_opposite_motion_is_twice_it():
    motion = TIMES * [3.0, 0.0, 4.0] + np.zeros((5, 3))
    still = compare(roll_out(motion + 7.0), roll_out(motion))
    assert still == pytest.approx({"velocity/error": 0.0, "acceleration/error": 0.0}, abs=1e-9)
    assert compare(roll_out(-motion), roll_out(motion))["velocity/error"] == pytest.approx(10.0)


def test_what_has_too_few_frames_or_leaves_some_out_has_no_error():
    motion = RANDOM.normal(size=(FRAMES, 5, 3))
    short = roll_out(motion[: WARM_UP + 2])
    assert set(compare(short, roll_out(motion))) == {"velocity/error"}
    left_out = roll_out(motion, kept=np.array([0, 1, 5]))
    assert compare(left_out, left_out) == {}
