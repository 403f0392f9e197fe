"""Embedded library: its motions by name, in the roles of training, validation and test.

Recorded clips train. Whole sequences of recordings and motions made by code validate and test, see
docs/protocol.md. Nothing heavy is loaded before a motion is made, so that names can be listed quickly.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import groupby
from pathlib import Path
from typing import NamedTuple

import numpy as np

from snug.motion.motion import Motion, MotionError, heading, nearest_pose, spread_arms, turn_about_vertical

CLIPS_FILE = Path(__file__).with_name("recorded") / "clips.npz"


class Clip(NamedTuple):
    """A recorded clip: what it shows, and its frames at 30 fps.

    digest: the first 12 digits of the SHA-256 of its float32 arrays, poses before translations.
    """

    content: str
    frames: int
    digest: str


CLIPS: dict[str, Clip] = {
    "01_01": Clip("forward jumps, turning round", 689, "5a1224e6e031"),
    "01_05": Clip("climbing, swinging", 1095, "a2dccee441a7"),
    "02_01": Clip("walk, 1.1 m/s", 87, "2b9abb11f4c7"),
    "02_02": Clip("walk, 1.6 m/s", 75, "dd0cf16f5ac1"),
    "02_03": Clip("run, 2.5 m/s", 44, "8697808c5ac0"),
    "02_04": Clip("jump, balance", 121, "3b23856fb3e4"),
    "02_05": Clip("punch, strike", 464, "6554b11f0a8f"),
    "02_07": Clip("sword play", 563, "56849aa65ffa"),
    "05_01": Clip("walk, 1.0 m/s", 150, "f5d5b06b8aa6"),
    "05_02": Clip("dance: expressive arms, pirouette", 281, "8991d0c553e6"),
    "05_03": Clip("dance: sideways arabesque, folding arms", 108, "b5aace017a83"),
    "05_04": Clip("dance: sideways arabesque, bending back", 300, "f8df31c438db"),
    "05_07": Clip("dance: small leaps, pirouette", 298, "5502aa1e4275"),
    "05_11": Clip("dance: sideways steps, pirouette", 148, "13732d9366ff"),
    "05_12": Clip("dance: arms held high, upper body turning", 339, "1ce51fdac7d8"),
    "05_13": Clip("dance: small leaps, pirouette", 274, "cebad81c8322"),
    "05_14": Clip("dance: attitude, arabesque", 161, "b07c0ab2f806"),
    "05_18": Clip("dance: arabesque, bending back", 320, "b5c18f6c60fe"),
    "05_20": Clip("dance: arabesque, bending back", 165, "48cd275fd4f4"),
    "06_01": Clip("walk, 1.2 m/s", 123, "bc4b60c3cd69"),
    "06_02": Clip("basketball: forward dribble", 181, "b3f0c441ba3e"),
    "06_03": Clip("basketball: forward dribble", 132, "ae2f36d9d01d"),
    "06_04": Clip("basketball: forward dribble", 99, "a09899a46762"),
    "06_05": Clip("basketball: forward dribble", 96, "56ff7f3b3db8"),
    "06_06": Clip("basketball: backward dribble", 100, "2d1881fa8f64"),
    "06_07": Clip("basketball: backward dribble", 144, "3e31bf69e42a"),
    "06_08": Clip("basketball: sideways dribble", 85, "ab80dfeefb0b"),
    "06_09": Clip("basketball: sideways dribble", 75, "f4b6a8b448bb"),
    "06_10": Clip("basketball: dribble, left turns", 279, "677ed8fc2934"),
    "06_11": Clip("basketball: dribble, right turns", 287, "4def91f74e12"),
    "06_14": Clip("basketball: shot after a crossover", 120, "8a3223bbf545"),
    "06_15": Clip("basketball: shot after a dribble", 137, "996ae522364b"),
    "07_01": Clip("walk, 1.6 m/s", 79, "84aa603636ab"),
    "07_02": Clip("walk, 1.5 m/s", 82, "da604aa37de1"),
    "07_03": Clip("walk, 1.2 m/s", 104, "101a62a032cd"),
    "07_05": Clip("walk, 1.1 m/s", 129, "a5c01d69a6df"),
    "07_06": Clip("walk, 1.4 m/s", 104, "513ae659d540"),
    "07_07": Clip("walk, 1.5 m/s", 95, "cb776ec54879"),
    "07_08": Clip("walk, 1.6 m/s", 90, "8b9c3d17da71"),
    "07_09": Clip("walk, 1.7 m/s", 76, "85a96ff78126"),
    "07_10": Clip("walk, 1.9 m/s", 75, "4b172dee69bc"),
    "07_11": Clip("walk, 1.9 m/s", 79, "9eac70f15fd2"),
    "07_12": Clip("walk, 2.2 m/s", 66, "5d3d39709967"),
}
# Validation and test clips of more than 150 frames are cut into so many segments of equal length.
SEGMENTS_OF = {"01_01": 7, "02_07": 6, "05_02": 3, "06_02": 2}


class Segment(NamedTuple):
    """Frames start to stop - 1 of a clip."""

    clip: str
    start: int
    stop: int


def _cut(clip: str, count: int) -> Iterable[tuple[str, Segment]]:
    frames = CLIPS[clip].frames
    edges = [frames * place // count for place in range(count + 1)]
    for letter, start, stop in zip("abcdefgh", edges, edges[1:]):
        yield f"{clip}_{letter}", Segment(clip, start, stop)


SEGMENTS = {name: segment for clip, count in SEGMENTS_OF.items() for name, segment in _cut(clip, count)}


def clip_of(name: str) -> str:
    """Return the clip that a segment is cut from; any other name as it is.

    >>> clip_of("01_01_b"), clip_of("walk")
    ('01_01', 'walk')
    """
    return SEGMENTS[name].clip if name in SEGMENTS else name


# Whole recorded clips. A walk is first: preset smoke trains on it. The last is held out of trainings
# that are stopped by a training clip.
TRAIN: tuple[str, ...] = (
    "07_01", "02_01", "02_02", "02_03", "02_04", "02_05", "01_05",
    "05_01", "05_04", "05_07", "05_11", "05_12", "05_13", "05_18", "05_20",
    "06_01", "06_03", "06_04", "06_05", "06_06", "06_07", "06_08", "06_09", "06_10", "06_11",
    "07_03", "07_05", "07_06", "07_07", "07_09", "07_10", "07_11", "07_12", "05_14",
)  # fmt: skip
# Whole sequences, cut into segments, and motions made by code. Recipes are chosen by them.
# Preset quick measures the first eight.
VALIDATION: tuple[str, ...] = (
    "sudden_stop", "05_02_a", "06_02_a", "kick", "07_08", "spin_jump", "punch", "05_02_b",
    "05_02_c", "06_02_b",
)  # fmt: skip
# Nobody chooses by them. Preset quick measures the first eight. Sword play and shots at a basket are kinds of
# which TRAIN and VALIDATION have none, motions made by code are a kind of which TRAIN has none.
TEST: tuple[str, ...] = (
    "01_01_a", "push_recovery", "02_07_a", "dance_turn", "06_15", "05_03", "cartwheel_lean", "07_02",
    "climbing_steps", "sit_and_stand", "06_14",
    "01_01_b", "01_01_c", "01_01_d", "01_01_e", "01_01_f", "01_01_g",
    "02_07_b", "02_07_c", "02_07_d", "02_07_e", "02_07_f",
)  # fmt: skip
# For garments that swing: motions that stop within one frame, and those of TEST that set a hem swinging.
DYNAMIC_VALIDATION: tuple[str, ...] = ("turning_stop", "twist_stop")
DYNAMIC_TEST: tuple[str, ...] = ("dance_turn", "push_recovery")
# Made by code, without a role: scenes under control (loops, extremes, meshes) and comparisons.
CONTROL: tuple[str, ...] = (
    "walk", "brisk_walk", "run", "jump", "jumping_jack", "squat", "arm_raise", "arm_circle", "torso_twist",
    "side_bend", "turn", "sidestep", "bow", "lunge",
    "twist_1", "twist_2", "twist_3", "twist_4", "twist_5", "twist_6", "turntable_1", "turntable_2",
    "turntable_3", "turning_walk_1", "turning_walk_2", "turning_walk_3", "turning_walk_4",
)  # fmt: skip
RECORDED_FPS = 30.0  # [1/s]
LIBRARY = tuple(dict.fromkeys((*TRAIN, *VALIDATION, *TEST, *DYNAMIC_VALIDATION, *CONTROL, *CLIPS)))


def make_motion(name: str) -> Motion:
    """Make a motion of the embedded library at 30 fps, arms already spread clear of the torso.

    A segment of a recorded clip is turned and moved to begin above the origin, facing +z.

    Args:
        name: one of LIBRARY.

    Raises:
        MotionError: a name that is not in LIBRARY.

    >>> walk = make_motion("walk")
    >>> walk.frames, walk.fps, walk.kind
    (120, 30.0, 'walk')
    >>> make_motion("01_01_a").kind
    'forward jumps, turning round'
    """
    if name not in LIBRARY:
        raise MotionError(f"unknown motion '{name}'; the library has: {', '.join(LIBRARY)}")
    if (clip := clip_of(name)) in CLIPS:
        recorded = _read_clip(clip)
        return recorded if name == clip else _segment(name, recorded)
    # Its curves need SciPy; names are listed without.
    from snug.motion.actions import make_clip

    return spread_arms(make_clip(name))


def _read_clip(name: str) -> Motion:
    with np.load(CLIPS_FILE) as file:  # reads what is asked for
        poses, translations, source = (file[f"{name}/{part}"] for part in ("poses", "translations", "source"))
    return Motion(
        name, poses, translations, RECORDED_FPS, CLIPS[name].content, f"CMU motion capture: {source}"
    )


def _segment(name: str, clip: Motion) -> Motion:
    _, start, stop = SEGMENTS[name]
    part = clip.cut(start, stop)
    turned = turn_about_vertical(part, -heading(part.poses[0]))
    turned.translations[:, 1] += part.translations[0, 1]  # the floor stays where it is
    source = f"{clip.source}; frames {start} to {stop - 1}"
    return Motion(name, turned.poses, turned.translations, clip.fps, clip.kind, source)


def clip_rows() -> Iterator[tuple[str, ...]]:
    """Yield a heading and a row of each recorded clip: name, content, frames, role, digest."""
    yield "Clip", "Content", "Frames", "Role", "Digest"
    roles = {"training": TRAIN, "validation": VALIDATION, "test": TEST}
    role_of = {clip_of(name): role for role, names in roles.items() for name in names}
    for name, (content, frames, digest) in CLIPS.items():
        yield f"`{name}`", content, str(frames), role_of[name], f"`{digest}`"


def source_rows() -> Iterator[tuple[str, ...]]:
    """Yield a heading and a row of each independent source of test motions: a recording or one made by code.

    The distances [deg] to training poses are over the frames of all test motions of the source.
    """
    yield "Test motions", "Content", "Frames", "Mean distance [deg]", "Largest distance [deg]"
    training = np.concatenate([make_motion(name).poses for name in TRAIN])
    by_recording = sorted(TEST, key=lambda name: (clip_of(name) not in CLIPS, name))
    for clip, names in groupby(by_recording, key=clip_of):
        first, *others = names
        motions = [make_motion(name) for name in (first, *others)]
        distances = [np.rad2deg(nearest_pose(motion.poses, training)) for motion in motions]
        degrees = np.concatenate(distances)
        listed = f"`{first}` to `{others[-1]}`" if others else f"`{first}`"
        content = motions[0].kind if clip in CLIPS else f"{motions[0].kind}, by code"
        yield listed, content, str(len(degrees)), f"{degrees.mean():.1f}", f"{degrees.max():.1f}"
