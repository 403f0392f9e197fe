"""ASF and AMC files: what is read of them, put on the body, recorded clips, and each broken file refused."""

import os
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from snug.body.parametric_body import Body
from snug.body.skeleton import (
    JOINT,
    LEG_LENGTH,
    global_rotations,
    joint_positions,
)
from snug.file_options import MotionFileOptions
from snug.motion.acclaim import CMU_RATE, JOINT_BONES, read_amc, read_asf, read_asf_amc, world_turns
from snug.motion.files import load_motions, read_motion
from snug.motion.motion import MotionError
from snug.motion.retarget import LIMBS
from tests.snug.motion.cmu_clips import CHAIN, METRES, amc_frame, cmu_like, write_clip

CLIPS = Path(os.environ.get("CMU_MOTIONS", Path(__file__).parents[4] / "shared/data/cmu"))


class TestParser:
    def test_lengths_axes_and_hierarchy(self, tmp_path):
        path = tmp_path / "chain.asf"
        path.write_text(CHAIN)
        skeleton = read_asf(path)
        assert list(skeleton.bones) == ["root", "upper", "lower"]
        upper, lower = skeleton.bones["upper"], skeleton.bones["lower"]
        assert upper.length == pytest.approx(10 * 0.0254 / 0.45)
        np.testing.assert_allclose(upper.direction, [0, 1, 0])  # made unit length
        assert (upper.channels, lower.channels, lower.parent) == (("rx", "ry", "rz"), ("rx",), "upper")
        np.testing.assert_allclose(lower.axes, [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-12)

    def test_forward_kinematics_by_hand(self, tmp_path):
        (tmp_path / "chain.asf").write_text(CHAIN)
        clip = tmp_path / "chain.amc"
        clip.write_text(
            "1\nroot 1 2 3 0 0 0\nupper 0 0 90\nlower 0\n2\nroot 0 0 0 0 90 0\nupper 90 90 0\nlower 90\n"
        )
        skeleton = read_asf(tmp_path / "chain.asf")
        channels = read_amc(clip, skeleton)
        np.testing.assert_allclose(channels["root"][0, :3], np.array([1, 2, 3]) * METRES)
        turned = world_turns(skeleton, channels)
        up = np.array([0.0, 1.0, 0.0])
        # Frame 1: the upper bone lies along -x, and the lower one with it.
        np.testing.assert_allclose(turned["upper"][0] @ up, [-1, 0, 0], atol=1e-12)
        np.testing.assert_allclose(turned["lower"][0] @ up, [-1, 0, 0], atol=1e-12)
        # Frame 2: x first: up -> +z; then y: z -> +x; the root's own quarter turn about y: x -> -z.
        np.testing.assert_allclose(turned["upper"][1] @ up, [0, 0, -1], atol=1e-12)
        # The lower bone's x axis is the world's y axis: it twists about itself and points on.
        np.testing.assert_allclose(turned["lower"][1] @ up, [0, 0, -1], atol=1e-12)
        local = turned["upper"][1].T @ turned["lower"][1]
        np.testing.assert_allclose(local, Rotation.from_euler("y", 90, degrees=True).as_matrix(), atol=1e-12)

    def test_radians_and_degrees_agree(self, tmp_path):
        frames = [amc_frame(1, lfemur=(-40, 10, 5), root=(0, 17, 0, 10, 20, 30))]
        degrees = read_motion(write_clip(tmp_path, frames), MotionFileOptions())
        turned = [
            amc_frame(1, lfemur=tuple(np.radians([-40, 10, 5])), root=(0, 17, 0, *np.radians([10, 20, 30])))
        ]
        clip = write_clip(tmp_path, turned, name="08_01", skeleton=cmu_like(radians=True))
        clip.write_text(clip.read_text().replace(":DEGREES", ":RADIANS"))
        np.testing.assert_allclose(read_motion(clip, MotionFileOptions()).poses, degrees.poses, atol=1e-12)


GOOD = [amc_frame(1), amc_frame(2)]
REFUSED_CLIPS = [
    (lambda text: "", "0 frames"),
    (lambda text: text.replace("head 0.0", "head zero", 1), "line 6: 1 finite numbers"),
    (lambda text: text.replace("head 0.0", "head nan", 1), "line 6: 1 finite numbers"),
    (lambda text: text.replace("head 0.0", "head 0.0 1.0", 1), "line 6: 1 finite numbers"),
    (lambda text: text.replace("head", "tail", 1), "line 6: unknown bone 'tail'"),
    (lambda text: text.replace("head 0.0\n", "", 1), "frame 1 ends without bone 'head'"),
    (lambda text: text[: len(text) * 3 // 4].rsplit("\n", 1)[0], "cut off"),
    (lambda text: "head 0.0\n" + text, "line 1: 'head' comes before the first frame"),
]
REFUSED_SKELETONS = [
    (lambda text: " ", ":root is missing"),
    (lambda text: "solid cube\n" + text, "line 1.*is it an .asf file"),
    (lambda text: text.replace(":hierarchy", ":anarchy"), ":hierarchy is missing"),
    (lambda text: text.replace("order TX TY TZ RX RY RZ", "order"), "no 'order'"),
    (lambda text: text.replace("name lfemur", "name left_thigh"), "'lfemur' has no entry"),
    (lambda text: text.replace("femur", "thigh"), "no bone 'lfemur'"),
    (lambda text: text.replace("length 7.0", "length long", 1), "line .*: 1 finite numbers"),
    (lambda text: text.replace("length 7.0", "length", 1), "1 finite numbers should be in 'length'"),
    (lambda text: text.replace("direction 0 1 0", "direction 0 0 0", 1), "direction cannot be zero"),
    (lambda text: text.replace("dof rx ry rz", "dof rx ry rz l", 1), "channel 'l'"),
    (lambda text: text.replace("0.0 XYZ", "0.0 XXZ", 1), "permutation"),
    (lambda text: text.replace("length 0.45", "length 0", 1), "positive"),
    (lambda text: text.replace("length 7", "length -7"), "left leg has no length"),
    # Two names of one bone made it its own parent's parent, and reading never ended.
    (lambda text: text.replace("end\nbegin\n name ltibia", " name ltibia"), "is a 'begin' missing"),
    (lambda text: text.replace("name ltibia", "name lfemur"), "bone: 'lfemur'"),
]


@pytest.mark.parametrize(
    ("ending", "change", "message"),
    [(".amc", *case) for case in REFUSED_CLIPS] + [(".asf", *case) for case in REFUSED_SKELETONS],
)
def test_a_broken_file_is_refused_in_one_line(tmp_path, ending, change, message):
    clip = write_clip(tmp_path, GOOD)
    broken = clip if ending == ".amc" else tmp_path / "07.asf"
    broken.write_text(change(broken.read_text()))
    with pytest.raises(MotionError, match=message) as caught:
        load_motions(clip)
    assert "\n" not in str(caught.value) and broken.name in str(caught.value)


def test_missing_skeleton_file_folder_and_kind(tmp_path):
    clip = write_clip(tmp_path, GOOD)
    (tmp_path / "07.asf").unlink()
    notes, empty = tmp_path / "notes.txt", tmp_path / "empty"
    notes.write_text("hello")
    empty.mkdir()
    for path, message in (
        (clip, "skeleton 07.asf is missing"),
        (tmp_path / "none.amc", "no such file"),
        (notes, "unknown kind"),
        (empty, "holds no"),
    ):
        with pytest.raises(MotionError, match=message) as caught:
            load_motions(path)
        assert "\n" not in str(caught.value) and path.name in str(caught.value)


class TestRetargeting:
    def limb(self, motion, joint, frame=0):
        positions = joint_positions(motion.poses, motion.translations)[frame]
        arm = positions[JOINT[LIMBS[joint]]] - positions[JOINT[joint]]
        return arm / np.linalg.norm(arm)

    def test_the_zero_pose_has_the_files_limb_directions(self, tmp_path):
        motion = read_asf_amc(write_clip(tmp_path, [amc_frame(1)]), MotionFileOptions())
        s, c = np.sin(np.radians(20)), np.cos(np.radians(20))
        expected = {
            "left_hip": (s, -c, 0),
            "right_knee": (-s, -c, 0),
            "left_shoulder": (1, 0, 0),
            "right_elbow": (-1, 0, 0),
        }
        for joint, direction in expected.items():
            np.testing.assert_allclose(self.limb(motion, joint), direction, atol=1e-9)
        # No turn where the skeletons agree; hips not twisted: the knees' hinge still lies across.
        np.testing.assert_allclose(motion.poses[0, JOINT["spine2"]], 0.0, atol=1e-12)
        hinge = global_rotations(motion.poses)[0, JOINT["left_knee"]] @ [1, 0, 0]
        # Within the 3 degrees by which our own rest shank is splayed, and no more about the leg's length.
        np.testing.assert_allclose(hinge, [c, s, 0], atol=0.06)
        assert abs(hinge[2]) < 1e-9

    def test_flexions_bend_the_right_way(self, tmp_path):
        # The femur's axes are splayed by 20 degrees; rz brings the leg upright, then rx swings it forward.
        frames = [
            amc_frame(1, lfemur=(-90, 0, 0), rtibia=(60,), lradius=(90,)),
            amc_frame(2, lfemur=(0, 0, -20), rradius=(90,), lhumerus=(0, 0, 70)),
        ]
        motion = read_asf_amc(write_clip(tmp_path, frames), MotionFileOptions())
        assert self.limb(motion, "left_hip")[2] == pytest.approx(1.0, abs=0.01)
        assert self.limb(motion, "right_knee")[2] < -0.8  # the shin goes back
        assert self.limb(motion, "left_elbow")[2] > 0.8  # the forearm comes forward
        assert self.limb(motion, "right_elbow", 1)[2] > 0.8
        np.testing.assert_allclose(self.limb(motion, "left_hip", 1), [0, -1, 0], atol=1e-9)
        # An elbow is a hinge about one axis of ours: the mesh's own.
        elbow = motion.poses[0, JOINT["left_elbow"]]
        assert elbow[1] < 0 and abs(elbow[1]) > 5 * max(abs(elbow[0]), abs(elbow[2]))

    def test_root_path_is_scaled_to_our_legs(self, tmp_path):
        frames = [amc_frame(1), amc_frame(2, root=(0, 0, 10, 0, 0, 0))]
        motion = read_asf_amc(write_clip(tmp_path, frames), MotionFileOptions())
        step = motion.translations[1] - motion.translations[0]
        np.testing.assert_allclose(step, [0, 0, 10 * LEG_LENGTH / 14.4], atol=1e-12)
        assert motion.fps == CMU_RATE


@pytest.mark.skipif(not CLIPS.is_dir(), reason="no CMU clips here; set CMU_MOTIONS to a folder of them")
class TestRecordedClips:
    @pytest.mark.parametrize("name", ["02_01", "02_03"])
    def test_limbs_of_our_body_point_where_the_recorded_ones_do(self, name):
        # Oracle: plain forward kinematics of the file with extrinsic Euler angles, bone by bone.
        if not (CLIPS / f"{name}.amc").is_file():
            pytest.skip(f"clip {name} is not in the folder")
        skeleton = read_asf(CLIPS / f"{name[:2]}.asf")
        channels = read_amc(CLIPS / f"{name}.amc", skeleton)
        turned = {}
        for title, bone in skeleton.bones.items():
            order = [c for c in bone.channels if c.startswith("r")]
            columns = [bone.channels.index(c) for c in order]
            turn = Rotation.identity(len(channels["root"]))
            if order:
                turn = Rotation.from_euler("".join(c[1] for c in order), channels[title][:, columns])
            axes = Rotation.from_matrix(bone.axes)
            turned[title] = (
                (turned[bone.parent] if bone.parent else Rotation.identity()) * axes * turn * axes.inv()
            )
        motion = read_motion(CLIPS / f"{name}.amc", MotionFileOptions(repair=True))
        positions = joint_positions(motion.poses, motion.translations, Body.load().joints())
        for near, far in LIMBS.items():
            limb = positions[:, JOINT[far]] - positions[:, JOINT[near]]
            limb /= np.linalg.norm(limb, axis=1, keepdims=True)
            recorded = turned[JOINT_BONES[near]].apply(skeleton.bones[JOINT_BONES[near]].direction)
            error = np.degrees(np.arccos(np.clip((limb * recorded).sum(axis=1), -1, 1)))
            assert error.mean() < 2.0, near
