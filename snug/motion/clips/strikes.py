"""Actions that step or strike: kick, punch, turning round and stepping sideways."""

from __future__ import annotations

from snug.motion.clips.actions import ARM, Action

ACTIONS: dict[str, Action] = {}

# fmt: off
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
