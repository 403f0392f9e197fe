"""Motions of kinds that no training motion has, to test with: see docs/protocol.md.

Nobody chooses a recipe by them, nor looks into what a method does on one frame of them.
"""

from __future__ import annotations

from snug.motion.clips.actions import ARM, Action
from snug.motion.clips.walks import Stride

ACTIONS: dict[str, Action] = {}

# fmt: off
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

# Approximate values of the mean curves of R. Riener, M. Rabuffetti and C. Frigo, Stair ascent and descent at
# different inclinations, Gait and Posture 15 (2002), at their middle inclination.
CLIMB = Stride(
    seconds=1.42,
    hip=((0, 52), (10, 46), (20, 36), (30, 24), (40, 14), (50, 7), (60, 9), (70, 30), (80, 53), (90, 60)),
    knee=((0, 62), (8, 61), (18, 50), (28, 34), (38, 20), (48, 11), (58, 20), (66, 55), (76, 88), (84, 92),
          (92, 78)),
    ankle=((0, 10), (10, 14), (20, 14), (32, 9), (44, 6), (54, -4), (63, -20), (72, -4), (82, 9), (92, 8)),
    toe_off=62.0, pelvis_pitch=8.0, pelvis_yaw=5.0, pelvis_roll=4.0,
    arm_mean=2.0, arm_swing=16.0, elbow_mean=35.0, elbow_swing=10.0, trunk_lean=8.0, rises=True,
)
