"""Files of motions: one motion in many forms, its vertical axis, recording errors. Damage: test_fuzz.py."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from snug.body.skeleton import JOINT
from snug.file_options import MotionFileOptions
from snug.motion.files import HAND_DAMPING, HANDS, load_motions, read_motion
from snug.motion.library import make_motion
from snug.motion.motion import Motion, MotionError, clear_arms, place, resample, transition
from tests.snug.motion.cmu_clips import amc_frame, write_clip
from tests.snug.motion.motion_forms import TO_Z_UP, Y_UP, of_root, write_forms

KICK = make_motion("kick").cut(0, 40)
WALK = make_motion("walk")


def write(path, motion, turn=Y_UP, **changes):
    """Write an .npz of a motion in a world turned by a matrix (3, 3)."""
    poses, trans = of_root(motion, turn)
    np.savez(path, **{"poses": poses, "trans": trans, "fps": motion.fps, **changes})
    return path


def read(path, **options):
    return read_motion(path, MotionFileOptions(**options))


def refused(path, pattern, **options):
    """Return whether reading is refused in one line that names the file; assert that it matches `pattern`."""
    with pytest.raises(MotionError) as caught:
        load_motions(path, options=MotionFileOptions(**options))
    message = str(caught.value)
    assert re.search(pattern, message), message
    return path.name in message and "\n" not in message and len(message) < 500


def angles(poses, others):
    """Return the angles between the rotations of two motions, (...) [rad]."""
    one, other = (Rotation.from_rotvec(p.reshape(-1, 3)) for p in (poses, others))
    return (one.inv() * other).magnitude()


@pytest.mark.parametrize("turn", [Y_UP, TO_Z_UP], ids=["y up", "z up"])
def test_one_motion_in_every_form_is_read_to_the_same_poses(tmp_path, turn):
    expected = place(KICK)
    expected.poses[:, HANDS] *= HAND_DAMPING
    for file in write_forms(tmp_path, KICK, turn):
        motion = resample(place(read(file)))
        exact = 1e-8 if file.suffix != ".bvh" else 1e-6
        assert motion.frames == KICK.frames and motion.fps == 30.0
        assert angles(motion.poses, expected.poses).max() < exact, file.name
        np.testing.assert_allclose(motion.translations, expected.translations, atol=exact)
    [loaded], spread = load_motions(file), clear_arms(motion)
    assert np.array_equal(loaded.poses, spread.poses) and loaded.name == file.stem


@pytest.mark.parametrize(("joints", "hand"), [(24, 0.05), (52, 0.0), (55, 0.0)])
def test_hands_are_damped_and_fingers_are_no_hands(tmp_path, joints, hand):
    poses = np.zeros((3, joints, 3))
    poses[:, 20:, 2] = 0.5
    path = write(tmp_path / "clip.npz", replace(KICK.cut(0, 3), poses=np.zeros((3, 24, 3))), poses=poses)
    np.testing.assert_allclose(read(path).poses[:, [20, 21, 22, 23], 2], [[0.05, 0.05, hand, hand]] * 3)


@pytest.mark.parametrize(
    ("changes", "pattern"),
    [
        ({"poses": KICK.poses[:, :23, None]}, r"'poses' has shape \(40, 23, 1, 3\)"),
        ({"poses": KICK.poses[:, :21]}, "no array 'root_orient'"),
        ({"poses": KICK.poses[:, :20]}, "72 .SMPL."),
        ({"poses": np.zeros((0, 72)), "trans": np.zeros((0, 3))}, "empty"),
        ({"poses": np.zeros((200_000, 66)), "trans": np.zeros((200_000, 3))}, "200000 frames"),
        ({"poses": np.zeros((20_000, 66)), "trans": np.zeros((20_000, 3)), "fps": 10}, "last 2000 s"),
        ({"poses": np.degrees(KICK.poses)}, "radians, not degrees"),
        ({"trans": KICK.translations + 1e5}, "metres"),
        ({"trans": KICK.translations.astype(complex)}, "holds no numbers"),
        ({"trans": KICK.translations[1:]}, r"'trans' has shape \(39, 3\); give \(40, 3\)"),
        ({"trans": np.full((40, 3), np.nan)}, "not finite in any frame"),
        ({"fps": 0}, "rates are 5 to 1000"),
        ({"fps": np.array([30.0, 30.0])}, "are 2 numbers"),
        (None, "no array .poses. .found none"),
    ],
)
def test_what_is_no_motion_is_refused(tmp_path, changes, pattern):
    path = tmp_path / "clip.npz"
    np.savez(path, x=np.zeros(3)) if changes is None else write(path, KICK, **changes)
    assert refused(path, pattern)


def test_a_rate_is_said_once(tmp_path):
    clip = write(tmp_path / "clip.npz", KICK)
    assert refused(clip, "states 30 .* fps=60", fps=60.0) and read(clip, fps=30.0).fps == 30.0
    assert read(write_clip(tmp_path, [amc_frame(1)]), fps=60.0).fps == 60.0
    np.savez(clip, poses=KICK.poses, trans=KICK.translations)
    assert refused(clip, "no frame rate; add ,fps=N")


def test_files_of_a_subjects_shape_are_left_out_of_a_folder(tmp_path):
    write(tmp_path / "walk.npz", WALK)
    for name in ("shape.npz", "neutral_stagei.npz"):
        np.savez(tmp_path / name, betas=np.zeros(10))
    assert [motion.name for motion in load_motions(tmp_path)] == ["walk"]


class TestUpAxis:
    @pytest.mark.parametrize(
        ("turn", "up", "says"),
        [
            (Y_UP, "z", "stands along z in 0 % .*,up=y"),
            (TO_Z_UP, "y", "stands along y in 0 %"),
            (np.diag([1.0, -1.0, -1.0]), "", "in 0 % of the frames only"),
            (np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]]), "", "in 0 % of the frames only"),
        ],
    )
    def test_a_body_on_its_back_is_refused(self, tmp_path, turn, up, says):
        assert refused(write(tmp_path / "clip.npz", WALK, turn), says, up=up)

    @pytest.mark.parametrize("turn", [Y_UP, TO_Z_UP], ids=["y up", "z up"])
    def test_a_fall_passes_and_a_crawl_has_to_be_told(self, tmp_path, turn):
        standing = WALK.cut(0, 30)
        lying = standing.poses[-1].copy()
        lying[0] = (Rotation.from_euler("x", -90, degrees=True) * Rotation.from_rotvec(lying[0])).as_rotvec()
        fall = transition(standing.poses[-1], lying, 12)
        poses = np.concatenate([standing.poses, fall, np.repeat(lying[None], 14, axis=0)])
        path = np.zeros((len(poses), 3))
        path[:30], path[30:] = standing.translations, standing.translations[-1]
        path[30:, 1] -= np.minimum(np.arange(26) / 12, 1.0) * 0.75
        motion = read(write(tmp_path / "fall.npz", Motion("fall", poses, path), turn))
        assert re.search(r"as the body stands in [67]\d % of the frames", motion.source)
        expected = place(Motion("", poses, path)).translations
        np.testing.assert_allclose(place(motion).translations, expected, atol=1e-9)
        # On its front it travels the way of its head: that way is not up.
        crawl = Rotation.from_euler("x", 90, degrees=True).as_matrix()
        away = np.stack((np.zeros(60), np.zeros(60), np.linspace(0, 1.5, 60)), axis=1)
        crawling = write(
            tmp_path / "crawl.npz", Motion("", np.zeros((60, 24, 3)), away @ crawl), turn @ crawl
        )
        assert refused(crawling, "lowest joint moves by 1.5 m|stands along")


def spike(frame, joint="right_elbow", by=2.5):
    """Return poses of the kick in which one joint is turned further in one frame."""
    poses = KICK.poses.copy()
    further = Rotation.from_rotvec([0.0, by, 0.0])
    poses[frame, JOINT[joint]] = (further * Rotation.from_rotvec(poses[frame, JOINT[joint]])).as_rotvec()
    return poses


class TestRecordingErrors:
    def test_a_joint_that_jumps_is_named_or_mended(self, tmp_path):
        path = write(tmp_path / "clip.npz", KICK, poses=spike(20))
        assert refused(path, "right_elbow in frames 18-22; add ,repair")
        motion, whole = read(path, repair=True), read(write(tmp_path / "whole.npz", KICK))
        assert "repaired: right_elbow in frames 18-22" in motion.source
        assert 0 < angles(motion.poses, whole.poses).max() < 0.2  # the shortest arc over six frames

    def test_numbers_that_are_not_finite_are_named_or_mended(self, tmp_path):
        array, trans = KICK.poses.copy(), KICK.translations.copy()
        array[5:7, JOINT["left_knee"], 0] = np.nan
        trans[-1, 1] = np.inf
        path = write(tmp_path / "clip.npz", KICK, poses=array, trans=trans)
        named = "left_knee in frames 5-6, the root's path in frames 39-39"
        assert refused(path, f"{named}; add ,repair")
        motion = read(path, repair=True)
        np.testing.assert_array_equal(motion.translations[-1], KICK.translations[-2])
        middle = Rotation.from_rotvec(motion.poses[4:8, JOINT["left_knee"]])
        steps = (middle[:-1].inv() * middle[1:]).as_rotvec()
        np.testing.assert_allclose(steps, np.tile(steps[0], (3, 1)), atol=1e-9)

    @pytest.mark.parametrize("at", [0, 39])
    def test_a_spike_at_an_end_is_held(self, tmp_path, at):
        poses = np.repeat(KICK.poses[:1], 40, axis=0)
        still = write(tmp_path / "whole.npz", KICK, poses=poses.copy())
        poses[at, JOINT["neck"]] = [0.0, 2.6, 0.0]
        path = write(tmp_path / "clip.npz", KICK, poses=poses)
        assert refused(path, "neck in frames")
        assert angles(read(path, repair=True).poses, read(still).poses).max() < 1e-7

    def test_a_root_that_jumps_and_comes_back_is_mended_and_one_that_stays_is_not(self, tmp_path):
        trans = KICK.translations.copy()
        trans[11] += [1.0, 0.0, 0.0]
        path = write(tmp_path / "clip.npz", KICK, trans=trans)
        assert refused(path, "the root's path in frames 9-13")
        assert np.abs(read(path, repair=True).translations - KICK.translations).max() < 0.05
        trans[11:] += [9.0, 0.0, 0.0]
        path = write(tmp_path / "clip.npz", KICK, trans=trans)
        assert refused(path, "left by interpolation, so cut the clip", repair=True)

    def test_too_many_are_not_mended(self, tmp_path):
        poses = KICK.poses.copy()
        for frame in range(5, 34, 7):  # so near to each other that nothing between two of them is trusted
            poses[frame] = spike(frame)[frame]
        path = write(tmp_path / "spikes.npz", KICK, poses=poses)
        assert refused(path, "82 % of the frames; check frame rate and units", repair=True)
