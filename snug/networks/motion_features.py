"""Rates and history of a body's motion: the inputs that a network needs to answer secondary motion.

Poses and the root's velocity do not tell of turning on the spot, nor of a stop: cloth is moved by the
accelerations of what it hangs on, and that is joints, not the root alone. Everything is in the axes of the
joint that turns (of the root for translations), so that it does not matter where north is. The cloth's state
began some time ago: the longer ago, the coarser it need be known.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from snug.body.skeleton import JOINT, axis_angles, rotation_matrices
from snug.motion.motion import Motion

# Trunk, thighs and upper arms carry cloth; their rates are inputs. Of the trunk the accelerations too.
RATED_JOINTS = (
    "pelvis", "left_hip", "right_hip", "spine1", "spine2", "spine3", "left_collar", "right_collar",
    "left_shoulder", "right_shoulder",
)  # fmt: skip
TRUNK_JOINTS = ("pelvis", "spine1", "spine2", "spine3")
SPANS = (1, 1, 1, 1, 1, 2, 2, 3, 3, 4, 4)  # frames that one mean of a history is over, the latest first
HISTORY = sum(SPANS)  # frames: three quarters of a second, in which a swing dies down by some two thirds


def motion_rates(motion: Motion) -> np.ndarray:
    """Return the rates (T, 48) of a motion by backward differences; the first frame is at rest.

    Columns: root velocity [m/s] and acceleration [m/s^2]; angular velocity [rad/s] of each of RATED_JOINTS;
    angular acceleration [rad/s^2] of each of TRUNK_JOINTS.
    """
    fps = motion.fps
    rotations = rotation_matrices(motion.poses[:, [JOINT[name] for name in RATED_JOINTS]])
    turns = axis_angles(np.swapaxes(rotations[:-1], -1, -2) @ rotations[1:]) * fps  # in the joint's own axes
    turns = np.concatenate([np.zeros((1, *turns.shape[1:])), turns])
    velocity = np.diff(motion.translations, axis=0, prepend=motion.translations[:1]) * fps
    acceleration = np.diff(velocity, axis=0, prepend=velocity[:1]) * fps
    to_root = np.swapaxes(rotations[:, 0], -1, -2)
    trunk = turns[:, [RATED_JOINTS.index(name) for name in TRUNK_JOINTS]]
    spins = np.diff(trunk, axis=0, prepend=trunk[:1]) * fps
    parts = (
        (to_root @ velocity[..., None])[..., 0],
        (to_root @ acceleration[..., None])[..., 0],
        turns.reshape(len(turns), -1),
        spins.reshape(len(turns), -1),
    )
    return np.concatenate(parts, axis=1)


def motion_history(motion: Motion) -> np.ndarray:
    """Return means (T, 48 x 11) of the rates over SPANS, this frame's first; a motion begins at rest."""
    rates = motion_rates(motion)
    padded = np.concatenate([np.zeros((HISTORY - 1, rates.shape[1])), rates])
    delayed = [padded[HISTORY - 1 - frames :][: len(rates)] for frames in range(HISTORY)]
    ends = np.cumsum((0, *SPANS))
    return np.concatenate([sum(delayed[a:b]) / (b - a) for a, b in pairwise(ends)], axis=1)
