"""Twists and turning walks that end within one frame: they set a wide hem swinging, and let it ring.

A body cannot stop within a frame. That is the point: the cloth then moves by itself, and its motion cannot be
told from the pose.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from snug.body.skeleton import JOINT, axis_angles, rotation_matrices
from snug.motion.clips.gait import START_SECONDS, WALK, gait_motion
from snug.motion.clips.posture import LIBRARY_FPS, RATE, SPINE_SHARES, poses_from_angles, root_path
from snug.motion.motion import smoothstep

FROZEN_FRAMES = 36  # frames after the stop: over a second, in which a hem comes to rest
STANCE = {
    "hip_abduction": 9.0, "knee_flexion": 10.0, "hip_flexion": 6.0, "arm_lowering": 34.0,
    "arm_flexion": 12.0, "elbow_flexion": 60.0,
}  # fmt: skip
ONSET = 0.5  # [s] from rest to the full swing


@dataclass(frozen=True)
class Twist:
    """The chest yaws by `degrees` at `hertz`, the pelvis by the share `hips` of it, until `stop` [s].

    With hips = 1 the body turns as one piece, as on a turntable.
    """

    degrees: float
    hertz: float
    hips: float
    stop: float

    def motion(self) -> tuple[np.ndarray, np.ndarray]:
        """Return poses (T, 24, 3) [rad] and translations (T, 3) [m] at LIBRARY_FPS, feet on the floor."""
        time = np.arange(round(self.stop * LIBRARY_FPS) + 1 + FROZEN_FRAMES) / LIBRARY_FPS
        time = np.minimum(time, round(self.stop * LIBRARY_FPS) / LIBRARY_FPS)
        yaw = self.degrees * np.sin(2 * np.pi * self.hertz * time) * smoothstep(time / ONSET)
        sided = {
            f"{side}_{name}": np.array(value) for side in ("left", "right") for name, value in STANCE.items()
        }
        poses = poses_from_angles(sided, len(time))
        _turn(poses, "pelvis", self.hips * yaw)
        for name, share in SPINE_SHARES:
            _turn(poses, name, share * (1.0 - self.hips) * yaw)
        translations = np.zeros((len(time), 3))
        translations[:, 1] = root_path(poses[:2])[0, 1]
        return poses, translations


@dataclass(frozen=True)
class TurningWalk:
    """A walk whose heading swings by `degrees` at `hertz`, at a pace, and freezes after `stop` [s]."""

    degrees: float
    hertz: float
    pace: float
    stop: float

    def motion(self) -> tuple[np.ndarray, np.ndarray]:
        """Return poses (T, 24, 3) [rad] and translations (T, 3) [m] at LIBRARY_FPS."""
        time = np.arange(round(self.stop * RATE) + 1) / RATE
        size = smoothstep(time / START_SECONDS)
        yaw = self.degrees * size * np.sin(2 * np.pi * self.hertz * time)
        poses, path = gait_motion(WALK, self.pace, size, {"pelvis_yaw": yaw})
        every = round(RATE / LIBRARY_FPS)
        poses, path = poses[::every], path[::every]
        frozen = np.minimum(np.arange(len(poses) + FROZEN_FRAMES), len(poses) - 1)
        return poses[frozen], path[frozen] - path[0] * [1.0, 0.0, 1.0]


def _turn(poses: np.ndarray, joint: str, degrees: np.ndarray) -> None:
    """Yaw one joint by degrees (T,) before the rotation that it has."""
    yaw = Rotation.from_euler("y", degrees[:, None], degrees=True).as_matrix()
    poses[:, JOINT[joint]] = axis_angles(yaw @ rotation_matrices(poses[:, JOINT[joint]]))


# Signs, phases and amplitudes of the stops differ.
STOPS: dict[str, Twist | TurningWalk] = {
    "twist_1": Twist(-30.0, 0.7, 0.33, 1.6),
    "twist_2": Twist(55.0, 0.8, 0.33, 2.1),
    "twist_3": Twist(-38.0, 1.3, 0.33, 1.5),
    "twist_4": Twist(60.0, 0.6, 0.5, 1.9),
    "twist_5": Twist(-25.0, 1.6, 0.5, 1.3),
    "twist_6": Twist(50.0, 1.15, 0.2, 1.6),
    "turntable_1": Twist(35.0, 0.8, 1.0, 1.7),
    "turntable_2": Twist(-50.0, 0.65, 1.0, 2.2),
    "turntable_3": Twist(28.0, 1.4, 1.0, 1.5),
    "turning_walk_1": TurningWalk(25.0, 0.5, 1.0, 2.6),
    "turning_walk_2": TurningWalk(-40.0, 0.35, 0.85, 2.3),
    "turning_walk_3": TurningWalk(15.0, 0.8, 1.2, 2.0),
    "turning_walk_4": TurningWalk(-30.0, 0.6, 1.1, 3.0),
    "twist_stop": Twist(45.0, 1.0, 0.33, 1.9),
    "turning_stop": TurningWalk(32.0, 0.45, 0.95, 2.4),
}
