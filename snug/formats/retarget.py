"""From an Acclaim skeleton's motion to ours: same limb directions, same hinge axes, glitches repaired.

Our joint j is driven by bone b: G_j = G_b A_j, where A_j turns our rest pose's limb into the bone's zero
pose. A limb's far end then points along G_b A_j t_j = G_b d_b, the recorded direction.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from snug.formats.asf_amc import Skeleton, read_amc, read_asf, turns
from snug.motion import Motion, MotionError
from snug.skeleton import JOINT, JOINT_NAMES, LEG_LENGTH, PARENTS, REST_JOINTS, axis_angles, rotation_matrices

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
# As the authors of SNUG did: recorded hands are noisy and drive nothing.
HAND_DAMPING = 0.1
# 30 degrees in 1/120 s: twice the fastest joint of a kick or a sprint. A swapped or lost marker does it.
GLITCH = np.deg2rad(30.0) * 120.0  # [rad/s]
GLITCH_SECONDS = 0.25  # two jumps closer than this bound one glitch
GLITCH_MARGIN = 2  # frames on either side of a jump that are not trusted


def read_asf_amc(path: Path, *, fps: float = CMU_RATE) -> Motion:
    """One .amc with the .asf of its subject (01_05.amc: 01.asf, or 01_05.asf) -> Motion, y up, in metres.

    Glitches are repaired and named in the motion's source. Raises MotionError.
    """
    stem = path.stem
    names = (stem, stem.split("_")[0])
    candidates = [path.with_name(name + end) for name in names for end in (".asf", ".ASF")]
    skeleton_file = next((file for file in candidates if file.is_file()), None)
    if skeleton_file is None:
        raise MotionError(f"{path}: its skeleton {stem.split('_')[0]}.asf is missing; put it beside the clip")
    skeleton = read_asf(skeleton_file)
    channels = read_amc(path, skeleton)
    poses, translations, repairs = retarget(skeleton, channels, skeleton_file, fps)
    source = "; ".join([f"{path.name} with {skeleton_file.name}", *repairs])
    return Motion(stem, poses, translations, fps, "recorded", source)


def retarget(
    skeleton: Skeleton, channels: dict[str, np.ndarray], skeleton_file: Path, fps: float
) -> tuple[np.ndarray, np.ndarray, list[str]]:
    """-> poses (T, 24, 3) [rad], translations (T, 3) [m], a line for every repaired glitch.

    Translations are scaled by the ratio of leg lengths, so that steps and legs agree.
    Raises MotionError when the skeleton lacks a bone that drives a joint.
    """
    missing = [bone for bone in JOINT_BONES.values() if bone not in skeleton.bones]
    if missing:
        raise MotionError(
            f"{skeleton_file}: no bone '{missing[0]}'; only skeletons with CMU's bone names are read"
        )
    frames = len(channels["root"])
    local = {name: local_turns(skeleton, channels, name, frames) for name in skeleton.bones}
    repairs = []
    for name in _driving(skeleton):
        spans = [f"{first}-{last}" for first, last in repair(local[name], fps)]
        if spans:
            more = f" and {len(spans) - 5} more" if len(spans) > 5 else ""
            repairs.append(f"repaired jumps of {name} in frames {', '.join(spans[:5])}{more}")
    turned = world_turns(skeleton, local)
    rotations = np.empty((frames, 24, 3, 3))
    for joint, name in enumerate(JOINT_NAMES):
        rotations[:, joint] = turned[JOINT_BONES[name]] @ alignment(skeleton, name)
    relative = rotations.copy()
    for joint, parent in enumerate(PARENTS):
        if parent >= 0:
            relative[:, joint] = np.swapaxes(rotations[:, parent], -1, -2) @ rotations[:, joint]
    poses = axis_angles(relative)
    for name in ("left_wrist", "right_wrist", "left_hand", "right_hand"):
        poses[:, JOINT[name]] *= HAND_DAMPING
    leg = skeleton.bones["lfemur"].length + skeleton.bones["ltibia"].length
    if leg <= 0.0:
        raise MotionError(f"{skeleton_file}: the left leg has no length; fetch the skeleton again")
    return poses, LEG_LENGTH / leg * root_positions(skeleton, channels), repairs


def _driving(skeleton: Skeleton) -> list[str]:
    """The bones that drive a joint of ours, with the half bones above them, parents first."""
    wanted = set()
    for name in JOINT_BONES.values():
        while name:
            wanted.add(name)
            name = skeleton.bones[name].parent
    return [name for name in skeleton.bones if name in wanted]


def local_turns(skeleton: Skeleton, channels: dict[str, np.ndarray], name: str, frames: int) -> np.ndarray:
    """C M C^-1 of one bone, (T, 3, 3): its turn relative to its parent, seen from the zero pose."""
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
    """Where the root is, (T, 3) [m]."""
    order = skeleton.bones["root"].channels
    return skeleton.position + np.stack(
        [channels["root"][:, order.index(axis)] if axis in order else np.zeros(len(channels["root"]))
         for axis in ("tx", "ty", "tz")], axis=1,
    )  # fmt: skip


def alignment(skeleton: Skeleton, joint: str) -> np.ndarray:
    """A of one joint: our rest pose's limb and hinge axis onto the bone's zero pose. -> (3, 3).

    Feet turn about the vertical only, since both skeletons stand flat in their rest poses. Spine, head and
    collars have no limb to align: upright is upright.
    """
    side = joint.split("_")[0]
    if joint.endswith(("wrist", "hand")):
        return alignment(skeleton, f"{side}_elbow")
    if joint.endswith(("ankle", "foot")):
        ours = REST_JOINTS[JOINT[f"{side}_foot"]] - REST_JOINTS[JOINT[f"{side}_ankle"]]
        theirs = skeleton.bones[JOINT_BONES[f"{side}_ankle"]].direction
        yaw = np.arctan2(theirs[0], theirs[2]) - np.arctan2(ours[0], ours[2])
        return rotation_matrices(np.array([0.0, yaw, 0.0]))
    if joint not in LIMBS:
        return np.eye(3)
    limb = REST_JOINTS[JOINT[LIMBS[joint]]] - REST_JOINTS[JOINT[joint]]
    hinge_joint, hinge = _HINGES[joint]
    hinge_axis = skeleton.bones[JOINT_BONES[hinge_joint]].axes[:, 0]
    direction = skeleton.bones[JOINT_BONES[joint]].direction
    return _frame(direction, hinge_axis) @ _frame(limb, np.array(hinge, dtype=float)).T


def _frame(along: np.ndarray, hinge: np.ndarray) -> np.ndarray:
    """Orthonormal columns: along, the part of hinge across it, and their cross product."""
    first = along / np.linalg.norm(along)
    second = hinge - first * (first @ hinge)
    second /= np.linalg.norm(second)
    return np.stack((first, second, np.cross(first, second)), axis=1)


def repair(turned: np.ndarray, fps: float) -> list[tuple[int, int]]:
    """Replace glitches of one bone, in place, by the shortest arc between the good frames around them.

    turned: (T, 3, 3). A glitch is a jump faster than GLITCH, or all between two such jumps in quick
    succession. -> its (first, last) frames, counted from 1 as in the file.
    """
    steps = np.linalg.norm(axis_angles(np.swapaxes(turned[:-1], -1, -2) @ turned[1:]), axis=-1)
    jumps = np.flatnonzero(steps * fps > GLITCH)
    runs: list[list[int]] = []
    for jump in jumps:
        if runs and jump - runs[-1][1] <= GLITCH_SECONDS * fps:
            runs[-1][1] = int(jump)
        else:
            runs.append([int(jump), int(jump)])
    spans = []
    for first_jump, last_jump in runs:
        # Jump k is between frames k and k + 1; `before` and `after` are the frames still trusted.
        before, after = first_jump - GLITCH_MARGIN, last_jump + 1 + GLITCH_MARGIN
        if before < 0 or after >= len(turned):
            _hold(turned, before, after)
        else:
            arc = axis_angles(turned[before].T @ turned[after])
            share = np.linspace(0.0, 1.0, after - before + 1)[:, None]
            turned[before : after + 1] = turned[before] @ rotation_matrices(share * arc)
        spans.append((max(before, 0) + 1, min(after, len(turned) - 1) + 1))
    return spans


def _hold(turned: np.ndarray, before: int, after: int) -> None:
    """A glitch at an end of the clip: hold the nearest trusted frame, if there is one."""
    if before >= 0:
        turned[before:] = turned[before]
    elif after < len(turned):
        turned[:after] = turned[after]
