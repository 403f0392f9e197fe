"""Turn the tables and curves of the embedded library into poses and root translations at 30 fps."""

from __future__ import annotations

import numpy as np

from snug.motion.clips import actions, unseen
from snug.motion.clips.posture import LIBRARY_FPS, RATE, poses_from_angles, root_path
from snug.motion.clips.walks import RUN, START_SECONDS, STOPS, WALK, Stride, gait_motion
from snug.motion.motion import Motion, smoothstep

ACTIONS = {**actions.ACTIONS, **actions.STRIKES, **unseen.ACTIONS}
# name: (kind, stride, seconds, pace as a share of the stride's normal rate, time at which it stops or None)
GAITS: dict[str, tuple[str, Stride, float, float, float | None]] = {
    "walk": ("walk", WALK, 4.0, 1.0, None),
    "brisk_walk": ("walk", WALK, 3.0, 1.25, None),
    "run": ("run", RUN, 3.0, 1.0, None),
    "sudden_stop": ("sudden stop", RUN, 3.0, 0.9, 1.53),
    "climbing_steps": ("climbing steps", unseen.CLIMB, 2.4, 1.0, None),
}
STOP_SECONDS = 0.35  # from the full stride to standing


def make_clip(name: str) -> Motion:
    """Make the library's motion of that name, arms as in its tables. Raises KeyError for an unknown name."""
    if name in STOPS:
        return Motion(
            name, *STOPS[name].motion(), LIBRARY_FPS, "stop", "embedded library: stops within a frame"
        )
    if name in ACTIONS:
        action = ACTIONS[name]
        kind, source = action.kind, "embedded library: key angles"
        angles, flights = action.angles()
        poses = poses_from_angles(angles, action.frames)
        path = root_path(poses, flights)
    else:
        kind, stride, seconds, pace, stop = GAITS[name]
        source = "embedded library: normative gait curves"
        time = np.arange(round(seconds * RATE)) / RATE
        size = smoothstep(time / START_SECONDS)
        if stop is not None:
            size *= 1.0 - smoothstep((time - stop) / STOP_SECONDS)
        poses, path = gait_motion(stride, pace, size, {} if stop is None else _brake(time - stop))
    path[:, [0, 2]] -= path[0, [0, 2]]
    every = round(RATE / LIBRARY_FPS)
    return Motion(name, poses[::every], path[::every], LIBRARY_FPS, kind, source)


def _brake(since: np.ndarray) -> dict[str, np.ndarray]:
    """Return angles (T,) [degrees] to add `since` (T,) [s] the stop, by name.

    Knees give way, the trunk tips forward and comes back, the arms fly forward.
    """
    give = smoothstep(since / 0.3) * (1.0 - smoothstep((since - 0.4) / 0.7))
    follow = smoothstep((since - 0.05) / 0.25) * (1.0 - smoothstep((since - 0.3) / 0.6))
    added = {"pelvis_pitch": 10.0 * give, "trunk_flexion": 20.0 * follow, "head_pitch": -22.0 * follow}
    for side in ("left", "right"):
        added[f"{side}_hip_flexion"] = 48.0 * give
        added[f"{side}_knee_flexion"] = 58.0 * give
        added[f"{side}_arm_flexion"] = 45.0 * follow
        added[f"{side}_elbow_flexion"] = 20.0 * follow
    return added
