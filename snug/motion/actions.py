"""Motions made by code at 30 fps: actions on the spot, tables of key angles joined smoothly; gaits and stops.

A key is (time [s], angle [degrees]). Names without a side move both limbs; `left_` and `right_` move one.
Between keys the angle is monotone (PCHIP: continuous slope, no overshoot), before the first and after the
last it rests. Feet stay level with the floor unless foot_pitch says otherwise (positive: on tiptoe).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import PchipInterpolator

from snug.motion.motion import Motion
from snug.motion.posture import LIBRARY_FPS, RATE, SIDED, poses_from_angles, root_path
from snug.motion.walks import GAITS, STOPS

Keys = tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class Action:
    """A table of keys; with a period the table is one cycle and is repeated `cycles` times.

    flights: (take-off, landing) [s] within one cycle.
    """

    kind: str
    seconds: float
    keys: dict[str, Keys]
    flights: tuple[tuple[float, float], ...] = ()
    cycles: int = 1

    @property
    def frames(self) -> int:
        """Number of frames at RATE."""
        return round(self.seconds * self.cycles * RATE)

    def angles(self) -> tuple[dict[str, np.ndarray], list[tuple[float, float]]]:
        """Return angles by name, (T,) [degrees] at RATE, and the flights [s]."""
        within = (np.arange(self.frames) / RATE) % self.seconds
        angles = {}
        for name, keys in self.keys.items():
            at, degrees = np.array(keys, dtype=float).T
            if len(keys) == 1:
                values = np.full(self.frames, degrees[0])
            else:
                values = PchipInterpolator(at, degrees)(np.clip(within, at[0], at[-1]))
            sided = name in SIDED
            for full_name in (f"left_{name}", f"right_{name}") if sided else (name,):
                if not (sided and full_name in self.keys):
                    angles[full_name] = values
        starts = self.seconds * np.arange(self.cycles)
        return angles, [(s + start, s + end) for s in starts for start, end in self.flights]


ARM = SIDED["arm_lowering"]  # hanging at ease
ACTIONS: dict[str, Action] = {}

# fmt: off
ACTIONS["jump"] = Action(
    kind="jump", seconds=2.6,
    flights=((0.92, 1.40),),
    keys={
        "hip_flexion": ((0.2, 2), (0.62, 78), (0.70, 78), (0.92, 0), (1.12, 14), (1.36, 18), (1.62, 62),
                        (2.2, 2)),
        "knee_flexion": ((0.2, 4), (0.62, 88), (0.70, 88), (0.92, 4), (1.12, 18), (1.36, 14), (1.62, 78),
                         (2.2, 4)),
        "foot_pitch": ((0.72, 0), (0.92, 48), (1.15, 30), (1.38, 14), (1.48, 0)),
        "pelvis_pitch": ((0.2, 0), (0.62, 26), (0.70, 26), (0.92, 2), (1.36, 4), (1.62, 20), (2.2, 0)),
        "trunk_flexion": ((0.2, 0), (0.62, 20), (0.70, 20), (0.92, -4), (1.36, 3), (1.62, 16), (2.2, 0)),
        "head_pitch": ((0.2, 0), (0.62, -28), (0.70, -28), (0.92, -4), (1.62, -22), (2.2, 0)),
        "arm_flexion": ((0.1, 0), (0.55, -42), (0.66, -42), (0.98, 92), (1.15, 95), (1.55, 25), (2.2, 0)),
        "elbow_flexion": ((0.2, 15), (0.66, 22), (0.98, 35), (1.55, 30), (2.2, 15)),
    },
)

# Half a turn in the air; the arms wind up against it first.
ACTIONS["spin_jump"] = Action(
    kind="spin jump", seconds=2.8,
    flights=((0.95, 1.43),),
    keys={
        "pelvis_yaw": ((0.25, 0), (0.66, -16), (0.72, -16), (0.95, 22), (1.43, 172), (1.75, 180)),
        "trunk_twist": ((0.25, 0), (0.66, -30), (0.72, -30), (1.02, 30), (1.43, 14), (1.72, -8), (2.3, 0)),
        "head_yaw": ((0.25, 0), (0.66, 14), (1.05, 30), (1.5, 0)),
        "hip_flexion": ((0.25, 2), (0.64, 70), (0.74, 70), (0.95, 0), (1.15, 22), (1.40, 22), (1.66, 66),
                        (2.3, 2)),
        "knee_flexion": ((0.25, 4), (0.64, 82), (0.74, 82), (0.95, 4), (1.15, 36), (1.40, 18), (1.66, 82),
                         (2.3, 4)),
        "hip_abduction": ((0.95, 3), (1.43, 8), (2.3, 6)),
        "foot_pitch": ((0.76, 0), (0.95, 46), (1.18, 32), (1.41, 14), (1.51, 0)),
        "pelvis_pitch": ((0.25, 0), (0.64, 22), (0.74, 22), (0.95, 0), (1.40, 2), (1.66, 20), (2.3, 0)),
        "trunk_flexion": ((0.25, 0), (0.64, 16), (0.74, 16), (0.95, -2), (1.40, 2), (1.66, 14), (2.3, 0)),
        "head_pitch": ((0.25, 0), (0.70, -18), (0.95, 0), (1.66, -18), (2.3, 0)),
        "arm_lowering": ((0.2, ARM), (0.66, 45), (1.0, 35), (1.25, 50), (1.6, 28), (2.3, ARM)),
        "left_arm_flexion": ((0.2, 0), (0.66, 35), (1.0, -25), (1.4, 20), (2.3, 0)),
        "right_arm_flexion": ((0.2, 0), (0.66, -35), (1.0, 45), (1.4, 20), (2.3, 0)),
        "elbow_flexion": ((0.2, 15), (0.66, 40), (1.2, 70), (1.6, 40), (2.3, 15)),
    },
)

ACTIONS["jumping_jack"] = Action(
    kind="jumping jack", seconds=1.1,
    cycles=3,
    flights=((0.22, 0.46), (0.74, 0.98)),
    keys={
        "hip_abduction": ((0.20, 3), (0.48, 22), (0.72, 22), (1.0, 3)),
        "arm_lowering": ((0.12, ARM), (0.52, -38), (0.66, -38), (1.04, ARM)),
        "arm_flexion": ((0.12, 0), (0.35, 12), (0.6, 8), (0.85, 12), (1.04, 0)),
        "elbow_flexion": ((0.0, 15), (0.55, 22), (1.1, 15)),
        "hip_flexion": ((0, 8), (0.10, 20), (0.22, 4), (0.42, 6), (0.58, 20), (0.74, 4), (0.94, 6), (1.1, 8)),
        "knee_flexion": ((0, 14), (0.10, 38), (0.22, 6), (0.42, 10), (0.58, 38), (0.74, 6), (0.94, 10),
                         (1.1, 14)),
        "foot_pitch": ((0.10, 0), (0.22, 34), (0.46, 20), (0.58, 0), (0.74, 34), (0.98, 20), (1.08, 0)),
        "trunk_flexion": ((0, 2), (0.10, 7), (0.25, 0), (0.58, 7), (0.78, 0), (1.1, 2)),
    },
)

ACTIONS["squat"] = Action(
    kind="squat", seconds=2.0,
    cycles=2,
    keys={
        "hip_flexion": ((0.1, 2), (0.85, 105), (1.05, 105), (1.7, 2)),
        "knee_flexion": ((0.1, 4), (0.85, 108), (1.05, 108), (1.7, 4)),
        "hip_abduction": ((0.1, 6), (0.85, 14), (1.05, 14), (1.7, 6)),
        "hip_rotation": ((0.0, 12),),
        "pelvis_pitch": ((0.1, 0), (0.85, 26), (1.05, 26), (1.7, 0)),
        "trunk_flexion": ((0.1, 0), (0.85, 14), (1.05, 14), (1.7, 0)),
        "head_pitch": ((0.1, 0), (0.85, -28), (1.05, -28), (1.7, 0)),
        "arm_flexion": ((0.1, 0), (0.8, 85), (1.05, 85), (1.7, 0)),
        "elbow_flexion": ((0.1, 15), (0.85, 8), (1.05, 8), (1.7, 15)),
    },
)

# Both to the side and up; then the left and the right to the front in turn.
ACTIONS["arm_raise"] = Action(
    kind="arm raise", seconds=4.0,
    keys={
        "arm_lowering": ((0.1, ARM), (0.75, -36), (0.95, -36), (1.6, ARM)),
        "left_arm_flexion": ((1.7, 0), (2.3, 118), (2.5, 118), (2.95, 0)),
        "right_arm_flexion": ((2.55, 0), (3.1, 118), (3.25, 118), (3.75, 0)),
        "trunk_flexion": ((0.1, 0), (0.85, -5), (1.6, 0), (2.4, -3), (3.2, -3), (3.8, 0)),
        "trunk_bend": ((1.7, 0), (2.4, -4), (3.1, 4), (3.8, 0)),
    },
)

# Upper arms level, forearms turning: small fast circles of the whole arm.
ACTIONS["arm_circle"] = Action(
    kind="arm raise", seconds=3.0,
    keys={
        "arm_lowering": ((0.1, ARM), (0.5, 12), (0.75, -18), (1.0, 12), (1.25, 38), (1.5, 12), (1.75, -18),
                         (2.0, 12), (2.25, 38), (2.7, ARM)),
        "arm_flexion": ((0.3, 0), (0.5, 28), (0.75, 0), (1.0, -28), (1.25, 0), (1.5, 28), (1.75, 0),
                        (2.0, -28), (2.3, 0)),
        "elbow_flexion": ((0.1, 15), (0.5, 20), (2.3, 20), (2.7, 15)),
    },
)

ACTIONS["torso_twist"] = Action(
    kind="torso twist", seconds=1.6,
    cycles=2,
    keys={
        "trunk_twist": ((0, 0), (0.4, 42), (0.5, 42), (1.1, -42), (1.2, -42), (1.6, 0)),
        "pelvis_yaw": ((0, 0), (0.4, 14), (0.5, 14), (1.1, -14), (1.2, -14), (1.6, 0)),
        "head_yaw": ((0, 0), (0.42, 18), (1.12, -18), (1.6, 0)),
        "arm_lowering": ((0, 34),),
        "arm_flexion": ((0, 12),),
        "elbow_flexion": ((0, 75),),
        "hip_abduction": ((0, 9),),
        "knee_flexion": ((0, 10),),
        "hip_flexion": ((0, 6),),
    },
)

ACTIONS["side_bend"] = Action(
    kind="side bend", seconds=3.4,
    keys={
        "trunk_bend": ((0.1, 0), (0.85, 34), (1.0, 34), (2.1, -34), (2.3, -34), (3.1, 0)),
        "pelvis_roll": ((0.1, 0), (0.85, 7), (1.0, 7), (2.1, -7), (2.3, -7), (3.1, 0)),
        "left_hip_abduction": ((0.1, 8), (0.85, 15), (1.0, 15), (2.1, 1), (2.3, 1), (3.1, 8)),
        "right_hip_abduction": ((0.1, 8), (0.85, 1), (1.0, 1), (2.1, 15), (2.3, 15), (3.1, 8)),
        # The arm on the bent side is held off the hip.
        "right_arm_lowering": ((0.1, ARM), (0.85, -40), (1.0, -40), (2.1, 42), (2.3, 42), (3.1, ARM)),
        "left_arm_lowering": ((0.1, ARM), (0.85, 42), (1.0, 42), (2.1, -40), (2.3, -40), (3.1, ARM)),
        "elbow_flexion": ((0, 15),),
    },
)

ACTIONS["bow"] = Action(
    kind="bow", seconds=3.0,
    keys={
        "pelvis_pitch": ((0.1, 0), (1.0, 48), (1.4, 48), (2.4, 0)),
        "hip_flexion": ((0.1, 2), (1.0, 58), (1.4, 58), (2.4, 2)),
        "knee_flexion": ((0.1, 4), (1.0, 12), (1.4, 12), (2.4, 4)),
        "trunk_flexion": ((0.1, 0), (1.0, 38), (1.4, 38), (2.4, 0)),
        "head_pitch": ((0.1, 0), (1.0, 12), (1.4, 12), (2.3, 0)),
        "arm_flexion": ((0.1, 0), (1.1, 52), (1.5, 52), (2.5, 0)),
    },
)

ACTIONS["lunge"] = Action(
    kind="lunge", seconds=3.0,
    keys={
        "left_hip_flexion": ((0.1, 2), (0.45, 62), (0.9, 72), (1.5, 72), (1.95, 50), (2.5, 2)),
        "left_knee_flexion": ((0.1, 4), (0.45, 60), (0.9, 84), (1.5, 84), (1.95, 62), (2.5, 4)),
        "right_hip_flexion": ((0.2, 2), (0.9, -18), (1.5, -18), (2.4, 2)),
        "right_knee_flexion": ((0.2, 4), (0.9, 53), (1.5, 53), (2.4, 4)),
        "right_foot_pitch": ((0.3, 0), (0.9, 50), (1.5, 50), (2.2, 0)),
        "hip_rotation": ((0, 5), (0.5, 0), (2.2, 0), (2.6, 5)),
        "trunk_twist": ((0.3, 0), (0.9, 0), (1.2, 32), (1.5, 0), (2.5, 0)),
        "trunk_flexion": ((0.1, 0), (0.9, 6), (1.5, 6), (2.5, 0)),
        "arm_lowering": ((0.2, ARM), (0.9, 45), (1.6, 45), (2.4, ARM)),
        "arm_flexion": ((0.2, 0), (0.9, 30), (1.6, 30), (2.4, 0)),
        "elbow_flexion": ((0.2, 15), (0.9, 70), (1.6, 70), (2.4, 15)),
    },
)


# A front kick with the right leg: chamber, extension, recoil; the arms keep the balance.
ACTIONS["kick"] = Action(
    kind="kick", seconds=2.6,
    keys={
        "right_hip_flexion": ((0.1, 2), (0.42, -14), (0.50, -14), (0.80, 82), (0.95, 96), (1.15, 70),
                              (1.6, 2)),
        "right_knee_flexion": ((0.1, 4), (0.42, 26), (0.70, 98), (0.78, 98), (0.97, 8), (1.2, 80), (1.6, 4)),
        "right_foot_pitch": ((0.1, 0), (0.45, 34), (0.75, 30), (0.95, -40), (1.2, 20), (1.6, 0)),
        "left_hip_flexion": ((0.1, 2), (0.5, 10), (0.9, 4), (1.3, 8), (2.0, 2)),
        "left_knee_flexion": ((0.1, 4), (0.5, 16), (0.9, 10), (1.3, 16), (2.0, 4)),
        "pelvis_pitch": ((0.1, 0), (0.45, 6), (0.95, -18), (1.5, 3), (2.0, 0)),
        "pelvis_yaw": ((0.1, 0), (0.45, -12), (0.95, 16), (1.6, 0)),
        "trunk_flexion": ((0.1, 0), (0.45, -2), (0.95, 20), (1.5, 8), (2.0, 0)),
        "trunk_twist": ((0.1, 0), (0.45, 12), (0.95, -26), (1.6, 0)),
        "arm_lowering": ((0.1, ARM), (0.45, 42), (1.2, 40), (2.0, ARM)),
        "left_arm_flexion": ((0.1, 0), (0.45, -15), (0.95, 52), (1.6, 0)),
        "right_arm_flexion": ((0.1, 0), (0.45, 30), (0.95, -36), (1.6, 0)),
        "elbow_flexion": ((0.1, 15), (0.45, 60), (1.2, 55), (2.0, 15)),
    },
)

# From a guard: left jab, right cross with the hips behind it, left jab.
ACTIONS["punch"] = Action(
    kind="punch", seconds=2.8,
    keys={
        "arm_lowering": ((0, 56),),
        "left_arm_flexion": ((0.3, 32), (0.52, 88), (0.60, 88), (0.9, 32), (1.6, 32), (1.82, 88), (1.90, 88),
                             (2.25, 32)),
        "left_elbow_flexion": ((0.3, 112), (0.52, 10), (0.60, 10), (0.9, 112), (1.6, 112), (1.82, 10),
                               (1.90, 10), (2.25, 112)),
        "right_arm_flexion": ((0.9, 30), (1.18, 90), (1.26, 90), (1.6, 30)),
        "right_elbow_flexion": ((0.9, 112), (1.18, 8), (1.26, 8), (1.6, 112)),
        "trunk_twist": ((0.25, 6), (0.52, -20), (0.62, -20), (0.90, -14), (1.18, 38), (1.28, 38), (1.6, 8),
                        (1.82, -20), (2.3, 6)),
        "pelvis_yaw": ((0.25, -8), (0.52, -16), (0.90, -14), (1.18, 24), (1.28, 24), (1.6, -4), (1.82, -16),
                       (2.3, -8)),
        "head_yaw": ((0.25, 2), (0.52, 30), (0.90, 24), (1.18, -46), (1.28, -46), (1.6, -2), (1.82, 30),
                     (2.3, 2)),
        "trunk_flexion": ((0, 10),),
        "pelvis_pitch": ((0, 6),),
        "left_hip_flexion": ((0, 30),),
        "left_knee_flexion": ((0, 26),),
        "right_hip_flexion": ((0, -2),),
        "right_knee_flexion": ((0.9, 20), (1.18, 28), (1.6, 20)),
        "right_foot_pitch": ((0.9, 16), (1.18, 34), (1.6, 16)),
        "hip_abduction": ((0, 8),),
    },
)

# Half a turn to the left in four quick steps on the spot.
ACTIONS["turn"] = Action(
    kind="turn", seconds=2.4,
    keys={
        "pelvis_yaw": ((0.25, 0), (0.55, 42), (0.85, 88), (1.15, 134), (1.5, 178), (1.7, 180)),
        "trunk_twist": ((0.1, 0), (0.4, 22), (1.1, 18), (1.6, -8), (2.0, 0)),
        "head_yaw": ((0.05, 0), (0.35, 38), (1.1, 26), (1.6, 0)),
        "left_hip_flexion": ((0.2, 2), (0.36, 30), (0.55, 4), (0.82, 4), (0.98, 30), (1.15, 2)),
        "left_knee_flexion": ((0.2, 4), (0.36, 56), (0.55, 8), (0.82, 8), (0.98, 56), (1.15, 4)),
        "right_hip_flexion": ((0.52, 2), (0.68, 30), (0.85, 4), (1.14, 4), (1.32, 30), (1.5, 2)),
        "right_knee_flexion": ((0.52, 4), (0.68, 56), (0.85, 8), (1.14, 8), (1.32, 56), (1.5, 4)),
        "left_hip_rotation": ((0.15, 5), (0.4, 30), (0.6, 5)),
        "arm_lowering": ((0.1, ARM), (0.5, 54), (1.4, 54), (2.1, ARM)),
        "left_arm_flexion": ((0.1, 0), (0.45, -28), (0.9, 12), (1.3, -12), (1.8, 0)),
        "right_arm_flexion": ((0.1, 0), (0.45, 32), (0.9, -8), (1.3, 16), (1.8, 0)),
        "elbow_flexion": ((0.1, 15), (0.5, 45), (1.4, 40), (2.1, 15)),
    },
)

# Side steps to the left: the left leg opens, the right one closes.
ACTIONS["sidestep"] = Action(
    kind="sidestep", seconds=0.9,
    cycles=4,
    keys={
        "left_hip_abduction": ((0, 3), (0.20, 22), (0.38, 19), (0.80, 3), (0.9, 3)),
        "right_hip_abduction": ((0, 3), (0.20, 16), (0.42, 24), (0.62, 18), (0.82, 3), (0.9, 3)),
        "left_hip_flexion": ((0, 8), (0.18, 26), (0.38, 18), (0.66, 12), (0.9, 8)),
        "left_knee_flexion": ((0, 14), (0.18, 46), (0.38, 26), (0.66, 18), (0.9, 14)),
        "right_hip_flexion": ((0, 8), (0.30, 12), (0.58, 28), (0.82, 12), (0.9, 8)),
        "right_knee_flexion": ((0, 14), (0.30, 16), (0.58, 54), (0.82, 24), (0.9, 14)),
        "pelvis_roll": ((0, 0), (0.25, -4), (0.6, 4), (0.9, 0)),
        "trunk_bend": ((0, 0), (0.25, 6), (0.6, -5), (0.9, 0)),
        "trunk_flexion": ((0, 6),),
        "arm_lowering": ((0, 56), (0.4, 36), (0.9, 56)),
        "arm_flexion": ((0, 10), (0.4, 16), (0.9, 10)),
        "elbow_flexion": ((0, 45), (0.4, 30), (0.9, 45)),
    },
)

# Of kinds that no training motion has, to test with (docs/protocol.md): nobody chooses a recipe by them.

# Pushed at the right shoulder from behind: the trunk is turned and thrown forward, the arms fly out, the left
# foot is caught up with in a long step, the right one in a short one.
ACTIONS["push_recovery"] = Action(
    kind="push recovery", seconds=2.4,
    keys={
        "pelvis_pitch": ((0.30, 0), (0.52, 14), (0.80, 20), (1.15, 12), (1.8, 0)),
        "pelvis_roll": ((0.30, 0), (0.55, 6), (1.0, 3), (1.6, 0)),
        "pelvis_yaw": ((0.30, 0), (0.55, 18), (1.0, 10), (1.8, 0)),
        "trunk_flexion": ((0.28, 0), (0.42, -14), (0.72, 24), (1.0, 22), (1.7, 0)),
        "trunk_twist": ((0.28, 0), (0.45, 30), (0.85, -12), (1.3, 4), (1.8, 0)),
        "trunk_bend": ((0.30, 0), (0.48, 10), (0.9, -8), (1.6, 0)),
        "head_pitch": ((0.28, 0), (0.42, 14), (0.75, -26), (1.7, 0)),
        "left_hip_flexion": ((0.34, 2), (0.62, 62), (0.82, 58), (1.15, 56), (1.75, 2)),
        "left_knee_flexion": ((0.34, 4), (0.56, 62), (0.80, 32), (1.05, 58), (1.75, 4)),
        "right_hip_flexion": ((0.34, 2), (0.60, -8), (0.85, -16), (1.05, 2), (1.32, 48), (1.75, 2)),
        "right_knee_flexion": ((0.34, 4), (0.60, 14), (0.85, 32), (1.32, 72), (1.75, 4)),
        "right_foot_pitch": ((0.55, 0), (0.85, 46), (1.25, 30), (1.65, 0)),
        "hip_abduction": ((0.34, 3), (0.75, 9), (1.75, 3)),
        "arm_lowering": ((0.32, ARM), (0.58, 22), (0.95, 30), (1.9, ARM)),
        "left_arm_flexion": ((0.30, 0), (0.48, -34), (0.80, 56), (1.3, 14), (1.9, 0)),
        "right_arm_flexion": ((0.30, 0), (0.48, 36), (0.80, -22), (1.2, 32), (1.9, 0)),
        "elbow_flexion": ((0.30, 15), (0.60, 52), (1.1, 40), (1.9, 15)),
    },
)

# A whole turn on the left foot, the right one drawn up to the knee; the arms open, close in front of the
# chest, rise, and open again as the turn ends.
ACTIONS["dance_turn"] = Action(
    kind="dance turn", seconds=2.6,
    keys={
        "pelvis_yaw": ((0.20, 0), (0.62, -24), (0.72, -24), (1.00, 60), (1.70, 330), (1.92, 360)),
        "pelvis_roll": ((0.62, 0), (1.0, 4), (1.6, 4), (1.9, 0)),
        "trunk_twist": ((0.20, 0), (0.62, -26), (0.72, -26), (1.02, 22), (1.65, 6), (1.92, -14), (2.3, 0)),
        "trunk_bend": ((0.9, 0), (1.3, -9), (1.85, 7), (2.4, 0)),
        "trunk_flexion": ((0.62, 4), (1.1, -6), (1.8, -8), (2.5, 0)),
        "head_yaw": ((0.20, 0), (0.62, 34), (0.95, -30), (1.30, 34), (1.8, 6), (2.1, 0)),
        "left_hip_flexion": ((0.20, 2), (0.62, 30), (0.72, 30), (1.0, 2), (1.8, 4), (2.0, 16), (2.5, 2)),
        "left_knee_flexion": ((0.20, 4), (0.62, 46), (0.72, 46), (1.0, 4), (1.8, 8), (2.0, 28), (2.5, 4)),
        "left_foot_pitch": ((0.74, 0), (1.0, 36), (1.7, 34), (1.95, 0)),
        "right_hip_flexion": ((0.20, 2), (0.62, 24), (0.74, 24), (1.05, 66), (1.6, 64), (1.95, 8), (2.4, 2)),
        "right_knee_flexion": ((0.20, 4), (0.62, 40), (0.74, 40), (1.05, 108), (1.6, 104), (1.95, 22),
                               (2.4, 4)),
        "right_hip_abduction": ((0.62, 6), (1.05, 30), (1.6, 30), (1.95, 12), (2.4, 6)),
        "right_hip_rotation": ((0.62, 10), (1.05, 32), (1.6, 30), (2.0, 10)),
        "right_foot_pitch": ((0.74, 0), (0.92, 40), (1.7, 40), (1.98, 0)),
        "arm_lowering": ((0.10, ARM), (0.62, 18), (0.78, 18), (1.10, 34), (1.50, -34), (2.05, 8), (2.2, 8),
                         (2.5, 40)),
        "left_arm_flexion": ((0.10, 0), (0.62, -6), (0.78, -6), (1.10, 62), (1.50, 42), (2.05, 6), (2.5, 0)),
        "right_arm_flexion": ((0.10, 0), (0.62, 52), (0.78, 52), (1.10, 62), (1.50, 42), (2.05, 6), (2.5, 0)),
        "elbow_flexion": ((0.10, 15), (0.62, 24), (0.78, 24), (1.10, 70), (1.50, 46), (2.05, 12), (2.5, 15)),
    },
)

# Sideways over the left foot as into a cartwheel: both arms up, the left hand towards the floor, the right
# leg high to the side; and back.
ACTIONS["cartwheel_lean"] = Action(
    kind="cartwheel lean", seconds=2.6,
    keys={
        "pelvis_roll": ((0.40, 0), (1.15, 50), (1.40, 50), (2.15, 0)),
        "pelvis_yaw": ((0.30, 0), (1.05, -20), (1.45, -20), (2.15, 0)),
        "pelvis_pitch": ((0.30, 0), (1.05, 10), (1.45, 10), (2.15, 0)),
        "trunk_bend": ((0.25, 0), (0.50, -6), (1.15, 34), (1.40, 34), (2.2, 0)),
        "trunk_twist": ((0.40, 0), (1.15, -16), (1.45, -16), (2.15, 0)),
        "head_yaw": ((0.40, 0), (1.05, 30), (1.45, 30), (2.05, 0)),
        "left_hip_abduction": ((0.30, 3), (1.15, 46), (1.40, 46), (2.15, 3)),
        "left_hip_flexion": ((0.30, 2), (1.05, 34), (1.45, 34), (2.15, 2)),
        "left_knee_flexion": ((0.30, 4), (1.05, 42), (1.45, 42), (2.15, 4)),
        "right_hip_abduction": ((0.35, 3), (1.15, 34), (1.40, 34), (2.05, 3)),
        "right_hip_flexion": ((0.35, 2), (1.15, 14), (1.45, 14), (2.05, 2)),
        "right_knee_flexion": ((0.35, 4), (0.70, 20), (1.15, 6), (1.80, 16), (2.15, 4)),
        "right_foot_pitch": ((0.40, 0), (0.80, 40), (1.70, 40), (2.15, 0)),
        "left_arm_lowering": ((0.10, ARM), (0.65, -54), (1.50, -54), (2.4, ARM)),
        "right_arm_lowering": ((0.10, ARM), (0.65, -46), (1.50, -46), (2.4, ARM)),
        "left_arm_flexion": ((0.30, 0), (1.05, 16), (1.50, 16), (2.3, 0)),
        "elbow_flexion": ((0.10, 15), (0.60, 8), (1.50, 8), (2.4, 15)),
    },
)

# Down onto a seat 45 cm high, a moment upright with the hands over the knees, and up again.
ACTIONS["sit_and_stand"] = Action(
    kind="sitting down and standing up", seconds=2.8,
    keys={
        "hip_flexion": ((0.10, 2), (0.60, 62), (1.05, 92), (1.75, 92), (2.1, 88), (2.65, 2)),
        "knee_flexion": ((0.10, 4), (0.60, 52), (1.05, 92), (1.75, 92), (2.1, 84), (2.65, 4)),
        "hip_abduction": ((0.10, 5), (1.0, 10), (1.9, 10), (2.6, 5)),
        "pelvis_pitch": ((0.10, 0), (0.65, 30), (1.15, -6), (1.55, -6), (1.95, 30), (2.6, 0)),
        "trunk_flexion": ((0.10, 0), (0.65, 24), (1.15, 8), (1.55, 6), (1.95, 26), (2.6, 0)),
        "head_pitch": ((0.10, 0), (0.65, -30), (1.15, 0), (1.55, 0), (1.95, -32), (2.6, 0)),
        "arm_lowering": ((0.10, ARM), (1.0, 62), (1.9, 62), (2.6, ARM)),
        "arm_flexion": ((0.10, 0), (0.65, 40), (1.15, 26), (1.55, 26), (1.95, 44), (2.6, 0)),
        "elbow_flexion": ((0.10, 15), (1.1, 62), (1.6, 62), (2.0, 40), (2.6, 15)),
    },
)
# fmt: on


def make_clip(name: str) -> Motion:
    """Make the library's motion of that name, arms as in its tables. Raises KeyError for an unknown name."""
    if name in STOPS:
        poses, path = STOPS[name].motion()
        return Motion(name, poses, path, LIBRARY_FPS, "stop", "embedded library: stops within a frame")
    if name in ACTIONS:
        action = ACTIONS[name]
        kind, source = action.kind, "embedded library: key angles"
        angles, flights = action.angles()
        poses = poses_from_angles(angles, action.frames)
        path = root_path(poses, flights)
    else:
        kind, source = GAITS[name].kind, "embedded library: normative gait curves"
        poses, path = GAITS[name].motion()
    path[:, [0, 2]] -= path[0, [0, 2]]
    every = round(RATE / LIBRARY_FPS)
    return Motion(name, poses[::every], path[::every], LIBRARY_FPS, kind, source)
