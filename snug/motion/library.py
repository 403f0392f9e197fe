"""Embedded library: its motions by name, in the roles of training, validation and test.

Nothing heavy is loaded before a motion is made, so that names can be listed quickly.
"""

from __future__ import annotations

from snug.motion.motion import Motion, MotionError, spread_arms

TRAIN: tuple[str, ...] = (
    "walk", "brisk_walk", "run", "jump", "jumping_jack", "squat", "arm_raise", "arm_circle", "torso_twist",
    "side_bend", "turn", "sidestep", "bow", "lunge",
)  # fmt: skip
# None of these kinds of motion occurs in TRAIN. Recipes are chosen by them.
VALIDATION: tuple[str, ...] = ("sudden_stop", "spin_jump", "kick", "punch")
# Kinds that occur in neither: nobody chooses by them, see docs/protocol.md.
TEST: tuple[str, ...] = ("push_recovery", "dance_turn", "cartwheel_lean", "climbing_steps", "sit_and_stand")
# In both the liveliest come first: their clips stand in suite speed.
# For garments that swing: motions that stop within one frame, and those of TEST that set a hem swinging.
DYNAMIC_TRAIN: tuple[str, ...] = (
    "twist_1", "twist_2", "twist_3", "twist_4", "twist_5", "twist_6", "turntable_1", "turntable_2",
    "turntable_3", "turning_walk_1", "turning_walk_2", "turning_walk_3", "turning_walk_4",
)  # fmt: skip
DYNAMIC_VALIDATION: tuple[str, ...] = ("turning_stop", "twist_stop")
DYNAMIC_TEST: tuple[str, ...] = ("dance_turn", "push_recovery")
LIBRARY = (*TRAIN, *VALIDATION, *TEST, *DYNAMIC_TRAIN, *DYNAMIC_VALIDATION)


def make_motion(name: str) -> Motion:
    """Make a motion of the embedded library at 30 fps, arms already spread clear of the torso.

    Args:
        name: one of LIBRARY.

    Raises:
        MotionError: a name that is not in LIBRARY.

    >>> walk = make_motion("walk")
    >>> walk.frames, walk.fps, walk.kind
    (120, 30.0, 'walk')
    """
    if name not in LIBRARY:
        raise MotionError(f"unknown motion '{name}'; the library has: {', '.join(LIBRARY)}")
    # Its curves need SciPy; names are listed without.
    from snug.motion.clips.make_clip import make_clip
    from snug.motion.clips.posture import LIBRARY_FPS

    clip = make_clip(name)
    return spread_arms(Motion(name, clip.poses, clip.translations, LIBRARY_FPS, clip.kind, clip.source))
