"""Motions made by code, by name: actions on the spot, gaits, and stops within one frame.

Actions are tables of key angles (actions.toml, where the columns are explained), gaits follow published
normative joint-angle curves. Twists and turning walks end within one frame, as no body can: they set a
wide hem swinging and let it ring.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline, PchipInterpolator
from scipy.spatial.transform import Rotation

from snug.body.skeleton import JOINT, turn_joint
from snug.motion.motion import Motion, smoothstep
from snug.motion.posture import RATE, SIDED, SPINE_SHARES, STANDING, poses_from_angles, root_path

Frames = tuple[np.ndarray, np.ndarray]  # poses (T, 24, 3) [rad] and root translations (T, 3) [m]

LIBRARY_FPS = 30.0  # [1/s] at which motions are handed out
EVERY = round(RATE / LIBRARY_FPS)


def act(
    seconds: float,
    keys: Mapping[str, Sequence[Sequence[float]]],
    flights: Sequence[Sequence[float]] = (),
    cycles: int = 1,
) -> Frames:
    """Make an action of a table of keys, (time [s], angle [degrees]), repeated `cycles` times; at RATE.

    Between keys the angle is monotone (PCHIP: continuous slope, no overshoot), before the first and after
    the last it rests.
    """
    frames = round(seconds * cycles * RATE)
    within = (np.arange(frames) / RATE) % seconds
    angles: dict[str, np.ndarray] = {}
    for name, points in keys.items():
        at, degrees = np.array(points, dtype=float).T
        if len(points) == 1:
            values = np.full(frames, degrees[0])
        else:
            values = PchipInterpolator(at, degrees)(np.clip(within, at[0], at[-1]))
        sides = (f"left_{name}", f"right_{name}") if name in SIDED else (name,)
        angles |= {side: values for side in sides if side == name or side not in keys}
    poses = poses_from_angles(angles, frames)
    starts = seconds * np.arange(cycles)
    return poses, root_path(poses, [(s + start, s + end) for s in starts for start, end in flights])


START_SECONDS = 0.7  # from standing to the full stride
Curve = tuple[tuple[float, float], ...]  # (percent of the stride from that foot's contact, degrees)


@dataclass(frozen=True)
class Stride:
    """One stride: sagittal curves of a leg and the swing of pelvis, trunk and arms. Angles in degrees.

    rises: whether each foot comes down a step higher than the other.
    """

    seconds: float
    hip: Curve
    knee: Curve
    ankle: Curve
    toe_off: float  # percent of the stride; below 50 there is a flight phase
    pelvis_pitch: float
    pelvis_yaw: float  # amplitudes of the first harmonic
    pelvis_roll: float
    arm_mean: float
    arm_swing: float
    elbow_mean: float
    elbow_swing: float
    trunk_lean: float
    rises: bool = False


# Approximate values of the mean curves of D. A. Winter, The Biomechanics and Motor Control of Human Gait
# (University of Waterloo Press), natural cadence: 105 steps per minute. Ankle dorsiflexion is positive.
# Pelvis: Perry, Gait Analysis (1992), 5 degrees of rotation, 4 of obliquity. Arms: Murray et al.,
# Patterns of sagittal rotation of the upper limbs in walking, Physical Therapy 47 (1967), 32 degrees.
WALK = Stride(
    seconds=1.14,
    hip=((0, 21), (10, 17), (20, 9), (30, 0), (40, -7), (50, -11), (60, -6), (70, 8), (80, 18), (90, 22)),
    knee=((0, 4), (7, 13), (14, 20), (22, 18), (32, 11), (40, 8), (48, 11), (55, 23), (63, 50), (71, 64),
          (79, 54), (87, 27), (95, 3)),
    ankle=((0, 0), (7, -5), (15, 1), (25, 6), (35, 9), (45, 10), (52, 4), (58, -10), (64, -19), (72, -9),
           (80, 0), (90, 1)),
    toe_off=62.0, pelvis_pitch=2.0, pelvis_yaw=5.0, pelvis_roll=3.0,
    arm_mean=-7.0, arm_swing=18.0, elbow_mean=25.0, elbow_swing=10.0, trunk_lean=2.0,
)  # fmt: skip

# Approximate values of the curves for running in T. F. Novacheck, The biomechanics of running,
# Gait and Posture 7 (1998), about 3.2 m/s, and of its arm swing: elbows held near 90 degrees.
RUN = Stride(
    seconds=0.72,
    hip=((0, 38), (10, 34), (20, 19), (30, 4), (38, -5), (46, -4), (56, 16), (66, 42), (76, 56), (86, 53),
         (94, 43)),
    knee=((0, 21), (8, 36), (16, 43), (26, 32), (36, 19), (44, 31), (54, 70), (64, 93), (72, 91), (82, 58),
          (92, 23)),
    ankle=((0, 8), (8, 15), (18, 24), (26, 15), (34, -10), (41, -24), (50, -15), (62, 0), (75, 6), (90, 6)),
    toe_off=38.0, pelvis_pitch=8.0, pelvis_yaw=7.0, pelvis_roll=4.0,
    arm_mean=-5.0, arm_swing=34.0, elbow_mean=80.0, elbow_swing=15.0, trunk_lean=5.0,
)  # fmt: skip

# Approximate values of the mean curves of R. Riener, M. Rabuffetti and C. Frigo, Stair ascent and descent
# at different inclinations, Gait and Posture 15 (2002), at their middle inclination.
CLIMB = Stride(
    seconds=1.42,
    hip=((0, 52), (10, 46), (20, 36), (30, 24), (40, 14), (50, 7), (60, 9), (70, 30), (80, 53), (90, 60)),
    knee=((0, 62), (8, 61), (18, 50), (28, 34), (38, 20), (48, 11), (58, 20), (66, 55), (76, 88), (84, 92),
          (92, 78)),
    ankle=((0, 10), (10, 14), (20, 14), (32, 9), (44, 6), (54, -4), (63, -20), (72, -4), (82, 9), (92, 8)),
    toe_off=62.0, pelvis_pitch=8.0, pelvis_yaw=5.0, pelvis_roll=4.0,
    arm_mean=2.0, arm_swing=16.0, elbow_mean=35.0, elbow_swing=10.0, trunk_lean=8.0, rises=True,
)  # fmt: skip

STOP_SECONDS = 0.35  # from the full stride to standing


def gait(stride: Stride, seconds: float, pace: float = 1.0, stop: float | None = None) -> Frames:
    """Make a stride repeated for some seconds, at a share `pace` of its rate, braked from `stop` [s] on."""
    time = np.arange(round(seconds * RATE)) / RATE
    size = smoothstep(time / START_SECONDS)
    if stop is None:
        return gait_motion(stride, pace, size, {})
    size *= 1.0 - smoothstep((time - stop) / STOP_SECONDS)
    return gait_motion(stride, pace, size, _brake(time - stop))


def gait_motion(stride: Stride, pace: float, size: np.ndarray, added: Mapping[str, np.ndarray]) -> Frames:
    """Return poses and root translations of a gait, at RATE.

    pace: share of the stride's normal rate. size: (T,), 0 standing to 1 the full curves; the pace is in
    proportion. added: angles by name, (T,) [degrees], on top of those of the stride.
    """
    phase = np.cumsum(pace * size) / RATE / stride.seconds
    angles = gait_angles(stride, phase, size)
    for name, degrees in added.items():
        angles[name] += degrees
    poses = poses_from_angles(angles, len(size))
    # The trunk's mass evens out what the curves of the legs alone would do to the pelvis at each contact.
    path = root_path(
        poses, gait_flights(stride, phase, size), support=gait_support(phase, size),
        height_smoothing=0.045, speed_smoothing=0.08, rises=stride.rises,
    )  # fmt: skip
    return poses, path


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


def gait_angles(stride: Stride, phase: np.ndarray, size: np.ndarray) -> dict[str, np.ndarray]:
    """Return joint angles by name, (T,) [degrees].

    phase: (T,) [strides]. size: (T,), 0 standing to 1 the full curves.
    """
    swing = 2.0 * np.pi * phase
    angles = {
        "pelvis_pitch": np.full_like(phase, stride.pelvis_pitch),
        "pelvis_yaw": stride.pelvis_yaw * np.cos(swing),
        "pelvis_roll": stride.pelvis_roll * np.sin(swing),
        "trunk_flexion": np.full_like(phase, stride.trunk_lean),
        "trunk_bend": -0.8 * stride.pelvis_roll * np.sin(swing),
        # The chest turns against the pelvis, with the arms.
        "trunk_twist": -2.0 * stride.pelvis_yaw * np.cos(swing),
        "head_yaw": stride.pelvis_yaw * np.cos(swing),
        "head_pitch": np.full_like(phase, -stride.pelvis_pitch - stride.trunk_lean),
    }
    for side, offset, mirror in (("right", 0.0, -1.0), ("left", 0.5, 1.0)):
        at = (phase + offset) % 1.0
        hip, knee, ankle = (_periodic(curve, at) for curve in (stride.hip, stride.knee, stride.ankle))
        # Winter's and Novacheck's hip angle is measured from the upright; the pelvis carries the leg.
        angles[f"{side}_hip_flexion"] = hip + stride.pelvis_pitch
        angles[f"{side}_hip_abduction"] = 2.0 + mirror * stride.pelvis_roll * np.sin(swing)
        angles[f"{side}_knee_flexion"] = knee
        angles[f"{side}_foot_pitch"] = knee - hip - ankle
        forward = -np.cos(2.0 * np.pi * (at - 0.03))
        angles[f"{side}_arm_flexion"] = stride.arm_mean + stride.arm_swing * forward
        angles[f"{side}_elbow_flexion"] = stride.elbow_mean + stride.elbow_swing * forward
    return {name: STANDING[name] + size * (value - STANDING[name]) for name, value in angles.items()}


def gait_support(phase: np.ndarray, size: np.ndarray) -> np.ndarray:
    """Return the share of the load on the left and right foot, (T, 2): passed on while both are down."""
    at = phase % 1.0
    right = np.interp(at, (0.0, 0.10, 0.50, 0.60, 1.0), (0.0, 1.0, 1.0, 0.0, 0.0))
    right = 0.5 + size * (right - 0.5)
    return np.stack((1.0 - right, right), axis=1)


def gait_flights(stride: Stride, phase: np.ndarray, size: np.ndarray) -> list[tuple[float, float]]:
    """Return (start, end) [s] from each toe-off to the other foot's contact, where `size` is nearly 1."""
    time = np.arange(len(phase)) / RATE
    flights: list[tuple[float, float]] = []
    for step in np.arange(0.0, phase[-1] - 0.5, 0.5) if stride.toe_off < 50.0 else ():
        start, end = np.interp((step + stride.toe_off / 100.0, step + 0.5), phase, time)
        if np.interp((start, end), time, size).min() > 0.8:
            flights.append((float(start), float(end)))
    return flights


def _periodic(curve: Curve, at: np.ndarray) -> np.ndarray:
    percent, degrees = np.array([*curve, (100.0, curve[0][1])]).T
    return CubicSpline(percent / 100.0, degrees, bc_type="periodic")(at)


FROZEN_FRAMES = 36  # after the stop: over a second, in which a hem comes to rest
STANCE = {
    f"{side}_{name}": degrees
    for side in ("left", "right")
    for name, degrees in (
        ("hip_abduction", 9.0), ("knee_flexion", 10.0), ("hip_flexion", 6.0), ("arm_lowering", 34.0),
        ("arm_flexion", 12.0), ("elbow_flexion", 60.0))
}  # fmt: skip
ONSET = 0.5  # [s] from rest to the full swing


def twist(degrees: float, hertz: float, hips: float, stop: float) -> Frames:
    """Yaw the chest by `degrees` at `hertz`, the pelvis by the share `hips` of it, until `stop` [s].

    With hips = 1 the body turns as one piece, as on a turntable. At LIBRARY_FPS.
    """
    last = round(stop * LIBRARY_FPS)
    time = np.minimum(np.arange(last + 1 + FROZEN_FRAMES), last) / LIBRARY_FPS
    yaw = degrees * np.sin(2 * np.pi * hertz * time) * smoothstep(time / ONSET)
    poses = poses_from_angles(STANCE, len(time))
    shares = {"pelvis": hips} | {name: share * (1.0 - hips) for name, share in SPINE_SHARES}
    for name, share in shares.items():
        turn = Rotation.from_euler("y", (share * yaw)[:, None], degrees=True).as_matrix()
        turn_joint(poses, JOINT[name], turn)
    translations = np.zeros((len(time), 3))
    translations[:, 1] = root_path(poses[:2])[0, 1]
    return poses, translations


def turning_walk(degrees: float, hertz: float, pace: float, stop: float) -> Frames:
    """Walk with a heading that swings by `degrees` at `hertz`, at a pace, frozen after `stop` [s].

    At LIBRARY_FPS.
    """
    time = np.arange(round(stop * RATE) + 1) / RATE
    size = smoothstep(time / START_SECONDS)
    yaw = degrees * size * np.sin(2 * np.pi * hertz * time)
    poses, path = gait_motion(WALK, pace, size, {"pelvis_yaw": yaw})
    poses, path = poses[::EVERY], path[::EVERY]
    frozen = np.minimum(np.arange(len(poses) + FROZEN_FRAMES), len(poses) - 1)
    return poses[frozen], path[frozen] - path[0] * [1.0, 0.0, 1.0]


ACTIONS_FILE = Path(__file__).with_name("actions.toml")
# Signs, phases and amplitudes differ.
STOPS: dict[str, Callable[[], Frames]] = {
    "twist_1": partial(twist, -30.0, 0.7, 0.33, 1.6),
    "twist_2": partial(twist, 55.0, 0.8, 0.33, 2.1),
    "twist_3": partial(twist, -38.0, 1.3, 0.33, 1.5),
    "twist_4": partial(twist, 60.0, 0.6, 0.5, 1.9),
    "twist_5": partial(twist, -25.0, 1.6, 0.5, 1.3),
    "twist_6": partial(twist, 50.0, 1.15, 0.2, 1.6),
    "turntable_1": partial(twist, 35.0, 0.8, 1.0, 1.7),
    "turntable_2": partial(twist, -50.0, 0.65, 1.0, 2.2),
    "turntable_3": partial(twist, 28.0, 1.4, 1.0, 1.5),
    "turning_walk_1": partial(turning_walk, 25.0, 0.5, 1.0, 2.6),
    "turning_walk_2": partial(turning_walk, -40.0, 0.35, 0.85, 2.3),
    "turning_walk_3": partial(turning_walk, 15.0, 0.8, 1.2, 2.0),
    "turning_walk_4": partial(turning_walk, -30.0, 0.6, 1.1, 3.0),
    "twist_stop": partial(twist, 45.0, 1.0, 0.33, 1.9),
    "turning_stop": partial(turning_walk, 32.0, 0.45, 0.95, 2.4),
}
CURVES = "normative gait curves"
MADE: dict[str, tuple[str, str, Callable[[], Frames]]] = {  # kind, source, function
    **{
        name: (table.pop("kind"), "key angles", partial(act, **table))
        for name, table in tomllib.loads(ACTIONS_FILE.read_text(encoding="utf-8")).items()
    },
    "walk": ("walk", CURVES, partial(gait, WALK, 4.0)),
    "brisk_walk": ("walk", CURVES, partial(gait, WALK, 3.0, pace=1.25)),
    "run": ("run", CURVES, partial(gait, RUN, 3.0)),
    "sudden_stop": ("sudden stop", CURVES, partial(gait, RUN, 3.0, pace=0.9, stop=1.53)),
    "climbing_steps": ("climbing steps", CURVES, partial(gait, CLIMB, 2.4)),
    **{name: ("stop", "stops within a frame", make) for name, make in STOPS.items()},
}


def make_clip(name: str) -> Motion:
    """Make the library's motion of that name, arms as in its tables. Raises KeyError."""
    kind, source, make = MADE[name]
    poses, path = make()
    if name not in STOPS:
        path[:, [0, 2]] -= path[0, [0, 2]]
        poses, path = poses[::EVERY], path[::EVERY]
    return Motion(name, poses, path, LIBRARY_FPS, kind, f"embedded library: {source}")
