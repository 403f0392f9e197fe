"""Turn the tables and curves of the embedded library into poses and root translations at 30 fps."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from snug.motion.clips.actions import (
    ARM_CIRCLE,
    ARM_RAISE,
    BOW,
    JUMP,
    JUMPING_JACK,
    LUNGE,
    SIDE_BEND,
    SPIN_JUMP,
    SQUAT,
    TORSO_TWIST,
    Action,
)
from snug.motion.clips.gait import RUN, WALK, Stride, gait_angles, gait_flights, gait_support, stride_phase
from snug.motion.clips.posture import LIBRARY_FPS, RATE, poses_from_angles, root_path, smoothstep
from snug.motion.clips.strikes import KICK, PUNCH, SIDESTEP, TURN
from snug.motion.clips.turns import STOPS
from snug.motion.clips.unseen import CARTWHEEL_LEAN, CLIMB, DANCE_TURN, PUSH_RECOVERY, SIT_AND_STAND

# name: (kind, action)
ACTIONS: dict[str, tuple[str, Action]] = {
    "jump": ("jump", JUMP),
    "jumping_jack": ("jumping jack", JUMPING_JACK),
    "squat": ("squat", SQUAT),
    "arm_raise": ("arm raise", ARM_RAISE),
    "arm_circle": ("arm raise", ARM_CIRCLE),
    "torso_twist": ("torso twist", TORSO_TWIST),
    "side_bend": ("side bend", SIDE_BEND),
    "turn": ("turn", TURN),
    "sidestep": ("sidestep", SIDESTEP),
    "bow": ("bow", BOW),
    "lunge": ("lunge", LUNGE),
    "kick": ("kick", KICK),
    "punch": ("punch", PUNCH),
    "spin_jump": ("spin jump", SPIN_JUMP),
    "push_recovery": ("push recovery", PUSH_RECOVERY),
    "dance_turn": ("dance turn", DANCE_TURN),
    "cartwheel_lean": ("cartwheel lean", CARTWHEEL_LEAN),
    "sit_and_stand": ("sitting down and standing up", SIT_AND_STAND),
}
# name: (kind, stride, seconds, pace as a share of the stride's normal rate, time at which it stops or None)
GAITS: dict[str, tuple[str, Stride, float, float, float | None]] = {
    "walk": ("walk", WALK, 4.0, 1.0, None),
    "brisk_walk": ("walk", WALK, 3.0, 1.25, None),
    "run": ("run", RUN, 3.0, 1.0, None),
    "sudden_stop": ("sudden stop", RUN, 3.0, 0.9, 1.53),
    "climbing_steps": ("climbing steps", CLIMB, 2.4, 1.0, None),
}
START_SECONDS = 0.7  # from standing to the full stride
STOP_SECONDS = 0.35  # from the full stride to standing


class LibraryClip(NamedTuple):
    """A motion of the library, arms as in its tables: poses (T, 24, 3) [rad], translations (T, 3) [m]."""

    poses: np.ndarray
    translations: np.ndarray
    kind: str
    source: str


def make_clip(name: str) -> LibraryClip:
    """Make the library's motion of that name at LIBRARY_FPS. Raises KeyError for an unknown name."""
    if name in STOPS:
        return LibraryClip(*STOPS[name].motion(), "stop", "embedded library: stops within a frame")
    if name in ACTIONS:
        kind, action = ACTIONS[name]
        angles, flights = action.angles()
        poses = poses_from_angles(angles, action.frames)
        path = root_path(poses, flights)
        source = "embedded library: key angles"
    else:
        kind, stride, seconds, pace, stop = GAITS[name]
        poses, path = _gait(stride, seconds, pace, stop)
        source = "embedded library: normative gait curves"
    path[:, [0, 2]] -= path[0, [0, 2]]
    every = round(RATE / LIBRARY_FPS)
    return LibraryClip(poses[::every], path[::every], kind, source)


def _gait(stride: Stride, seconds: float, pace: float, stop: float | None) -> tuple[np.ndarray, np.ndarray]:
    time = np.arange(round(seconds * RATE)) / RATE
    size = smoothstep(time / START_SECONDS)
    if stop is not None:
        size *= 1.0 - smoothstep((time - stop) / STOP_SECONDS)
    phase = stride_phase(stride, pace * size)
    angles = gait_angles(stride, phase, size)
    if stop is not None:
        _brake(angles, time - stop)
    poses = poses_from_angles(angles, len(time))
    # The trunk's mass evens out what the curves of the legs alone would do to the pelvis at each contact.
    flights, support = gait_flights(stride, phase, size), gait_support(phase, size)
    return poses, root_path(
        poses, flights, support=support, height_smoothing=0.045, speed_smoothing=0.08, rises=stride.rises
    )


def _brake(angles: dict[str, np.ndarray], since: np.ndarray) -> None:
    """Knees give way, the trunk tips forward and comes back, the arms fly forward: since (T,) [s]."""
    give = smoothstep(since / 0.3) * (1.0 - smoothstep((since - 0.4) / 0.7))
    follow = smoothstep((since - 0.05) / 0.25) * (1.0 - smoothstep((since - 0.3) / 0.6))
    angles["pelvis_pitch"] += 10.0 * give
    angles["trunk_flexion"] += 20.0 * follow
    angles["head_pitch"] -= 22.0 * follow
    for side in ("left", "right"):
        angles[f"{side}_hip_flexion"] += 48.0 * give
        angles[f"{side}_knee_flexion"] += 58.0 * give
        angles[f"{side}_arm_flexion"] += 45.0 * follow
        angles[f"{side}_elbow_flexion"] += 20.0 * follow
