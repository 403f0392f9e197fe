"""Motions, and operations on one: spread arms, resample, place, turn, mirror.

A motion follows the convention of `snug.body.parametric_body`: y up, facing +z at first, standing at
translation zero. Motions come from `snug.motion.library` or `snug.motion.files`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from snug.body.skeleton import (
    JOINT,
    axis_angles,
    joint_positions,
    rotation_matrices,
    sole_points,
    turn_joint,
)

# Upper arm to the spine's direction: on the default body this leaves about 2 cm between arm and chest.
ARMS_CLEAR = np.deg2rad(25.0)


class MotionError(ValueError):
    """A motion that cannot be read, named or built; the message says where and what to do."""


@dataclass(frozen=True, eq=False)
class Motion:
    """Joint rotations and root translations over time.

    Attributes:
        name: of the file, or in the library.
        poses: (T, 24, 3) [rad], axis-angle relative to the parent joint.
        translations: (T, 3) [m] of the root.
        fps: frames per second [1/s].
        kind: groups motions of one sort ("walk", "jump").
        source: where it came from, and every change.

    Raises:
        MotionError: shapes disagree, a number is not finite, or there is no frame.

    >>> import numpy as np
    >>> standing = Motion("standing", poses=np.zeros((60, 24, 3)), translations=np.zeros((60, 3)))
    >>> standing.frames, standing.fps
    (60, 30.0)
    """

    name: str
    poses: np.ndarray
    translations: np.ndarray
    fps: float = 30.0
    kind: str = ""
    source: str = ""

    def __post_init__(self) -> None:
        poses = np.ascontiguousarray(self.poses, dtype=np.float64)
        translations = np.ascontiguousarray(self.translations, dtype=np.float64)
        frames, shapes = len(poses), (poses.shape, translations.shape)
        if not frames or shapes != ((frames, 24, 3), (frames, 3)):
            raise MotionError(
                f"motion {self.name}: arrays {shapes}; give (frames, 24, 3) and (frames, 3)"
            )
        finite = np.isfinite(poses).all(axis=(1, 2)) & np.isfinite(translations).all(axis=1)
        if not finite.all():
            bad_frames = f"{np.count_nonzero(~finite)} frames, from frame {finite.argmin()} on"
            raise MotionError(
                f"motion {self.name}: numbers are not finite in {bad_frames}; cut the clip there"
            )
        if not (np.isfinite(self.fps) and self.fps > 0):
            raise MotionError(f"motion {self.name}: {self.fps} frames per second; give a positive rate")
        object.__setattr__(self, "poses", poses)
        object.__setattr__(self, "translations", translations)

    def __repr__(self) -> str:
        return f"Motion({self.name!r}, {self.frames} frames at {self.fps:g} per second)"

    @property
    def frames(self) -> int:
        """Number of frames."""
        return len(self.poses)

    def cut(self, start: int, stop: int) -> Motion:
        """Return frames start to stop - 1. Raises MotionError when nothing is left."""
        return replace(self, poses=self.poses[start:stop], translations=self.translations[start:stop])

    def followed_by(self, other: Motion) -> Motion:
        """Return this motion followed by the other one's frames. Raises MotionError where rates differ."""
        if other.fps != self.fps:
            raise MotionError(
                f"motion {other.name}: {other.fps:g} frames a second after {self.fps:g} of {self.name}: "
                "resample it"
            )
        poses = np.concatenate([self.poses, other.poses])
        translations = np.concatenate([self.translations, other.translations])
        return replace(self, poses=poses, translations=translations)


def spread_arms(motion: Motion, degrees: float = 20.0) -> Motion:
    """Turn both shoulders outward and up by the same angle in all frames, about the chest's front axis.

    The authors of SNUG did the same with their data: a T-shirt pinched between upper arm and torso has no
    good solution (and the simulator's contact planes no good choice).
    """
    poses = motion.poses.copy()
    for joint, sign in ((JOINT["left_shoulder"], 1.0), (JOINT["right_shoulder"], -1.0)):
        turn = rotation_matrices(np.array([0.0, 0.0, sign * np.deg2rad(degrees)]))
        turn_joint(poses, joint, turn)
    source = f"{motion.source}; arms spread by {degrees:g} degrees".lstrip("; ")
    return replace(motion, poses=poses, source=source)


def clear_arms(motion: Motion) -> Motion:
    """Spread the arms by 20 degrees, or in steps of 5 up to 40 until they are clear of the torso.

    Clear: every upper arm at least ARMS_CLEAR from the spine's direction in 95 % of the frames. A clip
    whose arms stay nearer says so in its source.
    """
    for degrees in (20.0, 25.0, 30.0, 35.0, 40.0):
        spread = spread_arms(motion, degrees)
        share = (arm_clearance(spread).min(axis=1) < ARMS_CLEAR).mean()
        if share <= 0.05:
            return spread
    limit = f"{np.degrees(ARMS_CLEAR):.0f} degrees"
    note = f"an upper arm within {limit} of the torso in {100 * share:.0f} % of frames"
    return replace(spread, source=f"{spread.source}; {note}")


def resample(motion: Motion, fps: float = 30.0) -> Motion:
    """Return the motion at another frame rate: rotations along the shortest arc, translations linearly.

    First and last pose stay. Where the rates do not divide, the clip is stretched by at most half a new
    frame in all, so that frames stay evenly spaced at exactly `fps` (the simulator's time step is fixed).
    A clip of less than one new frame is stretched to one.
    """
    if motion.frames == 1 or fps == motion.fps:
        return replace(motion, fps=fps)
    intervals = max(1, round((motion.frames - 1) / motion.fps * fps))
    at = np.linspace(0.0, motion.frames - 1.0, intervals + 1)
    left = np.minimum(at.astype(int), motion.frames - 2)
    share = at - left
    poses = slerp(motion.poses[left], motion.poses[left + 1], share[:, None])
    low, high = motion.translations[left], motion.translations[left + 1]
    return replace(motion, poses=poses, translations=low + share[:, None] * (high - low), fps=fps)


def transition(pose_a: np.ndarray, pose_b: np.ndarray, frames: int) -> np.ndarray:
    """Make the frames (frames, 24, 3) [rad] from one pose (24, 3) to another, both included, at rest at both.

    Each joint turns along the shortest arc with the minimum-jerk timing 10 s^3 - 15 s^4 + 6 s^5.

    Source:
        T. Flash and N. Hogan, The coordination of arm movements, Journal of Neuroscience 5 (1985).
    """
    return slerp(pose_a, pose_b, smoothstep(np.linspace(0.0, 1.0, frames)[:, None]))


def smoothstep(s: np.ndarray) -> np.ndarray:
    """Return 0 below 0, 1 above 1, between them a quintic with neither slope nor curvature at its ends."""
    s = np.clip(s, 0.0, 1.0)
    return s**3 * (10.0 - 15.0 * s + 6.0 * s**2)


def place(motion: Motion) -> Motion:
    """Move a clip so that it starts above the origin, facing +z, with its feet on the floor y = 0.

    The whole clip is turned and shifted rigidly. Recorded floors are seldom at zero, so the second
    percentile of the lower foot's height over all frames is taken for the floor.
    """
    placed = turn_about_vertical(motion, -heading(motion.poses[0]))
    lowest = sole_points(placed.poses, placed.translations)[..., 1].min(axis=1)
    placed.translations[:, 1] -= np.percentile(lowest, 2.0)
    return placed


def heading(pose: np.ndarray) -> float:
    """Return the angle [rad] about the vertical, from +z towards +x, that a pose (24, 3) [rad] faces."""
    facing = rotation_matrices(pose[0])[:, 2]
    # A body lying on its back or front has no heading; it keeps the recorded one.
    return float(np.arctan2(facing[0], facing[2])) if np.hypot(facing[0], facing[2]) > 0.1 else 0.0


def turn_about_vertical(motion: Motion, angle: float) -> Motion:
    """Turn the whole motion by an angle [rad] about the vertical, and begin it above the origin."""
    turn = rotation_matrices(np.array([0.0, angle, 0.0]))
    poses = motion.poses.copy()
    turn_joint(poses, 0, turn)
    translations = (motion.translations - motion.translations[0]) @ turn.T
    return replace(motion, poses=poses, translations=translations)


def mirror_motion(motion: Motion) -> Motion:
    """Mirror the motion in the plane x = 0: sides change, turns about y and z change sign."""
    swap = {"left": "right", "right": "left"}
    sides = (name.partition("_") for name in JOINT)
    twin = [JOINT[f"{swap.get(side, side)}{bar}{part}"] for side, bar, part in sides]
    return replace(
        motion,
        name=f"{motion.name}_mirrored",
        poses=motion.poses[:, twin] * [1.0, -1.0, -1.0],
        translations=motion.translations * [-1.0, 1.0, 1.0],
    )


def arm_clearance(motion: Motion) -> np.ndarray:
    """Return the angles (T, 2) [rad] between each upper arm and the downward spine: small on the torso."""
    return _limb_angles(motion, ("shoulder", "elbow"), ("spine3", "spine1"))


def lap_clearance(motion: Motion) -> np.ndarray:
    """Return the angles (T, 2) [rad] between each thigh and the upward spine: small on the belly."""
    return _limb_angles(motion, ("hip", "knee"), ("spine1", "spine3"))


def _limb_angles(motion: Motion, limb: tuple[str, str], trunk: tuple[str, str]) -> np.ndarray:
    """Return the angles (T, 2) [rad] between left and right limb and the trunk, each from joint to joint."""
    joints = joint_positions(motion.poses, motion.translations)
    along = joints[:, JOINT[trunk[1]]] - joints[:, JOINT[trunk[0]]]
    angles = []
    for side in ("left", "right"):
        bone = joints[:, JOINT[f"{side}_{limb[1]}"]] - joints[:, JOINT[f"{side}_{limb[0]}"]]
        cosine = (bone * along).sum(-1) / np.linalg.norm(bone, axis=-1) / np.linalg.norm(along, axis=-1)
        angles.append(np.arccos(np.clip(cosine, -1.0, 1.0)))
    return np.stack(angles, axis=1)


def slerp(poses_a: np.ndarray, poses_b: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Interpolate between poses (..., 3) [rad] along the shortest arc, by shares (...) in [0, 1]."""
    start = rotation_matrices(poses_a)
    arc = axis_angles(np.swapaxes(start, -1, -2) @ rotation_matrices(poses_b))
    return axis_angles(start @ rotation_matrices(arc * share[..., None]))
