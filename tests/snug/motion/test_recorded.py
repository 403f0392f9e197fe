"""Recorded clips of the library: roles, frozen content, and that no recording error is left."""

import hashlib

import numpy as np
import pytest

from snug.body.skeleton import sole_points
from snug.motion.library import (
    CLIPS,
    CONTROL,
    DYNAMIC_TEST,
    DYNAMIC_VALIDATION,
    LIBRARY,
    TEST,
    TRAIN,
    VALIDATION,
    clip_of,
    make_motion,
)
from snug.motion.motion import arm_clearance
from snug.motion.recording import MAX_TURN_SPEED, check_recording
from tests.snug.motion.motion_forms import joint_speeds

TURN_LIMIT = 30.0  # [rad/s] the notice's: half of what is let pass in a user's file


@pytest.fixture(scope="module")
def clips():
    return {name: make_motion(name) for name in CLIPS}


def test_each_motion_has_one_role_and_no_clip_has_frames_in_two():
    roles = {
        "training": TRAIN,
        "validation": (*VALIDATION, *DYNAMIC_VALIDATION),
        "test": TEST,
        "none": CONTROL,
    }
    names = [name for role in roles.values() for name in role]
    assert len(set(names)) == len(names) and set(DYNAMIC_TEST) < set(TEST)
    clips_of = {role: {clip_of(name) for name in names} for role, names in roles.items()}
    assert sum(map(len, clips_of.values())) == len(set().union(*clips_of.values()))
    assert set(CLIPS) < set().union(*clips_of.values())
    assert set(LIBRARY) == {*names, *CLIPS}


def test_the_clips_are_frozen(clips):
    for name, clip in CLIPS.items():
        motion = clips[name]
        arrays = (motion.poses.astype(np.float32), motion.translations.astype(np.float32))
        digest = hashlib.sha256(b"".join(array.tobytes() for array in arrays)).hexdigest()
        assert (motion.frames, digest[:12]) == (clip.frames, clip.digest), name


@pytest.mark.parametrize("name", CLIPS)
def test_a_clip_is_a_person_on_the_floor_without_recording_errors(name, clips):
    motion = clips[name]
    assert motion.name == name and motion.fps == 30.0 and motion.kind == CLIPS[name].content
    assert joint_speeds(motion).max() < TURN_LIMIT < MAX_TURN_SPEED
    check_recording(motion)
    lowest = sole_points(motion.poses, motion.translations)[..., 1].min(axis=1)
    assert abs(np.percentile(lowest, 2.0)) < 1e-6
    assert (arm_clearance(motion).min(axis=1) > np.radians(25.0)).mean() >= 0.95
    np.testing.assert_allclose(motion.translations[0, [0, 2]], 0.0, atol=1e-6)
