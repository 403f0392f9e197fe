"""Motions: the embedded library looks like a moving person, and the tools keep what they promise."""

import numpy as np
import pytest

from snug.body.skeleton import (
    JOINT,
    PARENTS,
    REST_JOINTS,
    rotation_matrices,
    sole_points,
)
from snug.motion.coded import STOPS
from snug.motion.library import CLIPS, CONTROL, DYNAMIC_VALIDATION, TEST, VALIDATION, clip_of, make_motion
from snug.motion.motion import (
    ARMS_CLEAR,
    Motion,
    MotionError,
    arm_clearance,
    place,
    resample,
)
from tests.snug.motion.motion_forms import joint_speeds

# Those made by code; tests of recorded clips are in test_recorded.
MADE = [
    name for name in (*CONTROL, *VALIDATION, *TEST, *DYNAMIC_VALIDATION) if clip_of(name) not in CLIPS
]
STOPPING = [name for name in MADE if name in STOPS]
ACTING = [name for name in MADE if name not in STOPS]
RISING = "climbing_steps"  # its floor is steps
STAND = Motion("stand", np.zeros((30, 24, 3)), np.zeros((30, 3)))


@pytest.fixture(scope="module")
def library():
    return {name: make_motion(name) for name in ACTING}


@pytest.mark.parametrize("name", STOPPING)
def test_a_stop_holds_from_one_frame_on_with_feet_on_the_floor(name):
    motion = make_motion(name)
    moves = np.linalg.norm(np.diff(motion.poses, axis=0), axis=-1).max(-1) * 30.0  # [rad/s]
    last = np.flatnonzero(moves > 0)[-1]
    assert len(moves) - 1 - last == 36 and moves[0] < 0.2
    assert 0.5 < moves[last] <= moves.max() < 12.0  # at full speed into the stop
    assert np.all(np.diff(motion.translations, axis=0)[last + 1 :] == 0)
    soles = sole_points(motion.poses, motion.translations)[..., 1].min(axis=1)
    assert np.abs(soles).max() < 0.03 and np.degrees(arm_clearance(motion).min()) > 25.0


@pytest.mark.parametrize("name", ACTING)
def test_a_motion_is_a_moving_person(library, name):
    """Length, speeds, smoothness, hinges, floor, pace, start and room between arms and torso."""
    motion = library[name]
    assert 45 <= motion.frames <= 150 and motion.fps == 30.0
    assert 1.0 < joint_speeds(motion).max() < 15.0  # [rad/s]; a fast kick or punch is near 12
    # A step in a joint's speed of 15 rad/s within a frame would be 450 rad/s^2; a blow peaks near 200.
    rotations = rotation_matrices(motion.poses)
    steps = np.swapaxes(rotations[:-1], -1, -2) @ rotations[1:]
    jerks = np.linalg.norm(steps[1:] - steps[:-1], axis=(-1, -2)) / np.sqrt(2) * 30.0**2
    assert jerks.max() < 250.0  # [rad/s^2]
    for side, inward in (("left", -1.0), ("right", 1.0)):
        knee, elbow = (motion.poses[:, JOINT[f"{side}_{hinge}"]] for hinge in ("knee", "elbow"))
        assert np.radians(-3) < knee[:, 0].min() <= knee[:, 0].max() < np.radians(140)
        assert (inward * elbow[:, 1]).min() > np.radians(-3)
    lowest = sole_points(motion.poses, motion.translations)[..., 1].min(axis=1)
    # The pelvis path is smoothed over a few hundredths of a second, so a toe pushing off dips a little.
    highest = 0.4 if "jump" in name else 0.5 if name == RISING else 0.03
    assert -0.035 < lowest.min() <= lowest.max() < highest
    velocity = np.diff(motion.translations, axis=0) * 30.0
    assert np.linalg.norm(velocity, axis=1).max() < 4.0
    assert (
        np.linalg.norm(np.diff(velocity, axis=0) * 30.0, axis=1).max() < 45.0
    )  # a push-off is about 3.5 g
    np.testing.assert_allclose(motion.translations[0, [0, 2]], 0.0, atol=1e-12)
    assert abs(motion.translations[0, 1]) < 0.1 and rotation_matrices(motion.poses[0, 0])[2, 2] > 0.95
    assert arm_clearance(motion).min() > ARMS_CLEAR


def test_walk_has_the_published_speed_and_planted_feet(library):
    motion = library["walk"]
    steady = motion.translations[40:]
    speed = (steady[-1, 2] - steady[0, 2]) / (len(steady) - 1) * 30.0
    assert 1.0 < speed < 1.5  # [m/s] natural cadence
    balls = sole_points(motion.poses, motion.translations)[40:, [1, 4]]
    speeds = np.linalg.norm(np.diff(balls[..., [0, 2]], axis=0), axis=-1) * 30.0
    # At every moment one foot is down; it slides slowly compared with the body.
    assert np.median(speeds.min(axis=1)) < 0.25 * speed


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: make_motion("moonwalk"), r"moonwalk.*jumping_jack"),
        (lambda: Motion("bad", np.zeros((3, 24, 3)), np.zeros((4, 3)), 30.0), r"\(4, 3\)\); give"),
        (lambda: Motion("bad", np.full((3, 24, 3), np.nan), np.zeros((3, 3)), 30.0), "finite"),
        (lambda: STAND.followed_by(resample(STAND, 60.0)), "60 frames a second after 30"),
    ],
)
def test_a_motion_that_is_none_is_refused(make, words):
    with pytest.raises(MotionError, match=words):
        make()


def spinning(frames, fps, rate):
    """The left elbow turns at a constant rate about a fixed axis; the root moves at constant velocity."""
    time = np.arange(frames) / fps
    poses = np.zeros((frames, 24, 3))
    poses[:, JOINT["left_elbow"]] = rate * time[:, None] * np.array([0.6, 0.0, 0.8])
    return Motion("spin", poses, np.outer(time, [0.0, 0.1, 1.0]), fps)


@pytest.mark.parametrize(("frames", "fps"), [(121, 120.0), (76, 25.0)])
def test_resample_keeps_ends_duration_and_uniform_turning(frames, fps):
    motion = spinning(frames, fps, 1.0)
    sampled = resample(motion, 30.0)
    assert sampled.fps == 30.0
    assert abs(sampled.frames - 1 - 30.0 * (motion.frames - 1) / motion.fps) <= 0.5
    ends = [0, -1]
    np.testing.assert_allclose(sampled.poses[ends], motion.poses[ends], atol=1e-12)
    np.testing.assert_allclose(sampled.translations[ends], motion.translations[ends], atol=1e-12)
    turned = sampled.poses[:, JOINT["left_elbow"]]
    share = np.linspace(0.0, 1.0, sampled.frames)[:, None]
    np.testing.assert_allclose(turned, share * motion.poses[-1, JOINT["left_elbow"]], atol=1e-9)
    if frames == 121:
        np.testing.assert_allclose(sampled.poses, motion.poses[::4], atol=1e-12)


def test_place_faces_forward_on_the_floor():
    rng = np.random.default_rng(3)
    motion = Motion("standing", np.zeros((30, 24, 3)), np.zeros((30, 3)))
    motion.poses[:, 0] = [0.0, 2.1, 0.0]
    start = np.array([3.0, -0.7, 1.0])
    motion.translations[:] = start + np.cumsum(rng.normal(0, 0.01, (30, 3)), axis=0)
    motion.translations[:10, 1] += 0.3  # it starts in the air: the floor is not where the first frame is
    placed = place(motion)
    np.testing.assert_allclose(placed.translations[0, [0, 2]], 0.0, atol=1e-12)
    np.testing.assert_allclose(placed.poses[:, 0], 0.0, atol=1e-12)
    assert abs(sole_points(placed.poses, placed.translations)[..., 1].min()) < 0.02
    # The path turns with the body: distances stay.
    before, after = (np.linalg.norm(np.diff(m.translations, axis=0), axis=1) for m in (motion, placed))
    np.testing.assert_allclose(after, before, atol=1e-12)


def test_the_skeleton_is_the_bodys_and_its_soles_are_on_the_floor(body):
    assert tuple(body.parents) == PARENTS
    np.testing.assert_allclose(REST_JOINTS, body.joints(), atol=0.01)
    soles = sole_points(np.zeros((1, 24, 3)), np.zeros((1, 3)))[0]
    np.testing.assert_allclose(soles[:, 1], 0.0, atol=1e-12)
    for point in soles:  # each sole point lies under the foot
        assert np.linalg.norm(body.template - point, axis=1).min() < 0.03
