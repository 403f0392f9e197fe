"""Convert a BVH clip to our joints: every limb points where theirs does.

As in snug.motion.acclaim_to_smpl: with W our resting axes in their zero pose and B_j = W A_j, our joint j
turns by G_j = G_b B_j, where A_j turns our resting limb into theirs by the smallest angle. Their zero pose
must be a T or A pose, since nothing else says how a limb is twisted about itself.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from snug.body.skeleton import JOINT, JOINT_NAMES, LEG_LENGTH, PARENTS, REST_JOINTS, rotation_matrices
from snug.motion.acclaim_to_smpl import LIMBS, foot_alignment, relative_poses
from snug.motion.bvh import BvhClip, read_clip
from snug.motion.joint_names import match_joints
from snug.motion.motion import MotionError
from snug.motion.options import MotionFileOptions
from snug.motion.raw_motion import RawMotion, frame_rate

# How far a limb of the zero pose may be turned from ours: legs astride, arms down.
ASTRIDE, ARMS_DOWN = np.deg2rad(60.0), np.deg2rad(95.0)


def read_bvh(path: Path, options: MotionFileOptions) -> RawMotion:
    """Read a .bvh of one body, whatever its unit of length: the path is scaled by the length of the legs.

    Raises MotionError.
    """
    clip = read_clip(path)
    names = [joint.name for joint in clip.joints]
    parents = [joint.parent for joint in clip.joints]
    matches = match_joints(path, names, parents, options.joint_map)
    places = np.zeros((len(names), 3))
    for index, joint in enumerate(clip.joints):
        places[index] = joint.offset + (places[joint.parent] if joint.parent >= 0 else 0.0)
    axes, leg = _standing(path, places, matches)
    turned, pelvis = _moved(clip, matches)
    rotations = np.empty((len(clip.frames), len(JOINT_NAMES), 3, 3))
    for ours, name in enumerate(JOINT_NAMES):
        if name in matches:
            rotations[:, ours] = turned[matches[name]] @ axes @ _alignment(path, name, places @ axes, matches)
        else:
            rotations[:, ours] = rotations[:, PARENTS[ours]]
    return RawMotion(
        path=path, poses=relative_poses(rotations), translations=LEG_LENGTH / leg * pelvis,
        fps=frame_rate(path, clip.fps, options), source=f"{path.name} ({len(matches)} of 24 joints)",
    )  # fmt: skip


def _standing(path: Path, places: np.ndarray, matches: Mapping[str, int]) -> tuple[np.ndarray, float]:
    """Return W (3, 3), our axes as columns in the zero pose, and the length of its leg; places: (J, 3).

    Up is the axis nearest to the direction from ankles to head; left leads from hip to hip. Raises
    MotionError.
    """
    at = {name: places[index] for name, index in matches.items()}
    leg = sum(
        float(np.linalg.norm(at[near] - at[far]))
        for near, far in (("left_hip", "left_knee"), ("left_knee", "left_ankle"))
    )
    way = at["head"] - 0.5 * (at["left_ankle"] + at["right_ankle"])
    up = np.zeros(3)
    up[np.abs(way).argmax()] = np.sign(way[np.abs(way).argmax()])
    left = at["left_hip"] - at["right_hip"]
    left -= up * (up @ left)
    across = float(np.linalg.norm(left))
    if not (1e-6 < leg < 1e6 and across > 1e-3 * leg and up.any()):
        raise MotionError(f"{path}: legs or hips of its zero pose have no length; export it with offsets")
    left /= across
    axes = np.stack((left, up, np.cross(left, up)), axis=1)
    for side in ("left", "right"):
        if f"{side}_foot" in matches:
            toes = (at[f"{side}_foot"] - at[f"{side}_ankle"]) @ axes[:, 2]
            if toes < -0.02 * leg:
                raise MotionError(f"{path}: the {side} foot points backwards; are left and right exchanged?")
    return axes, leg


def _moved(clip: BvhClip, matches: Mapping[str, int]) -> tuple[dict[int, np.ndarray], np.ndarray]:
    """Return world rotations (T, 3, 3) of the matched joints, and the path (T, 3) of the pelvis as filed."""
    wanted: set[int] = set()
    for index in matches.values():
        while index >= 0 and index not in wanted:
            wanted.add(index)
            index = clip.joints[index].parent
    turned: dict[int, np.ndarray] = {}
    paths: dict[int, np.ndarray] = {}
    for index in sorted(wanted):
        joint = clip.joints[index]
        local, shift = clip.turns(joint), clip.shift(joint)
        if joint.parent < 0:
            turned[index], paths[index] = local, shift
            continue
        turned[index] = turned[joint.parent] @ local
        if index <= matches["pelvis"]:
            way = np.einsum("tij,tj->ti", turned[joint.parent], shift)
            paths[index] = paths[joint.parent] + way
    return turned, paths[matches["pelvis"]]


def _alignment(path: Path, name: str, places: np.ndarray, matches: Mapping[str, int]) -> np.ndarray:
    """Return A (3, 3) of one joint; places: (J, 3) of the zero pose in our axes. Raises MotionError."""
    side = name.split("_")[0]
    if name.endswith(("wrist", "hand")):
        return _alignment(path, f"{side}_elbow", places, matches)
    if name.endswith(("ankle", "foot")):
        foot = matches.get(f"{side}_foot")
        if foot is None:
            return np.eye(3)
        return foot_alignment(side, places[foot] - places[matches[f"{side}_ankle"]])
    if name not in LIMBS:
        return np.eye(3)
    far = LIMBS[name]
    theirs = places[matches[far]] - places[matches[name]]
    if np.linalg.norm(theirs) == 0.0:
        raise MotionError(f"{path}: joints for {name} and {far} in one place; export it with offsets")
    ours = REST_JOINTS[JOINT[far]] - REST_JOINTS[JOINT[name]]
    axis = np.cross(ours, theirs)
    sine = float(np.linalg.norm(axis))
    angle = float(np.arctan2(sine, ours @ theirs))
    if angle > (ARMS_DOWN if name.endswith(("shoulder", "elbow")) else ASTRIDE):
        raise MotionError(
            f"{path}: its zero pose is no T or A pose: {name} is turned by {np.degrees(angle):.0f} degrees; "
            "export it with a T pose at rest"
        )
    return rotation_matrices(axis * (angle / sine)) if sine > 0.0 else np.eye(3)
