"""Convert an Acclaim skeleton's motion to our joints: same limb directions, same hinge axes.

Our joint j is driven by bone b: G_j = G_b A_j, where A_j turns our rest pose's limb into the bone's zero
pose. A limb's far end then points along G_b A_j t_j = G_b d_b, the recorded direction.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from snug.body.skeleton import (
    JOINT,
    JOINT_NAMES,
    LEG_LENGTH,
    PARENTS,
    REST_JOINTS,
    axis_angles,
    rotation_matrices,
)
from snug.motion.acclaim import Skeleton, read_amc, read_asf, turns
from snug.motion.motion import MotionError
from snug.motion.options import MotionFileOptions
from snug.motion.raw_motion import RawMotion, frame_rate

CMU_RATE = 120.0  # [1/s] the .amc format has no field for it
# Our joint: the CMU bone whose turn it takes. Thumbs and the half bones inside hips and neck are not needed.
JOINT_BONES = {
    "pelvis": "root", "spine1": "lowerback", "spine2": "upperback", "spine3": "thorax",
    "neck": "upperneck", "head": "head",
    **{f"{side}_{joint}": side[0] + bone for side in ("left", "right") for joint, bone in (
        ("hip", "femur"), ("knee", "tibia"), ("ankle", "foot"), ("foot", "toes"), ("collar", "clavicle"),
        ("shoulder", "humerus"), ("elbow", "radius"), ("wrist", "hand"), ("hand", "fingers"))},
}  # fmt: skip
# Joints whose limb points to the next joint; the hinge axis fixes the twist about the limb.
LIMBS = {
    f"{side}_{near}": f"{side}_{far}"
    for side in ("left", "right")
    for near, far in (("hip", "knee"), ("knee", "ankle"), ("shoulder", "elbow"), ("elbow", "wrist"))
}
# Limb joint: the hinge bone's joint, and the axis about which it bends in our rest pose.
_HINGES = {
    "left_hip": ("left_knee", (1, 0, 0)), "left_knee": ("left_knee", (1, 0, 0)),
    "right_hip": ("right_knee", (1, 0, 0)), "right_knee": ("right_knee", (1, 0, 0)),
    "left_shoulder": ("left_elbow", (0, -1, 0)), "left_elbow": ("left_elbow", (0, -1, 0)),
    "right_shoulder": ("right_elbow", (0, 1, 0)), "right_elbow": ("right_elbow", (0, 1, 0)),
}  # fmt: skip


def read_asf_amc(path: Path, options: MotionFileOptions) -> RawMotion:
    """Read an .amc with the .asf of its subject (01_05.amc: 01.asf, or 01_05.asf). Raises MotionError."""
    stem = path.stem
    names = (stem, stem.split("_")[0])
    candidates = [path.with_name(name + end) for name in names for end in (".asf", ".ASF")]
    skeleton_file = next((file for file in candidates if file.is_file()), None)
    if skeleton_file is None:
        raise MotionError(f"{path}: its skeleton {stem.split('_')[0]}.asf is missing; put it beside the clip")
    skeleton = read_asf(skeleton_file)
    poses, translations = retarget(skeleton, read_amc(path, skeleton), skeleton_file)
    return RawMotion(
        path=path, poses=poses, translations=translations, fps=frame_rate(path, None, options, CMU_RATE),
        source=f"{path.name} with {skeleton_file.name}",
    )  # fmt: skip


def retarget(
    skeleton: Skeleton, channels: dict[str, np.ndarray], skeleton_file: Path
) -> tuple[np.ndarray, np.ndarray]:
    """Return poses (T, 24, 3) [rad] and translations (T, 3) [m] in the axes of the file.

    Translations are scaled by the ratio of leg lengths, so that steps and legs agree.

    Raises:
        MotionError: the skeleton lacks a bone that drives a joint.
    """
    missing = [bone for bone in JOINT_BONES.values() if bone not in skeleton.bones]
    if missing:
        raise MotionError(
            f"{skeleton_file}: no bone '{missing[0]}'; only skeletons with CMU's bone names are read"
        )
    leg = skeleton.bones["lfemur"].length + skeleton.bones["ltibia"].length
    if leg <= 0.0:
        raise MotionError(f"{skeleton_file}: the left leg has no length; fetch the skeleton again")
    frames = len(channels["root"])
    turned = world_turns(
        skeleton, {name: local_turns(skeleton, channels, name, frames) for name in skeleton.bones}
    )
    rotations = np.empty((frames, 24, 3, 3))
    for joint, name in enumerate(JOINT_NAMES):
        turn = alignment(skeleton, name)
        if not np.isfinite(turn).all():
            bone = JOINT_BONES[name]
            raise MotionError(f"{skeleton_file}: bone '{bone}' lies along its own hinge; fetch it again")
        rotations[:, joint] = turned[JOINT_BONES[name]] @ turn
    return relative_poses(rotations), LEG_LENGTH / leg * root_positions(skeleton, channels)


def relative_poses(rotations: np.ndarray) -> np.ndarray:
    """Return poses relative to the parents (T, 24, 3) [rad] of world rotations (T, 24, 3, 3)."""
    relative = rotations.copy()
    for joint, parent in enumerate(PARENTS):
        if parent >= 0:
            relative[:, joint] = np.swapaxes(rotations[:, parent], -1, -2) @ rotations[:, joint]
    return axis_angles(relative)


def local_turns(skeleton: Skeleton, channels: dict[str, np.ndarray], name: str, frames: int) -> np.ndarray:
    """Return C M C^-1 of one bone, (T, 3, 3): its rotation relative to its parent, from the zero pose."""
    bone = skeleton.bones[name]
    if not bone.channels:
        return np.broadcast_to(np.eye(3), (frames, 3, 3)).copy()
    return bone.axes @ turns(bone.channels, channels[name]) @ bone.axes.T


def world_turns(skeleton: Skeleton, local: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """G of every bone, (T, 3, 3), from the local turns."""
    turned: dict[str, np.ndarray] = {}
    for name, bone in skeleton.bones.items():
        turned[name] = turned[bone.parent] @ local[name] if bone.parent else local[name]
    return turned


def root_positions(skeleton: Skeleton, channels: dict[str, np.ndarray]) -> np.ndarray:
    """Return the path of the root (T, 3) [m]."""
    order = skeleton.bones["root"].channels
    return skeleton.position + np.stack(
        [channels["root"][:, order.index(axis)] if axis in order else np.zeros(len(channels["root"]))
         for axis in ("tx", "ty", "tz")], axis=1,
    )  # fmt: skip


def alignment(skeleton: Skeleton, joint: str) -> np.ndarray:
    """Return A (3, 3) of one joint: our rest pose's limb and hinge axis onto the bone's zero pose.

    Feet turn about the vertical only, since both skeletons stand flat in their rest poses. Spine, head and
    collars have no limb to align: upright is upright.
    """
    side = joint.split("_")[0]
    if joint.endswith(("wrist", "hand")):
        return alignment(skeleton, f"{side}_elbow")
    if joint.endswith(("ankle", "foot")):
        return foot_alignment(side, skeleton.bones[JOINT_BONES[f"{side}_ankle"]].direction)
    if joint not in LIMBS:
        return np.eye(3)
    limb = REST_JOINTS[JOINT[LIMBS[joint]]] - REST_JOINTS[JOINT[joint]]
    hinge_joint, hinge = _HINGES[joint]
    hinge_axis = skeleton.bones[JOINT_BONES[hinge_joint]].axes[:, 0]
    direction = skeleton.bones[JOINT_BONES[joint]].direction
    return _frame(direction, hinge_axis) @ _frame(limb, np.array(hinge, dtype=float)).T


def foot_alignment(side: str, theirs: np.ndarray) -> np.ndarray:
    """Return the turn (3, 3) about the vertical of our resting foot to one along theirs (3,), y up."""
    ours = REST_JOINTS[JOINT[f"{side}_foot"]] - REST_JOINTS[JOINT[f"{side}_ankle"]]
    yaw = np.arctan2(theirs[0], theirs[2]) - np.arctan2(ours[0], ours[2])
    return rotation_matrices(np.array([0.0, yaw, 0.0]))


def _frame(along: np.ndarray, hinge: np.ndarray) -> np.ndarray:
    """Return orthonormal columns: along, the part of hinge across it, and their cross product."""
    first = along / np.linalg.norm(along)
    second = hinge - first * (first @ hinge)
    second /= np.linalg.norm(second)
    return np.stack((first, second, np.cross(first, second)), axis=1)
