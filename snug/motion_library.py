"""The embedded library: the motions by name, those to train on apart from those to test with.

Nothing heavy is loaded before a motion is made, so that names can be listed quickly.
"""

from __future__ import annotations

from snug.motion import Motion, MotionError

TRAIN: tuple[str, ...] = (
    "walk", "brisk_walk", "run", "jump", "jumping_jack", "squat", "arm_raise", "arm_circle", "torso_twist",
    "side_bend", "turn", "sidestep", "bow", "lunge",
)  # fmt: skip
# None of these kinds of motion occurs in TRAIN.
TEST: tuple[str, ...] = ("sudden_stop", "kick", "punch", "spin_jump")
# Motions that stop within one frame, for garments that swing; DYNAMIC_TEST is seen by no training.
DYNAMIC_TRAIN: tuple[str, ...] = (
    "twist_1", "twist_2", "twist_3", "twist_4", "twist_5", "twist_6", "turntable_1", "turntable_2",
    "turntable_3", "turning_walk_1", "turning_walk_2", "turning_walk_3", "turning_walk_4",
)  # fmt: skip
DYNAMIC_TEST: tuple[str, ...] = ("twist_stop", "turning_stop")
LIBRARY = TRAIN + TEST + DYNAMIC_TRAIN + DYNAMIC_TEST


def make_motion(name: str) -> Motion:
    """A motion of the embedded library at 30 fps, arms already spread clear of the torso.

    Deterministic. Raises MotionError for a name that is not in LIBRARY.
    """
    if name not in LIBRARY:
        raise MotionError(f"unknown motion '{name}'; the library has: {', '.join(LIBRARY)}")
    from snug.motions import build

    return build(name)
