"""Bring a body whose arms hang down in its file, an A pose, to the T pose that every motion starts from."""

import numpy as np
from numpy.typing import NDArray

from snug.body.skeleton import JOINT, PARENTS

Array = NDArray[np.float64]

ARM_JOINTS = ("shoulder", "elbow", "wrist", "hand")
SIDE_SIGNS = (("left", 1.0), ("right", -1.0))


def arm_angles(joints: Array) -> Array:
    """Return the angles (2,) [rad] by which the left and right arm of joints (24, 3) [m] hang down."""
    arms = [joints[JOINT[f"{side}_wrist"]] - joints[JOINT[f"{side}_shoulder"]] for side, _ in SIDE_SIGNS]
    return np.array(
        [np.arctan2(-arm[1], sign * arm[0]) for arm, (_, sign) in zip(arms, SIDE_SIGNS, strict=True)]
    )


def arm_rotations(angles: Array) -> Array:
    """Return the world rotations (24, 3, 3) that lift each arm, as one piece, by angles (2,) [rad]."""
    turns = np.broadcast_to(np.eye(3), (len(JOINT), 3, 3)).copy()
    for (side, sign), angle in zip(SIDE_SIGNS, angles, strict=True):
        c, s = np.cos(angle), sign * np.sin(angle)
        turns[[JOINT[f"{side}_{part}"] for part in ARM_JOINTS]] = [[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]
    return turns


def turn_rest_pose(points: Array, joints: Array, weights: Array, turns: Array) -> tuple[Array, Array]:
    """Turn the joints of an unposed body in the world, and its vertices with them.

    The new rest pose is the one that linear blend skinning takes back to the old one exactly: each vertex is
    moved by the inverse of the blended transform. Blending forwards would lose volume at the shoulder here,
    and once more whenever the arm comes down. All is linear in points and joints together.

    Args:
        points: (B, 3, K) [m], K bodies or shape directions.
        joints: (24, 3, K) [m] of the same.
        weights: (B, 24) of skinning.
        turns: (24, 3, 3), world rotation of each joint.

    Returns:
        Turned vertices (B, 3, K) and joints (24, 3, K) [m].
    """
    moved = joints.copy()
    for joint, parent in enumerate(PARENTS):
        if parent >= 0:
            moved[joint] = moved[parent] + turns[parent] @ (joints[joint] - joints[parent])
    back = turns.transpose(0, 2, 1)
    offsets = joints - back @ moved
    blended = np.einsum("vj,jab->vab", weights, back)
    shift = np.einsum("vj,jak->vak", weights, offsets)
    return np.linalg.solve(blended, points - shift), moved
