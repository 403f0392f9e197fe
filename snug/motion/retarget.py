"""Put the motion of a foreign skeleton on ours: every limb points where theirs does.

Our joint j turns in the world by G_j = G_b A_j. Theirs turns by G_b from the zero pose, and A_j turns our
resting limb t_j into theirs there, d_b: its far end then points along G_b A_j t_j = G_b d_b. How a limb is
twisted about itself follows from its hinge where the file has one. Else A_j is the smallest turn, and the
zero pose must be a T or A pose.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from snug.body.skeleton import (
    JOINT,
    JOINT_NAMES,
    PARENTS,
    REST_JOINTS,
    axis_angles,
    rotation_matrices,
)
from snug.motion.motion import MotionError

# Joints whose limb points to the next joint.
LIMBS = {
    f"{side}_{near}": f"{side}_{far}"
    for side in ("left", "right")
    for near, far in (("hip", "knee"), ("knee", "ankle"), ("shoulder", "elbow"), ("elbow", "wrist"))
}
FEET = {"left_ankle": "left_foot", "right_ankle": "right_foot"}
# Axis about which a hinge bends in our rest pose. The limb above a hinge is aligned by the same axis.
HINGES = {"left_knee": (1, 0, 0), "right_knee": (1, 0, 0), "left_elbow": (0, -1, 0), "right_elbow": (0, 1, 0)}
# Largest turn from our rest pose to a zero pose without hinges: legs astride, arms down.
ASTRIDE, ARMS_DOWN = np.deg2rad(60.0), np.deg2rad(95.0)


def retarget(
    path: Path,
    turns: Mapping[str, np.ndarray],
    directions: Mapping[str, np.ndarray],
    hinges: Mapping[str, np.ndarray],
) -> np.ndarray:
    """Return our poses (T, 24, 3) [rad] relative to the parents; a joint that they lack does not turn.

    Args:
        path: of their skeleton, for messages.
        turns: (T, 3, 3) by our joint, its rotation in the world from their zero pose.
        directions: (3,) of LIMBS, and of FEET where there are any, in their zero pose, y up, facing +z.
        hinges: (3,) axes of HINGES in the same pose; empty for a skeleton without.

    Raises:
        MotionError: a limb has no direction, or the zero pose is no T or A pose.
    """
    rotations = np.empty((len(turns["pelvis"]), len(JOINT_NAMES), 3, 3))
    for joint, name in enumerate(JOINT_NAMES):
        if name in turns:
            rotations[:, joint] = turns[name] @ _alignment(path, name, directions, hinges)
        else:
            rotations[:, joint] = rotations[:, PARENTS[joint]]
    relative = rotations.copy()
    for joint, parent in enumerate(PARENTS):
        if parent >= 0:
            relative[:, joint] = np.swapaxes(rotations[:, parent], -1, -2) @ rotations[:, joint]
    return axis_angles(relative)


def _alignment(
    path: Path, name: str, directions: Mapping[str, np.ndarray], hinges: Mapping[str, np.ndarray]
) -> np.ndarray:
    """Return A (3, 3) of one joint.

    Feet turn about the vertical only, since both skeletons stand flat in their rest poses. Spine, head and
    collars have no limb to align: upright is upright.
    """
    side, _, part = name.partition("_")
    if part in ("wrist", "hand"):
        return _alignment(path, f"{side}_elbow", directions, hinges)
    if part in ("ankle", "foot") and f"{side}_ankle" in directions:
        theirs = directions[f"{side}_ankle"]
        ours = REST_JOINTS[JOINT[f"{side}_foot"]] - REST_JOINTS[JOINT[f"{side}_ankle"]]
        yaw = np.arctan2(theirs[0], theirs[2]) - np.arctan2(ours[0], ours[2])
        return rotation_matrices(np.array([0.0, yaw, 0.0]))
    if name not in LIMBS:
        return np.eye(3)
    ours, theirs = REST_JOINTS[JOINT[LIMBS[name]]] - REST_JOINTS[JOINT[name]], directions[name]
    hinge = f"{side}_{'knee' if part in ('hip', 'knee') else 'elbow'}"
    if hinges:
        turn = _frame(theirs, hinges[hinge]) @ _frame(ours, np.array(HINGES[hinge], dtype=float)).T
    else:
        axis = np.cross(ours, theirs)
        sine = float(np.linalg.norm(axis))
        angle = float(np.arctan2(sine, ours @ theirs))
        if angle > (ASTRIDE if hinge.endswith("knee") else ARMS_DOWN):
            raise MotionError(
                f"{path}: its zero pose is no T or A pose: {name} is turned by {np.degrees(angle):.0f} "
                "degrees; export it with a T pose at rest"
            )
        turn = rotation_matrices(axis * (angle / sine)) if sine > 0.0 else np.eye(3)
    if not np.isfinite(turn).all() or not theirs.any():
        raise MotionError(f"{path}: {name} has no length, or lies along its own hinge; export it again")
    return turn


def _frame(along: np.ndarray, hinge: np.ndarray) -> np.ndarray:
    """Return orthonormal columns: along, the part of hinge across it, and their cross product."""
    first = along / np.linalg.norm(along)
    second = hinge - first * (first @ hinge)
    second /= np.linalg.norm(second)
    return np.stack((first, second, np.cross(first, second)), axis=1)
