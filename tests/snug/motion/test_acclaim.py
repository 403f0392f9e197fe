"""ASF and AMC files: what is read of them, put on the body, recorded clips, and each broken file refused."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from snug.body.skeleton import JOINT, LEG_LENGTH, global_rotations, joint_positions
from snug.file_options import MotionFileOptions
from snug.motion.acclaim import CMU_RATE, JOINT_BONES, read_amc, read_asf, read_asf_amc
from snug.motion.retarget import LIMBS
from tests.snug.motion.motion_forms import amc_frame, read, refuse, write_clip

REFUSED = [
    (".amc", lambda text: text.replace("head 0.0", "head nan", 1), "line 6: 'nan' should be 1 finite"),
    (".amc", lambda text: text.replace("head", "tail", 1), "line 6: 'tail' is no bone"),
    (".amc", lambda text: text.replace("\n2\n", "\n3\n"), "frame 3 follows frame 1"),
    (".amc", lambda text: text[: len(text) * 3 // 4].rsplit("\n", 1)[0], "frame 2 is cut off"),
    (".asf", lambda text: text.replace("angle deg", "angle rad"), "only angles in degrees"),
    (".asf", lambda text: text.replace("femur", "thigh"), "no bone 'lfemur'"),
    (".asf", lambda text: text.replace("0.0 XYZ", "0.0 XZY", 1), "order XYZ"),
    (".asf", lambda text: text.replace("length 7", "length -7"), "left leg of 07.asf has no length"),
]


@pytest.mark.parametrize(("ending", "change", "words"), REFUSED)
def test_a_broken_file_is_refused(tmp_path, ending, change, words):
    clip = write_clip(tmp_path, [amc_frame(1), amc_frame(2)])
    broken = clip if ending == ".amc" else tmp_path / "07.asf"
    broken.write_text(change(broken.read_text()))
    refuse(clip, words, named=broken)


def test_a_skeleton_is_the_one_whose_name_begins_the_clips(tmp_path):
    clip = write_clip(tmp_path, [amc_frame(1)])
    skeleton = (tmp_path / "07.asf").rename(tmp_path / "HDM_bd.ASF")
    for other in ("HDM", "HDM_bd_0", "HDM_bd_01_x", "._HDM_bd_01"):
        (tmp_path / f"{other}.asf").write_text("no skeleton")
    for name in ("HDM_bd_01.amc", "HDM_bd_01-02_03_120.amc"):
        clip = clip.rename(tmp_path / name)
        assert read_asf_amc(clip, MotionFileOptions()).source == f"{name} with {skeleton.name}"


def test_a_clip_without_its_skeleton_is_refused(tmp_path):
    clip = write_clip(tmp_path, [amc_frame(1)])
    (tmp_path / "07.asf").unlink()
    refuse(clip, "skeleton 07.asf is missing")


def test_hips_are_not_twisted_in_the_zero_pose(tmp_path):
    """The knees' hinge lies across, tilted with the leg, and no joint turns where the skeletons agree."""
    motion = read_asf_amc(write_clip(tmp_path, [amc_frame(1)]), MotionFileOptions())
    np.testing.assert_allclose(motion.poses[0, JOINT["spine2"]], 0.0, atol=1e-12)
    hinge = global_rotations(motion.poses)[0, JOINT["left_knee"]] @ [1, 0, 0]
    # Within the 3 degrees by which our own rest shank is splayed, and no more about the leg's length.
    np.testing.assert_allclose(hinge, [np.cos(np.radians(20)), np.sin(np.radians(20)), 0], atol=0.06)
    assert abs(hinge[2]) < 1e-9


def test_root_path_is_scaled_to_our_legs(tmp_path):
    frames = [amc_frame(1), amc_frame(2, root=(0, 0, 10, 0, 0, 0))]
    motion = read_asf_amc(write_clip(tmp_path, frames), MotionFileOptions())
    step = motion.translations[1] - motion.translations[0]
    np.testing.assert_allclose(step, [0, 0, 10 * LEG_LENGTH / 14.4], atol=1e-12)
    assert motion.fps == CMU_RATE


def test_limbs_of_our_body_point_where_the_recorded_ones_do(tmp_path):
    """Oracle: plain forward kinematics of the file with extrinsic Euler angles, bone by bone."""
    time = np.arange(40) / 40
    frames = [
        amc_frame(
            k + 1, root=(0.1 * t, 17, t, 3, 40 * t, 2), lowerback=(5 * t, 3, 2), lclavicle=(3, 9 * t),
            lfemur=(-40 * t, 10 * t, 5), ltibia=(60 * t,), rfemur=(20 * t, -5, 3), rtibia=(10,),
            lhumerus=(30 * t, 20, -50 * t), lradius=(70 * t,), rhumerus=(10, 40 * t, 20), rradius=(30,),
        )
        for k, t in enumerate(time)
    ]  # fmt: skip
    clip = write_clip(tmp_path, frames)
    bones, metres = read_asf(tmp_path / "07.asf")
    channels = read_amc(clip, bones, metres)
    turned = {}
    for title, bone in bones.items():
        order = [c for c in bone.channels if c.startswith("r")]
        turn = Rotation.identity(len(time))
        if order:
            columns = [bone.channels.index(c) for c in order]
            turn = Rotation.from_euler("".join(c[1] for c in order), channels[title][:, columns])
        axes = Rotation.from_matrix(bone.axes)
        above = turned[bone.parent] if bone.parent else Rotation.identity()
        turned[title] = above * axes * turn * axes.inv()
    motion = read(clip)
    positions = joint_positions(motion.poses, motion.translations)
    for near, far in LIMBS.items():
        limb = positions[:, JOINT[far]] - positions[:, JOINT[near]]
        limb /= np.linalg.norm(limb, axis=1, keepdims=True)
        recorded = turned[JOINT_BONES[near]].apply(bones[JOINT_BONES[near]].direction)
        np.testing.assert_allclose(limb, recorded, atol=1e-9, err_msg=near)
