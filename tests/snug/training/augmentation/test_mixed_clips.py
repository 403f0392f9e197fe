"""Mixed clips are continuous, repeat, and keep arms, thighs and legs where people have them."""

from dataclasses import replace

import numpy as np

from snug.body.skeleton import JOINT, joint_positions
from snug.motion.library import make_motion
from snug.motion.motion import Motion, arm_clearance, lap_clearance, mirror_motion
from snug.recipe import DEFAULT
from snug.training import augmentation
from snug.training.augmentation import augment, make_mixed_clips
from tests.snug.motion.motion_forms import joint_speeds


def test_mirror_swaps_the_sides():
    motion = make_motion("kick")
    mirror = mirror_motion(motion)
    plain = joint_positions(motion.poses, motion.translations)
    other = joint_positions(mirror.poses, mirror.translations)
    assert np.abs(other[:, 1] - plain[:, 2] * [-1, 1, 1]).max() < 1e-9  # left hip, right hip
    assert np.abs(other[:, 20] - plain[:, 21] * [-1, 1, 1]).max() < 1e-9  # wrists
    assert np.abs(mirror_motion(mirror).poses - motion.poses).max() == 0


def test_mixed_motions_are_continuous_and_repeat():
    clips = [make_motion(name) for name in ("walk", "squat", "arm_raise")]
    mixed = make_mixed_clips(clips, 300, turn=0.1, lifted=0.25, seed=3)
    again = make_mixed_clips(clips, 300, turn=0.1, lifted=0.25, seed=3)
    assert len(mixed) == 5 and all((a.poses == b.poses).all() for a, b in zip(mixed, again))
    assert make_mixed_clips(clips, 0, turn=0.1, lifted=0.25, seed=3) == []
    fastest = max(joint_speeds(clip).max() for clip in clips)
    assert max(joint_speeds(clip).max() for clip in mixed) < 2 * fastest + 2.0


def test_mixed_arms_hang_each_at_a_distance_of_its_own_clear_of_the_torso():
    clips = [make_motion(name) for name in ("walk", "squat", "jumping_jack")]
    mixed = make_mixed_clips(clips, 3000, turn=0.1, lifted=0.25, seed=3)
    nearest = np.rad2deg([arm_clearance(clip).min(axis=0) for clip in mixed])
    assert nearest.min() > 24.0
    low, high = np.percentile(nearest, (10, 90))
    assert low < 30.0 < 42.0 < high < 60.0  # a clip of the library begins at 42
    assert abs(np.corrcoef(nearest.T)[0, 1]) < 0.4  # 50 clips


def test_mixed_thighs_stay_off_the_belly():
    clips = [
        make_motion(name) for name in ("squat", "bow")
    ]  # together: a squat's legs under a bowed spine
    mixed = make_mixed_clips(clips, 3000, turn=0.1, lifted=1.0, seed=3)
    nearest = [np.rad2deg(lap_clearance(clip).min()) for clip in [*clips, *mixed]]
    assert min(nearest) > 55.0 and max(nearest) > 70.0  # 3 where nothing opens the hips


def test_mixed_thighs_are_lifted_as_high_as_hips_bend():
    standing = Motion("standing", np.zeros((60, 24, 3)), np.zeros((60, 3)))

    def lifts(lifted):
        mixed = make_mixed_clips([standing], 1800, turn=0.0, lifted=lifted, seed=3)
        hips = [JOINT["left_hip"], JOINT["right_hip"]]
        forward = [-np.rad2deg(clip.poses[:, hips, 0]) for clip in mixed]
        assert np.min(forward) > -1e-9
        return np.max(forward, axis=1).ravel()

    assert lifts(0.0).max() == 0.0
    lifted = lifts(0.25) > 0.0
    share = lifted.mean()
    assert 0.15 < share < 0.35 and lifted.reshape(-1, 2).any(1).mean() > share  # one leg alone
    assert 75.0 < lifts(1.0).max() <= 90.0


def test_mixed_frames_are_as_many_as_asked_for_and_as_memory_holds(monkeypatch):
    clips = [make_motion("walk")]  # of 120 frames
    recipe = replace(DEFAULT, mixed=3.0)
    counts = {v: len(augment(clips, recipe, vertices=v, seed=0)) for v in (1000, 500_000, 2_000_000)}
    assert counts == {1000: 6, 500_000: 3, 2_000_000: 1}
    monkeypatch.setattr(augmentation, "MAX_AUGMENTED_FRAMES", 600)
    assert len(augment(clips, replace(DEFAULT, mixed=500.0), vertices=1000, seed=0)) == 10
