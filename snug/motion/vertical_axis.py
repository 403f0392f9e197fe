"""Vertical axis of a recording: found from the body that stands along it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from snug.body.skeleton import JOINT, axis_angles, joint_positions, rotation_matrices
from snug.motion.motion import MotionError
from snug.motion.raw_motion import RawMotion

# From the axes of a file, by the one that is vertical, to ours: with z up (x, y, z) becomes (x, z, -y).
TO_Y_UP = {
    "y": np.eye(3),
    "z": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]),
}
_SIGNED_AXES = ("x", "y", "z", "-x", "-y", "-z")
MAX_LYING_COSINE = 0.3  # between the vertical and the way from ankles to head: below it a body lies or crawls
MAX_RISE = 1.0  # [m] the lowest joint may rise and fall where no axis is given: more than a jump


def turn_y_up(raw: RawMotion, up: str) -> RawMotion:
    """Turn a raw motion so that y is up.

    In a frame the body stands along the axis that is nearest to the direction from its ankles to its head.
    The axis of more than half of the frames is taken; a body that lies in the others, as after a fall, is
    fine.

    Args:
        raw: in the axes of its file.
        up: its vertical axis, "y" or "z"; empty: the one along which the body stands.

    Raises:
        MotionError: no axis is that, the given one is not, or a body that should stand along the axis found
            travels along it: it may be crawling.
    """
    joints = joint_positions(raw.poses, raw.translations)
    ankles = joints[:, [JOINT["left_ankle"], JOINT["right_ankle"]]].mean(axis=1)
    directions = joints[:, JOINT["head"]] - ankles
    directions /= np.maximum(np.linalg.norm(directions, axis=1, keepdims=True), 1e-9)
    signed = np.concatenate([directions, -directions], axis=1)
    shares = np.bincount(signed.argmax(axis=1), minlength=6) / len(directions)
    likely = _SIGNED_AXES[int(shares.argmax())]
    share = f"{100 * shares.max():.0f} % of the frames"
    if up and (directions[:, _SIGNED_AXES.index(up)] > MAX_LYING_COSINE).mean() <= 0.5:
        problem = f"with {up} up the body lies on its back or side: it stands"
    elif not up and (shares.max() <= 0.5 or likely not in TO_Y_UP):
        problem = "the body stands neither along y nor along z:"
    else:
        problem = ""
    if problem:
        remedy = "turn the root's rotation and path so that y or z is up, or give a clip that stands"
        if likely in TO_Y_UP:
            remedy = f"give --motion-up {likely}, or a clip that stands"
        raise MotionError(f"{raw.path}: {problem} along {likely} in {share}; {remedy}")
    rise = float(np.ptp(joints[..., _SIGNED_AXES.index(up or likely)].min(axis=1)))
    if not up and rise > MAX_RISE:
        raise MotionError(
            f"{raw.path}: the body points along {likely} in {share}, and its lowest joint moves by "
            f"{rise:.3g} m along it; if {likely} is up and the path in metres give --motion-up {likely}"
        )
    turn = TO_Y_UP[up or likely]
    note = f"{up} up as given" if up else f"{likely} up, as the body stands in {share}"
    poses = raw.poses.copy()
    poses[:, 0] = axis_angles(turn @ rotation_matrices(poses[:, 0]))
    return replace(raw, poses=poses, translations=raw.translations @ turn.T, source=f"{raw.source}; {note}")
