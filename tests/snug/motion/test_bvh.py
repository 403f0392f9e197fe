"""BVH clips: names of joints, zero poses, and each broken file refused by name."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from snug.body.skeleton import JOINT, JOINT_NAMES, PARENTS, REST_JOINTS, joint_positions
from snug.motion.library import make_motion
from snug.motion.retarget import NEEDED, match_joints
from tests.snug.motion.motion_forms import bvh, read, refuse

WALK = make_motion("walk").cut(20, 40)


def written(path, text=None, **options):
    text = text if text is not None else bvh(WALK.poses, WALK.translations, 30.0, **options)
    path.write_text(text, encoding="utf-8-sig")  # with the mark that some programs begin a file with
    return path


# Names with the indices of their parents. CMU's clips as BVH: half bones inside hips and neck.
CMU = """Hips -1, LHipJoint 0, LeftUpLeg 1, LeftLeg 2, LeftFoot 3, LeftToeBase 4, RHipJoint 0, RightUpLeg 6,
RightLeg 7, RightFoot 8, LowerBack 0, Spine 10, Spine1 11, Neck 12, Neck1 13, Head 14, LeftShoulder 12,
LeftArm 16, LeftForeArm 17, LeftHand 18, RightShoulder 12, RightArm 20, RightForeArm 21, RightHand 22"""
UPPER = """Hips -1, Spine 0, Chest 1, UpperChest 2, Neck 3, Head 4, LeftShoulder 3, LeftUpperArm 6,
LeftLowerArm 7, LeftHand 8, RightShoulder 3, RightUpperArm 10, RightLowerArm 11, RightHand 12, LeftHip 0,
LeftKnee 14, LeftFoot 15, LeftToe 16, RightHip 0, RightKnee 18, RightFoot 19, RightToe 20"""


def known(skeleton):
    names, parents = zip(*(joint.strip().rsplit(" ", 1) for joint in skeleton.split(",")), strict=True)
    indices = match_joints(names, [int(parent) for parent in parents])
    return {ours: names[index] for ours, index in indices.items()}


def test_common_skeletons_are_known_without_a_map():
    """Mixamo's is one of the forms of test_motion_files.py."""
    mapping = known(CMU)
    assert [mapping[f"spine{k}"] for k in (1, 2, 3)] == ["LowerBack", "Spine", "Spine1"]
    assert (mapping["pelvis"], mapping["neck"], mapping["head"]) == ("Hips", "Neck1", "Head")
    assert (mapping["left_collar"], mapping["left_shoulder"]) == ("LeftShoulder", "LeftArm")
    assert "right_foot" not in mapping
    mapping = known(UPPER)  # arms after bones, legs after joints
    assert (mapping["left_collar"], mapping["left_shoulder"]) == ("LeftShoulder", "LeftUpperArm")
    assert (mapping["right_ankle"], mapping["right_foot"]) == ("RightFoot", "RightToe")
    assert [mapping[f"spine{k}"] for k in (1, 2, 3)] == ["Spine", "Chest", "UpperChest"]


@pytest.mark.parametrize(
    ("names", "sides"),
    [
        ("pelvis, thigh_{0}, calf_{0}, foot_{0}, upperarm_{0}, lowerarm_{0}, hand_{0}, head", "lr"),
        ("Bip01 Pelvis, Bip01 {0} Thigh, Bip01 {0} Calf, Bip01 {0} Foot, Bip01 {0} UpperArm, "
         "Bip01 {0} Forearm, Bip01 {0} Hand, Bip01 Head", "LR"),
        ("hip, {0}Thigh, {0}Shin, {0}Foot, {0}Shldr, {0}ForeArm, {0}Hand, head", "lr"),
    ],
    ids=["Unreal", "3ds Max", "Daz"],
)  # fmt: skip
def test_skeletons_of_other_programs_are_known(names, sides):
    root, *limbs, head = names.split(", ")
    left, right = ([limb.format(side) for limb in limbs] for side in sides)
    parents = [0, 1, 2, 0, 4, 5, 0, 7, 8, 0, 10, 11]
    joints = [*left, *right]
    mapping = known(
        ", ".join([f"{root} -1", *(f"{j} {p}" for j, p in zip(joints, parents)), f"{head} 0"])
    )
    for side, theirs in (("left", left), ("right", right)):
        assert [mapping[f"{side}_{joint}"] for joint in NEEDED] == theirs
    assert (mapping["pelvis"], mapping["head"]) == (root, head)


def test_limbs_of_another_skeleton_point_where_its_own_do(tmp_path):
    # Arms down by 40 degrees, legs astride and longer, in another heading and z up, and no turn at all.
    rest = REST_JOINTS.copy()
    for side, sign in (("left", 1.0), ("right", -1.0)):
        shoulder, hip = JOINT[f"{side}_shoulder"], JOINT[f"{side}_hip"]
        for base, limb, turn in (
            (shoulder, ("elbow", "wrist", "hand"), Rotation.from_euler("z", -40 * sign, degrees=True)),
            (hip, ("knee", "ankle", "foot"), Rotation.from_euler("z", 20 * sign, degrees=True)),
        ):
            joints = [JOINT[f"{side}_{name}"] for name in limb]
            rest[joints] = rest[base] + 1.3 * turn.apply(rest[joints] - rest[base])
    zero, world = np.zeros((2, 24, 3)), Rotation.from_euler("zx", [0, 90], degrees=True)
    heading = Rotation.from_euler("z", 60, degrees=True) * world
    text = bvh(zero, np.zeros((2, 3)), 60.0, rest=heading.apply(rest))
    motion = read(written(tmp_path / "a.bvh", text))
    back = Rotation.from_matrix(np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])) * heading
    joints = joint_positions(motion.poses, motion.translations)[0]
    limbs = ("left_shoulder left_elbow", "right_elbow right_wrist", "left_hip left_knee")
    for near, far in map(str.split, limbs):
        ours, theirs = (x[JOINT[far]] - x[JOINT[near]] for x in (joints, back.apply(rest)))
        np.testing.assert_allclose(
            ours / np.linalg.norm(ours), theirs / np.linalg.norm(theirs), atol=1e-6
        )
    for name in ("spine1", "spine3", "neck", "left_collar"):
        np.testing.assert_allclose(motion.poses[:, JOINT[name]], 0.0, atol=1e-9)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda text: text.partition("MOTION")[0], "'' where 'MOTION' should be"),
        (lambda text: text.replace("Frames: 20", "Frames: 21"), "declares 21 frames and holds 20"),
        (lambda text: text.replace("Frame Time: 0.0333333", "Frame Time: 0"), "no frame rate"),
        (lambda text: text.replace("left_knee", "left_thing"), "no joint is known as 'left_knee'"),
        (lambda text: text.replace("head", "hat"), "no joint is known as 'head'"),
        (lambda text: text.rsplit(" ", 1)[0] + " nan\n", "should be 75 finite numbers"),
        (
            lambda text: text.replace("left", "?").replace("right", "left").replace("?", "right"),
            "backwards",
        ),
    ],
)
def test_a_broken_file_is_refused(tmp_path, change, words):
    path = written(tmp_path / "clip.bvh")
    path.write_text(change(path.read_text()))
    refuse(path, words)


def test_a_zero_pose_that_does_not_stand_is_refused(tmp_path):
    arms_up = REST_JOINTS.copy()
    shoulder = REST_JOINTS[JOINT["left_shoulder"]]
    for name in ("left_elbow", "left_wrist", "left_hand"):
        arms_up[JOINT[name]] = shoulder - (REST_JOINTS[JOINT[name]] - shoulder) * [1.0, 0.0, 0.0]
    turned = "no T or A pose: left_shoulder is turned by 180 degrees"
    refuse(written(tmp_path / "a.bvh", rest=arms_up), turned)
    # LAFAN1's layout: every bone along x, hips and shoulders apart along z; turns make it stand.
    along_x = np.zeros((24, 3))
    for joint, parent in enumerate(PARENTS[1:], 1):
        bone = REST_JOINTS[joint] - REST_JOINTS[parent]
        across = bone[0] if JOINT_NAMES[joint].endswith(("hip", "collar")) else 0.0
        along_x[joint] = along_x[parent] + [np.linalg.norm(bone), 0.0, across]
    standing = np.zeros((2, 24, 3))
    standing[:, [0, 1, 2], 2] = np.pi / 2, np.pi, np.pi
    text = bvh(standing, np.zeros((2, 3)), 30.0, rest=along_x)
    refuse(written(tmp_path / "a.bvh", text), "no T or A pose: the trunk is turned by 180 degrees")
    refuse(written(tmp_path / "a.bvh", rest=np.zeros((24, 3))), "legs or hips of its zero pose")
