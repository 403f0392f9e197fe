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


def write(path, motion, turn=Y_UP, **changes):
    """An .npz of a motion in a world turned by a matrix (3, 3)."""
    poses, trans = of_root(motion, turn)
    np.savez(path, **{"poses": poses, "trans": trans, "fps": motion.fps, **changes})
    return path


def with_arms_as_recorded(path):
    """Return the motion of a file with its arms as recorded; assert that `load_motions` gives it spread."""
    motion = resample(place(read_motion(path, MotionFileOptions())))
    [loaded], spread = load_motions(path), clear_arms(motion)
    for name in ("poses", "translations"):
        np.testing.assert_array_equal(getattr(loaded, name), getattr(spread, name))
    return motion


def refused(path, pattern, **reading):
    """Return whether reading is refused in one line that names the file; assert that it matches `pattern`."""
    with pytest.raises(MotionError) as caught:
        load_motions(path, options=MotionFileOptions(**reading))
    message = str(caught.value)
    assert re.search(pattern, message), message
    return path.name in message and "\n" not in message and len(message) < 500


def angles(poses, others):
    """Between the rotations of two motions, (...) [rad]."""
    one, other = (Rotation.from_rotvec(p.reshape(-1, 3)) for p in (poses, others))
    return (one.inv() * other).magnitude()


class TestForms:
    @pytest.mark.parametrize("turn", [Y_UP, TO_Z_UP], ids=["y up", "z up"])
    def test_one_motion_in_every_form_is_read_to_the_same_poses(self, tmp_path, turn):
        expected = place(KICK)
        expected.poses[:, HANDS] *= HAND_DAMPING
        files = write_forms(tmp_path, KICK, turn)
        assert len(files) == 16
        for file in files:
            motion = with_arms_as_recorded(file)
            exact = 1e-9 if file.suffix != ".bvh" else 1e-7
            assert motion.frames == KICK.frames and motion.fps == 30.0
            assert angles(motion.poses, expected.poses).max() < 10 * exact, file.name
            np.testing.assert_allclose(motion.translations, expected.translations, atol=10 * exact)

    @pytest.mark.parametrize(("joints", "hand"), [(24, 0.05), (52, 0.0), (55, 0.0)])
    def test_hands_are_damped_and_fingers_are_no_hands(self, tmp_path, joints, hand):
        poses = np.zeros((3, joints, 3))
        poses[:, 20:, 2] = 0.5
        path = write(tmp_path / "clip.npz", replace(KICK.cut(0, 3), poses=np.zeros((3, 24, 3))), poses=poses)
        motion = read_motion(path, MotionFileOptions())
        np.testing.assert_allclose(motion.poses[:, [20, 21, 22, 23], 2], [[0.05, 0.05, hand, hand]] * 3)

    def test_a_file_of_poses_alone_needs_a_rate_and_stays_in_place(self, tmp_path):
        np.save(tmp_path / "poses.npy", KICK.poses.reshape(-1, 72))
        assert refused(tmp_path / "poses.npy", "no frame rate; add ,fps=N behind")
        motion = read_motion(tmp_path / "poses.npy", MotionFileOptions(fps=30.0))
        assert (motion.translations == 0).all() and "the root stays" in motion.source

    @pytest.mark.parametrize(
        ("changes", "pattern"),
        [
            ({"poses": KICK.poses[:, :23, None]}, r"'poses' has shape \(40, 23, 1, 3\)"),
            ({"poses": KICK.poses[:, :21]}, "no array 'root_orient'"),
            ({"poses": KICK.poses[:, :20]}, "72 .SMPL."),
            ({"poses": np.zeros((0, 72)), "trans": np.zeros((0, 3))}, "empty"),
            ({"poses": np.zeros((200_000, 66)), "trans": np.zeros((200_000, 3))}, "200000 frames"),
            ({"poses": np.zeros((20_000, 66)), "trans": np.zeros((20_000, 3)), "fps": 10}, "lasts 2000 s"),
            ({"poses": np.degrees(KICK.poses)}, "radians, not degrees"),
            ({"poses": np.zeros((40, 70))}, r"'poses' has shape \(40, 70\)"),
            ({"trans": KICK.translations + 1e5}, "metres"),
            ({"trans": KICK.translations.astype(complex)}, "holds no numbers"),
            ({"trans": KICK.translations[1:]}, r"'trans' has shape \(39, 3\); give \(40, 3\)"),
            ({"fps": 0}, "rates are 5 to 1000"),
            ({"fps": 1 / 120}, "rates are 5 to 1000"),
            ({"fps": np.array([30.0, 30.0])}, "one number"),
        ],
    )
    def test_what_is_no_motion_is_refused(self, tmp_path, changes, pattern):
        assert refused(write(tmp_path / "clip.npz", KICK, **changes), pattern)

    def test_rotations_that_are_none_are_refused(self, tmp_path):
        path, rest = tmp_path / "clip.npz", {"trans": KICK.translations, "fps": 30.0}
        np.savez(path, **rest)
        assert refused(path, "no array .poses. .found fps, trans.")
        matrices = Rotation.from_rotvec(KICK.poses.reshape(-1, 3)).as_matrix().reshape(-1, 24, 3, 3)
        quaternions = Rotation.from_rotvec(KICK.poses.reshape(-1, 3)).as_quat().reshape(-1, 24, 4)
        matrices[7, 5] *= 1.1
        np.savez(path, rotations=matrices, **rest)
        assert refused(path, "frame 7, joint 5 is no rotation matrix")
        matrices[7, 5] = np.diag([1.0, 1.0, -1.0])
        np.savez(path, rotations=matrices, **rest)
        assert refused(path, "frame 7, joint 5 is no rotation matrix")
        np.savez(path, quaternions=quaternions, **rest)
        assert refused(path, "name the array 'quaternions_xyzw'")
        quaternions[3, 2] *= 1.1
        np.savez(path, quaternions_xyzw=quaternions, **rest)
        assert refused(path, "frame 3, joint 2 is no unit quaternion")

    def test_a_rate_is_said_once(self, tmp_path):
        assert refused(write(tmp_path / "clip.npz", KICK), "states 30 .* fps=60 is given", fps=60.0)
        assert read_motion(write(tmp_path / "clip.npz", KICK), MotionFileOptions(fps=30.0)).fps == 30.0
        assert read_motion(write_clip(tmp_path, [amc_frame(1)]), MotionFileOptions(fps=60.0)).fps == 60.0


class TestUpAxis:
    def test_z_up_is_found_and_placed(self, tmp_path):
        # Upright in a z-up world is a quarter turn about x; this person then faces +x there.
        upright = Rotation.from_euler("z", 90, degrees=True) * Rotation.from_euler("x", 90, degrees=True)
        poses, rise = np.zeros((121, 24, 3)), np.linspace(0.0, 0.3, 121)
        poses[:, 0] = upright.as_rotvec()
        poses[:, JOINT["left_elbow"], 1] = -0.7
        poses[:, JOINT["right_wrist"], 0] = 0.5
        path = np.stack((2.0 * rise, np.full(121, 9.0), rise), axis=1)
        np.savez(tmp_path / "clip.npz", poses=poses, trans=path, mocap_framerate=120.0, gender="neutral")
        motion = with_arms_as_recorded(tmp_path / "clip.npz")
        assert (motion.name, motion.frames, motion.fps, motion.kind) == ("clip", 31, 30.0, "recorded")
        assert "z up, as the body stands in 100 % of the frames" in motion.source
        np.testing.assert_allclose(motion.poses[:, 0], 0.0, atol=1e-9)
        np.testing.assert_allclose(motion.poses[:, JOINT["left_elbow"]], [[0, -0.7, 0]] * 31, atol=1e-12)
        np.testing.assert_allclose(motion.poses[:, JOINT["right_wrist"], 0], 0.05)
        # Forward along its own heading is +z, up is +y.
        travelled = motion.translations[-1] - motion.translations[0]
        np.testing.assert_allclose(travelled, [0, 0.3, 0.6], atol=1e-9)

    def test_a_body_on_its_back_is_refused(self, tmp_path):
        walk = make_motion("walk")
        assert refused(
            write(tmp_path / "y.npz", walk),
            "with z up the body lies .* along y in 100 %.*,up=y behind",
            up="z",
        )
        assert refused(write(tmp_path / "z.npz", walk, TO_Z_UP), "with y up .* ,up=z", up="y")
        for up in ("y", "z"):
            path = write(tmp_path / "clip.npz", walk, TO_Z_UP if up == "z" else Y_UP)
            assert f"{up} up as given" in read_motion(path, MotionFileOptions(up=up)).source
        camera, side = np.diag([1.0, -1.0, -1.0]), np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]])
        assert refused(write(tmp_path / "camera.npz", walk, camera), "neither along y nor along z: along -y")
        assert refused(write(tmp_path / "side.npz", walk, side), "neither along y nor along z: along x")

    @pytest.mark.parametrize("turn", [Y_UP, TO_Z_UP], ids=["y up", "z up"])
    def test_a_fall_passes_and_a_crawl_has_to_be_told(self, tmp_path, turn):
        standing = make_motion("walk").cut(0, 30)
        lying = standing.poses[-1].copy()
        lying[0] = (Rotation.from_euler("x", -90, degrees=True) * Rotation.from_rotvec(lying[0])).as_rotvec()
        fall = transition(standing.poses[-1], lying, 12)
        poses = np.concatenate([standing.poses, fall, np.repeat(lying[None], 14, axis=0)])
        path = np.zeros((len(poses), 3))
        path[:30], path[30:] = standing.translations, standing.translations[-1]
        path[30:, 1] -= np.minimum(np.arange(26) / 12, 1.0) * 0.75
        motion = read_motion(
            write(tmp_path / "fall.npz", Motion("fall", poses, path), turn), MotionFileOptions()
        )
        assert re.search(r"as the body stands in [67]\d % of the frames", motion.source)
        np.testing.assert_allclose(
            place(motion).translations, place(Motion("", poses, path)).translations, atol=1e-9
        )
        # On its front it travels the way of its head: that way is not up.
        crawl = Rotation.from_euler("x", 90, degrees=True).as_matrix()
        away = np.stack((np.zeros(60), np.zeros(60), np.linspace(0, 1.5, 60)), axis=1)
        crawling = Motion("crawl", np.zeros((60, 24, 3)), away @ crawl)
        assert refused(
            write(tmp_path / "crawl.npz", crawling, turn @ crawl),
            "lowest joint moves by 1.5 m|stands neither",
        )


class TestGlitches:
    def spoiled(self, frame=20, joint="right_elbow", by=2.5):
        poses = KICK.poses.copy()
        spike = Rotation.from_rotvec([0.0, by, 0.0])
        poses[frame, JOINT[joint]] = (spike * Rotation.from_rotvec(poses[frame, JOINT[joint]])).as_rotvec()
        return replace(KICK, poses=poses)

    def test_a_joint_that_jumps_is_named_or_mended(self, tmp_path):
        path = write(tmp_path / "clip.npz", self.spoiled())
        assert refused(path, "right_elbow jumps in frames 18-22; add ,repair")
        motion = read_motion(path, MotionFileOptions(repair=True))
        assert "repaired: right_elbow jumps in frames 18-22" in motion.source
        error = angles(
            motion.poses, read_motion(write(tmp_path / "whole.npz", KICK), MotionFileOptions()).poses
        )
        assert 0 < error.max() < 0.2  # the shortest arc over six frames of a kick

    @pytest.mark.parametrize("form", ["poses", "rotations", "quaternions"])
    def test_numbers_that_are_not_finite_are_named_or_mended(self, tmp_path, form):
        values = {"poses": KICK.poses}
        flat = Rotation.from_rotvec(KICK.poses.reshape(-1, 3))
        values["rotations"] = flat.as_matrix().reshape(-1, 24, 3, 3)
        values["quaternions"] = flat.as_quat(scalar_first=True).reshape(-1, 24, 4)
        array = values[form].copy()
        array[5:7, JOINT["left_knee"], 0] = np.nan
        trans = KICK.translations.copy()
        trans[-1, 1] = np.inf
        np.savez(tmp_path / "clip.npz", trans=trans, fps=30.0, **{form: array})
        named = "left_knee is not finite in frames 5-6, the root's path is not finite in frames 39-39"
        assert refused(tmp_path / "clip.npz", f"{named}; add ,repair")
        motion = read_motion(tmp_path / "clip.npz", MotionFileOptions(repair=True))
        assert f"repaired: {named}" in motion.source
        np.testing.assert_array_equal(motion.translations[-1], KICK.translations[-2])
        middle = Rotation.from_rotvec(motion.poses[4:8, JOINT["left_knee"]])
        steps = (middle[:-1].inv() * middle[1:]).as_rotvec()
        np.testing.assert_allclose(steps, np.tile(steps[0], (3, 1)), atol=1e-9)

    @pytest.mark.parametrize("at", [0, 1, 38, 39])
    def test_a_spike_at_an_end_is_held(self, tmp_path, at):
        still = replace(KICK, poses=np.repeat(KICK.poses[:1], 40, axis=0))
        poses = still.poses.copy()
        poses[at, JOINT["neck"]] = [0.0, 2.6, 0.0]
        path = write(tmp_path / "clip.npz", replace(KICK, poses=poses))
        assert refused(path, "neck jumps in frames")
        whole = read_motion(write(tmp_path / "whole.npz", still), MotionFileOptions())
        assert angles(read_motion(path, MotionFileOptions(repair=True)).poses, whole.poses).max() < 1e-7

    def test_a_root_that_jumps_and_comes_back_is_mended_and_one_that_stays_is_not(self, tmp_path):
        trans = KICK.translations.copy()
        trans[11] += [1.0, 0.0, 0.0]
        path = write(tmp_path / "clip.npz", replace(KICK, translations=trans))
        assert refused(path, "the root's path jumps in frames 9-13")
        mended = read_motion(path, MotionFileOptions(repair=True)).translations
        assert np.abs(mended - KICK.translations).max() < 0.05
        trans[11:] += [9.0, 0.0, 0.0]
        path = write(tmp_path / "clip.npz", replace(KICK, translations=trans))
        assert refused(path, "path jumps after frame .* cut the clip", repair=True)

    def test_too_many_are_not_mended(self, tmp_path):
        noise = np.random.default_rng(0).normal(0.0, 1.5, KICK.poses.shape)
        path = write(tmp_path / "clip.npz", replace(KICK, poses=noise))
        assert refused(path, "of the frames .* check frame rate and units", repair=True)
        poses = KICK.poses.copy()
        for frame in range(5, 34, 7):  # so near to each other that nothing between two of them is trusted
            poses[frame, JOINT["right_elbow"]] = self.spoiled(frame).poses[frame, JOINT["right_elbow"]]
        path = write(tmp_path / "spikes.npz", replace(KICK, poses=poses))
        assert refused(path, "in 82 % of the frames .* check frame rate and units", repair=True)
        assert refused(
            write(tmp_path / "nan.npz", KICK, trans=np.full((40, 3), np.nan)), "not finite in any frame"
        )
