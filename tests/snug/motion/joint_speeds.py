"""How fast the joints of a motion turn."""

import numpy as np

from snug.body.skeleton import axis_angles, rotation_matrices


def joint_speeds(motion):
    """Angular speed of every joint relative to its parent, (T - 1, 24) [rad/s]."""
    rotations = rotation_matrices(motion.poses)
    steps = axis_angles(np.swapaxes(rotations[:-1], -1, -2) @ rotations[1:])
    return np.linalg.norm(steps, axis=-1) * motion.fps
