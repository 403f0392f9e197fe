"""The visible tuple of hard motions: what each does to an ordinary walk. Listing them imports nothing heavy.

All start in the walk's first pose, so that one settled shirt serves every simulation; but for the extreme
shapes, which start in T-pose in the shirt's own rest shape carried to that body.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from snug.motion import Motion

MOTION = "walk"  # a training motion: what breaks here breaks next to what was learned
ORDINARY = 44  # frames of it that hard motions are compared with
APPROACH = 12  # frames from the walk's first pose to another
GLITCH = 12  # the frame that is wrong
AFTER = (1, 10, 30)  # frames after the glitch at which the distance to the unglitched roll-out is taken
FASTER = 4
LOOP_BLEND = 10  # frames from a loop's end to its start


@dataclass(frozen=True, kw_only=True)
class HardMotion:
    """One case: `make` gives its motion from the whole walk.

    betas: the first shape coefficients, the others being zero. material: factors on the material of the
    judging energies, and of the simulator. glitch: whether frame GLITCH is wrong, hence the recovery to be
    measured. smoke: whether the smallest preset does it.
    """

    name: str
    description: str
    make: Callable[[Motion], Motion]
    betas: tuple[float, ...] = ()
    material: dict[str, float] = field(default_factory=dict)
    glitch: bool = False
    smoke: bool = False


def ordinary(walk: Motion) -> Motion:
    return walk.cut(0, ORDINARY)


def faster(walk: Motion) -> Motion:
    """Every fourth frame."""
    return replace(walk, poses=walk.poses[::FASTER], translations=walk.translations[::FASTER])


def another_faster(name: str) -> Callable[[Motion], Motion]:
    """Into the first pose of another motion, then that at four times its speed."""

    def make(walk: Motion) -> Motion:
        from snug.motion_library import make_motion

        other = faster(make_motion(name))
        return _approached(walk, other.poses, other.translations)

    return make


def posed(**degrees: tuple[float, float, float]) -> Callable[[Motion], Motion]:
    """Into the walk's first pose with some joints at other angles, and a third of a second there."""

    def make(walk: Motion) -> Motion:
        pose = walk.poses[0].copy()
        for joint, angles in degrees.items():
            pose[_joint(joint)] = np.deg2rad(angles)
        return _approached(walk, np.repeat(pose[None], 10, axis=0), np.zeros((10, 3)))

    return make


def from_t_pose(walk: Motion) -> Motion:
    """From T-pose into the walk's first pose and ten frames on."""
    from snug.motion import transition

    t_pose = np.zeros_like(walk.poses[0])
    t_pose[0] = walk.poses[0, 0]
    poses = np.concatenate([transition(t_pose, walk.poses[0], APPROACH), walk.poses[1:10]])
    start = np.repeat(walk.translations[:1], APPROACH, axis=0)
    return replace(walk, poses=poses, translations=np.concatenate([start, walk.translations[1:10]]))


def root_jumps(walk: Motion) -> Motion:
    """One metre to the side for a single frame."""
    motion = ordinary(walk)
    translations = motion.translations.copy()
    translations[GLITCH, 0] += 1.0
    return replace(motion, translations=translations)


def limb_flips(walk: Motion) -> Motion:
    """The left arm turned by 180 degrees about the chest's front axis for a single frame."""
    from snug.skeleton import axis_angles, rotation_matrices

    motion = ordinary(walk)
    poses = motion.poses.copy()
    half = rotation_matrices(np.array([0.0, 0.0, np.pi]))
    poses[GLITCH, _joint("left_shoulder")] = axis_angles(
        half @ rotation_matrices(poses[GLITCH, _joint("left_shoulder")])
    )
    return replace(motion, poses=poses)


def looped(walk: Motion, frames: int) -> tuple[Motion, int]:
    """The walk over and over, its end led back into its start: `frames` frames, and those of one loop."""
    from snug.motion import transition

    back = transition(walk.poses[-1], walk.poses[0], LOOP_BLEND + 2)[1:-1]
    poses = np.concatenate([walk.poses, back])
    steps = np.diff(walk.translations, axis=0)
    # The way back adds no ground, and takes the height back to where it began.
    home = np.zeros((LOOP_BLEND + 1, 3))
    home[:, 1] = (walk.translations[0, 1] - walk.translations[-1, 1]) / len(home)
    loops = -(-frames // len(poses))
    moves = np.tile(np.concatenate([steps, home]), (loops, 1))[: frames - 1]
    translations = walk.translations[0] + np.concatenate([np.zeros((1, 3)), np.cumsum(moves, axis=0)])
    return replace(walk, poses=np.tile(poses, (loops, 1, 1))[:frames], translations=translations), len(poses)


def _joint(name: str) -> int:
    from snug.skeleton import JOINT

    return JOINT[name]


def _approached(walk: Motion, poses: np.ndarray, translations: np.ndarray) -> Motion:
    """The walk's first pose, a smooth way to poses[0], then poses; the root goes on from where it stands."""
    from snug.motion import transition

    way = transition(walk.poses[0], poses[0], APPROACH)
    stand = np.repeat(walk.translations[:1], APPROACH, axis=0)
    moved = walk.translations[0] + translations - translations[0]
    return replace(
        walk, poses=np.concatenate([way, poses[1:]]), translations=np.concatenate([stand, moved[1:]])
    )


ORDINARY_CASE = HardMotion(name="ordinary", description="the walk as it is", make=ordinary)

HARD_MOTIONS = (
    HardMotion(name="walk_x4", description="the walk four times faster", make=faster, smoke=True),
    HardMotion(name="run_x4", description="a run four times faster", make=another_faster("run")),
    HardMotion(
        name="jumping_jack_x4",
        description="jumping jacks four times faster",
        make=another_faster("jumping_jack"),
    ),
    HardMotion(
        name="splits",
        description="both legs out to the sides by 80 degrees",
        make=posed(left_hip=(0.0, 0.0, 80.0), right_hip=(0.0, 0.0, -80.0)),
    ),
    HardMotion(
        name="arms_crossed",
        description="both arms stretched forward and across each other",
        make=posed(left_shoulder=(0.0, -115.0, 0.0), right_shoulder=(0.0, 115.0, 0.0)),
    ),
    *(
        HardMotion(
            name=f"{word}_{sign}5",
            description=f"shape coefficient {place} at {sign}5: {title}; the shirt's rest shape stays",
            make=from_t_pose,
            betas=(*(0.0,) * place, float(f"{sign}5")),
        )
        for place, word, signs in ((0, "height", (("+", "2.2 m tall"), ("-", "1.2 m tall"))),
                                   (1, "girth", (("+", "stout"), ("-", "thin"))))
        for sign, title in signs
    ),
    HardMotion(
        name="root_glitch",
        description="the whole body one metre aside for a single frame",
        make=root_jumps,
        glitch=True,
    ),
    HardMotion(
        name="limb_glitch",
        description="the left arm turned by 180 degrees for a single frame",
        make=limb_flips,
        glitch=True,
    ),
    HardMotion(
        name="membrane_x10",
        description="cloth ten times as stiff in its plane as the one trained on",
        make=ordinary,
        material={"young_modulus": 10.0},
    ),
    HardMotion(
        name="bending_x100",
        description="hinges a hundred times as stiff as those trained on",
        make=ordinary,
        material={"bending_stiffness": 100.0},
    ),
)  # fmt: skip
