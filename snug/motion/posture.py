"""Poses from clinical joint angles, and root paths from poses.

Angles are in degrees and named as in gait analysis: flexion moves a limb forward, abduction away from the
midline. Both legs and arms have the same names with `left_` or `right_` in front.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation

from snug.body.skeleton import JOINT, axis_angles, sole_points

# Standing at ease. Arms hang 68 degrees below the horizontal; spread_arms lifts them clear of the torso.
SIDED = {
    "hip_flexion": 2.0, "hip_abduction": 3.0, "hip_rotation": 5.0, "knee_flexion": 4.0, "foot_pitch": 0.0,
    "arm_lowering": 68.0, "arm_flexion": 0.0, "elbow_flexion": 15.0,
}  # fmt: skip
CENTRAL = (
    "pelvis_pitch", "pelvis_roll", "pelvis_yaw", "trunk_flexion", "trunk_bend", "trunk_twist", "head_pitch",
    "head_yaw",
)  # fmt: skip
STANDING = dict.fromkeys(CENTRAL, 0.0) | {
    f"{side}_{name}": value for side in ("left", "right") for name, value in SIDED.items()
}

# Share of trunk flexion, bending and twist that each spine joint takes: the chest twists most.
SPINE_SHARES = (("spine1", 0.3), ("spine2", 0.3), ("spine3", 0.4))
# Foot to shank, passive range; beyond it the heel comes off the floor instead.
ANKLE_RANGE = (-55.0, 30.0)
RATE = 120.0  # [1/s] at which motions are built
# Muscles do not start at once: standard deviation of the Gaussian over all angles.
SMOOTHING = 0.03  # [s]
FREE_FALL = 9.81  # [m/s^2]
CONTACT_DEPTH = 0.01  # [m] above the lowest sole point, where one carries 1/e of its weight


def poses_from_angles(angles: Mapping[str, np.ndarray | float], frames: int) -> np.ndarray:
    """Return poses (frames, 24, 3) [rad] of angles by name, (frames,) [degrees].

    Absent names stand at ease.
    """
    assert angles.keys() <= STANDING.keys(), "no such joint angle"
    a = {name: np.broadcast_to(angles.get(name, value), frames) for name, value in STANDING.items()}
    a = {name: gaussian_filter1d(values, SMOOTHING * RATE, mode="nearest") for name, values in a.items()}
    poses = np.zeros((frames, 24, 3))

    def turn(joint: str, *axes_and_degrees: tuple[str, np.ndarray]) -> None:
        rotation = Rotation.identity(frames)
        for axis, degrees in axes_and_degrees:
            rotation = rotation * Rotation.from_euler(axis, degrees[:, None], degrees=True)
        poses[:, JOINT[joint]] = axis_angles(rotation.as_matrix())

    turn("pelvis", ("y", a["pelvis_yaw"]), ("x", a["pelvis_pitch"]), ("z", -a["pelvis_roll"]))
    for joint, share in SPINE_SHARES:
        twist, flexion, bend = a["trunk_twist"], a["trunk_flexion"], a["trunk_bend"]
        turn(joint, ("y", share * twist), ("x", share * flexion), ("z", -share * bend))
    for joint in ("neck", "head"):
        turn(joint, ("y", 0.5 * a["head_yaw"]), ("x", 0.5 * a["head_pitch"]))
    # The left limbs turn the other way round the y and z axes; x is the mirror's normal.
    for side, mirror in (("left", 1.0), ("right", -1.0)):
        s = {name: a[f"{side}_{name}"] for name in SIDED}
        abduction, rotation = mirror * s["hip_abduction"], mirror * s["hip_rotation"]
        turn(f"{side}_hip", ("x", -s["hip_flexion"]), ("z", abduction), ("y", rotation))
        turn(f"{side}_knee", ("x", s["knee_flexion"]))
        level = a["pelvis_pitch"] - s["hip_flexion"] + s["knee_flexion"]
        ankle = np.clip(level - s["foot_pitch"], *ANKLE_RANGE)
        turn(f"{side}_ankle", ("x", -ankle))
        turn(f"{side}_foot", ("x", -0.7 * np.clip(level - ankle, 0.0, 45.0)))
        turn(f"{side}_shoulder", ("x", -s["arm_flexion"]), ("z", -mirror * s["arm_lowering"]))
        turn(f"{side}_elbow", ("y", -mirror * s["elbow_flexion"]))
    return poses


def root_path(
    poses: np.ndarray,
    flights: Sequence[tuple[float, float]] = (),
    *,
    support: np.ndarray | None = None,
    height_smoothing: float = 0.015,
    speed_smoothing: float = 0.06,
    rises: bool = False,
) -> np.ndarray:
    """Return root translations (T, 3) [m] of poses (T, 24, 3) at RATE whose standing foot stays in place.

    Height: the lowest sole point is on the floor; in a flight the pelvis follows the parabola of free
    fall between its heights at take-off and landing. Forward and sideways: the sole points that carry the
    body do not move over the floor; in a flight the speed goes over from one to the other. Gaussians
    smooth both.

    Args:
        poses: (T, 24, 3) [rad] at RATE.
        flights: (start, end) [s] of each.
        support: (T, 2) shares in [0, 1] of the left and right foot where they are known (a swinging foot
            may come as low as the standing one); else the lowest points carry.
        height_smoothing: [s].
        speed_smoothing: [s].
        rises: the floor is steps: the height, too, is such that the carrying points stay.
    """
    soles = sole_points(poses, np.zeros((len(poses), 3)))
    weights = np.exp((soles[..., 1].min(axis=1, keepdims=True) - soles[..., 1]) / CONTACT_DEPTH)
    if support is not None:
        weights *= np.repeat(support, 3, axis=1)
    weights /= weights.sum(axis=1, keepdims=True)
    # The weighted height is above the lowest point by about a millimetre per shared contact, and smooth.
    height = -(weights * soles[..., 1]).sum(axis=1)
    velocity = -(weights[..., None] * np.gradient(soles, 1.0 / RATE, axis=0)).sum(axis=1)
    if rises:
        height = height[0] + np.cumsum(velocity[:, 1]) / RATE
    velocity = velocity[:, ::2]
    time = np.arange(len(poses)) / RATE
    for start, end in flights:
        inside = (time > start) & (time < end)
        flight = time[inside]
        line = np.interp(flight, (start, end), np.interp((start, end), time, height))
        height[inside] = line + 0.5 * FREE_FALL * (flight - start) * (end - flight)
        for axis in (0, 1):
            ends = np.interp((start, end), time, velocity[:, axis])
            velocity[inside, axis] = np.interp(flight, (start, end), ends)
    velocity = gaussian_filter1d(velocity, speed_smoothing * RATE, axis=0, mode="nearest")
    height = gaussian_filter1d(height, height_smoothing * RATE, mode="nearest")
    path = np.zeros((len(poses), 3))
    path[1:, ::2] = np.cumsum(0.5 * (velocity[1:] + velocity[:-1]), axis=0) / RATE
    path[:, 1] = height
    return path
