"""Pose and motion of the joints near a garment, the inputs of Neural Cloth Simulation.

    pose of a joint:    two columns of its rotation R, and the direction of gravity in its axes
    motion of a joint:  rates of both, and the acceleration of its position in its axes

A body that stands still has a motion of zero. The pelvis differs from the authors' inputs: its rotation is
left out of the pose, and the rate of it is taken in its own axes, so that it does not matter where north is.
"""

from __future__ import annotations

import numpy as np

from snug.body.parametric_body import Body
from snug.body.skeleton import JOINT, rotation_matrices
from snug.motion.motion import Motion

# Those of the published configuration for SMPL: what carries clothes, without shanks, feet, hands and head.
DESCRIBED = (
    "pelvis", "left_hip", "right_hip", "spine1", "left_knee", "right_knee", "spine2", "spine3", "neck",
    "left_collar", "right_collar", "left_shoulder", "right_shoulder", "left_elbow", "right_elbow",
)  # fmt: skip
POSE_NUMBERS = 6 * (len(DESCRIBED) - 1) + 3 * len(DESCRIBED)
RATES = 12  # numbers of the motion of one joint


def joint_motion(
    body: Body, motion: Motion, betas: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Return pose (T, 129) and motion (T, 15 x 12) of DESCRIBED joints, by backward differences.

    The first frame is at rest. Rotations have no unit, rates are [1/s], accelerations [m/s^2].

    Args:
        body: gives the lengths of the bones.
        motion: T frames.
        betas: shape numbers of the body; None is the mean body.

    Source:
        H. Bertiche, M. Madadi and S. Escalera, Neural cloth simulation, ACM Transactions on Graphics 41
        (2022), article 220.
    """
    joints, fps = [JOINT[name] for name in DESCRIBED], motion.fps
    transforms = body.transforms(motion.poses, motion.translations, betas)[:, joints]
    world, shifts = transforms[..., :3], transforms[..., 3]
    positions = np.einsum("tjab,jb->tja", world, body.joints(betas)[joints]) + shifts
    rotations, down = rotation_matrices(motion.poses[:, joints]), -world[:, :, 1]  # R^T (-e_y)
    turning = _rate(rotations, fps)
    turning[:, 0] = rotations[:, 0].swapaxes(-1, -2) @ turning[:, 0]
    acceleration = np.einsum("tjba,tjb->tja", world, _rate(_rate(positions, fps), fps))
    frames = len(motion.poses)
    pose = [_columns(rotations[:, 1:]).reshape(frames, -1), down.reshape(frames, -1)]
    rates = [_columns(turning), _rate(down, fps), acceleration]
    return np.concatenate(pose, axis=1), np.concatenate(rates, axis=2).reshape(frames, -1)


def _rate(values: np.ndarray, fps: float) -> np.ndarray:
    """Return the change of values (T, ...) in a second; zero in the first frame."""
    return np.diff(values, axis=0, prepend=values[:1]) * fps


def _columns(matrices: np.ndarray) -> np.ndarray:
    """Return the first two columns of matrices (T, J, 3, 3), (T, J, 6)."""
    return matrices[..., :2].swapaxes(-1, -2).reshape(*matrices.shape[:2], 6)
