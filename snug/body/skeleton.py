"""Skeleton of 24 joints in SMPL's order: numbers and forward kinematics, without mesh or torch.

Motions need joint positions (feet on the floor, limb directions) but not the body's surface, so the rest
joints here are the default body's, rounded to half a centimetre. Frames: y up, facing +z, left
arm along +x, metres, the floor at y = 0.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

JOINT_NAMES = (
    "pelvis", "left_hip", "right_hip", "spine1", "left_knee", "right_knee", "spine2", "left_ankle",
    "right_ankle", "spine3", "left_foot", "right_foot", "neck", "left_collar", "right_collar", "head",
    "left_shoulder", "right_shoulder", "left_elbow", "right_elbow", "left_wrist", "right_wrist", "left_hand",
    "right_hand",
)  # fmt: skip
PARENTS = (-1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19, 20, 21)
JOINT = {name: index for index, name in enumerate(JOINT_NAMES)}
BODY_JOINTS = JOINT["left_hand"]  # these come first in SMPL, SMPL-H and SMPL-X alike

# (x, y, z) [m] of the middle and left joints; the right side is the mirror image.
_REST = {
    "pelvis": (0.0, 0.90, 0.0), "spine1": (0.0, 0.98, -0.04), "spine2": (0.0, 1.13, -0.03),
    "spine3": (0.0, 1.26, -0.04), "neck": (0.0, 1.44, 0.0), "head": (0.0, 1.54, 0.03),
    "left_hip": (0.11, 0.885, -0.01), "left_knee": (0.13, 0.51, 0.02), "left_ankle": (0.155, 0.077, -0.01),
    "left_foot": (0.165, 0.026, 0.135), "left_collar": (0.025, 1.365, 0.015),
    "left_shoulder": (0.175, 1.345, 0.01), "left_elbow": (0.435, 1.345, 0.01),
    "left_wrist": (0.665, 1.345, 0.01), "left_hand": (0.70, 1.34, 0.02),
}  # fmt: skip
REST_JOINTS = np.array(
    [_REST[n.replace("right", "left")] * np.array([-1.0 if n.startswith("right") else 1.0, 1.0, 1.0])
     for n in JOINT_NAMES]
)  # fmt: skip
REST_JOINTS.setflags(write=False)

# Points of the left sole in the rest pose, by the joint that carries them: heel and ball, then toe tip.
_SOLE = (
    ("left_ankle", (0.15, 0.0, -0.06)),
    ("left_ankle", (0.17, 0.0, 0.13)),
    ("left_foot", (0.17, 0.0, 0.19)),
)
# [m] thigh plus shank of REST_JOINTS
LEG_LENGTH = float(np.linalg.norm(np.diff(REST_JOINTS[[1, 4, 7]], axis=0), axis=1).sum())


class BodyError(ValueError):
    """A file of a body, or an argument, that cannot be used; the message has the remedy."""


def rotation_matrices(axis_angles: np.ndarray) -> np.ndarray:
    """Return the rotation matrices (..., 3, 3) of axis-angles (..., 3) [rad], by Rodrigues' formula.

    >>> import numpy as np
    >>> np.round(rotation_matrices(np.array([0.0, np.pi / 2, 0.0])) @ [1.0, 0.0, 0.0], 12) + 0.0
    array([ 0.,  0., -1.])
    """
    from scipy.spatial.transform import Rotation  # slow to load; names are listed without

    flat = np.asarray(axis_angles, dtype=float).reshape(-1, 3)
    return Rotation.from_rotvec(flat).as_matrix().reshape(*np.shape(axis_angles), 3)


def axis_angles(matrices: np.ndarray) -> np.ndarray:
    """Return the axis-angles (..., 3) [rad], at most pi long, of rotation matrices (..., 3, 3).

    >>> import numpy as np
    >>> np.round(axis_angles(rotation_matrices(np.array([0.1, 0.2, 0.3]))), 12)
    array([0.1, 0.2, 0.3])
    """
    from scipy.spatial.transform import Rotation  # slow to load; names are listed without

    flat = np.asarray(matrices, dtype=float).reshape(-1, 3, 3)
    return Rotation.from_matrix(flat).as_rotvec().reshape(np.shape(matrices)[:-1])


def turn_joint(poses: np.ndarray, joint: int, turns: np.ndarray) -> None:
    """Turn a joint of poses (T, 24, 3) [rad] in place, in its parent's axes, by matrices ([T,] 3, 3)."""
    poses[:, joint] = axis_angles(turns @ rotation_matrices(poses[:, joint]))


def global_rotations(poses: np.ndarray, parents: Sequence[int] = PARENTS) -> np.ndarray:
    """Return the world rotation of every joint (T, J, 3, 3) in poses (T, J, 3) [rad]."""
    rotations = rotation_matrices(poses)
    for joint, parent in enumerate(parents):
        if parent >= 0:
            rotations[:, joint] = rotations[:, parent] @ rotations[:, joint]
    return rotations


def joint_positions(poses: np.ndarray, translations: np.ndarray) -> np.ndarray:
    """Return where the joints are, (T, 24, 3) [m], by forward kinematics.

    poses: (T, 24, 3) [rad]. translations: (T, 3) [m] of the root.
    """
    return _positions(global_rotations(poses), translations, REST_JOINTS)


def joint_transforms(
    poses: np.ndarray, translations: np.ndarray, rest_joints: np.ndarray, parents: Sequence[int]
) -> np.ndarray:
    """Return the rest-to-posed transform of each joint, (T, J, 3, 4).

    poses: (T, J, 3) [rad]. translations: (T, 3) [m]. rest_joints: (J, 3) [m]. The same in torch is
    `snug.body.skinning.joint_transforms`.
    """
    rotations = global_rotations(poses, parents)
    shifts = _positions(rotations, translations, rest_joints, parents)
    shifts -= np.einsum("tjab,jb->tja", rotations, rest_joints)
    return np.concatenate([rotations, shifts[..., None]], axis=-1)


def sole_points(poses: np.ndarray, translations: np.ndarray) -> np.ndarray:
    """Return heel, ball and toe tip (T, 6, 3) [m] of the left, then of the right foot."""
    rotations = global_rotations(poses)
    positions = _positions(rotations, translations, REST_JOINTS)
    points = []
    for side, mirror in (("left", 1.0), ("right", -1.0)):
        for name, point in _SOLE:
            joint = JOINT[name.replace("left", side)]
            lever = np.array(point) * [mirror, 1.0, 1.0] - REST_JOINTS[joint]
            points.append(positions[:, joint] + rotations[:, joint] @ lever)
    return np.stack(points, axis=1)


def _positions(
    rotations: np.ndarray,
    translations: np.ndarray,
    rest_joints: np.ndarray,
    parents: Sequence[int] = PARENTS,
) -> np.ndarray:
    positions = np.empty((*rotations.shape[:2], 3))
    for joint, parent in enumerate(parents):
        if parent < 0:
            positions[:, joint] = rest_joints[joint] + translations
        else:
            bone = rest_joints[joint] - rest_joints[parent]
            positions[:, joint] = positions[:, parent] + rotations[:, parent] @ bone
    return positions
