"""Embedded library: its motions by name, in the roles of training, validation and test.

Recorded clips train. Whole sequences of recordings and motions made by code validate and test, see
docs/protocol.md. Nothing heavy is loaded before a motion is made, so that names can be listed quickly.
"""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from snug.motion.motion import (
    Motion,
    MotionError,
    heading,
    spread_arms,
    turn_about_vertical,
)

CLIPS_FILE = Path(__file__).with_name("recorded") / "clips.npz"


class Clip(NamedTuple):
    """A recorded clip: what it shows, and its frames at 30 fps.

    digest: the first 12 digits of the SHA-256 of its float32 arrays, poses before translations.
    """

    content: str
    frames: int
    digest: str


CLIPS = {
    row["clip"]: Clip(row["content"], int(row["frames"]), row["digest"])
    for row in csv.DictReader(CLIPS_FILE.with_suffix(".csv").read_text(encoding="utf-8").splitlines())
}
# Validation and test clips of more than 150 frames are cut into so many segments of equal length.
SEGMENTS_OF = {"01_01": 7, "02_07": 6, "05_02": 3, "06_02": 2}


class Segment(NamedTuple):
    """Frames start to stop - 1 of a clip."""

    clip: str
    start: int
    stop: int


SEGMENTS = {
    f"{clip}_{letter}": Segment(clip, *(CLIPS[clip].frames * edge // count for edge in (part, part + 1)))
    for clip, count in SEGMENTS_OF.items()
    for part, letter in enumerate("abcdefgh"[:count])
}


def clip_of(name: str) -> str:
    """Return the clip that a segment is cut from; any other name as it is.

    >>> clip_of("01_01_b"), clip_of("walk")
    ('01_01', 'walk')
    """
    return SEGMENTS[name].clip if name in SEGMENTS else name


# Whole recorded clips. A walk is first: preset smoke trains on it.
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
# Nobody chooses by them. Preset small measures the first four, preset quick eight. Sword play and shots
# at a basket are kinds of which TRAIN and VALIDATION have none, motions made by code are a kind of which
# TRAIN has none.
TEST: tuple[str, ...] = (
    "01_01_a", "07_02", "02_07_a", "06_15", "push_recovery", "dance_turn", "05_03", "cartwheel_lean",
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
LIBRARY = tuple(dict.fromkeys((*TRAIN, *VALIDATION, *TEST, *DYNAMIC_VALIDATION, *CONTROL, *CLIPS)))


def make_motion(name: str) -> Motion:
    """Make a motion of the embedded library at 30 fps, arms already spread clear of the torso.

    A segment of a recorded clip is turned and moved to begin above the origin, facing +z.

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
    from snug.motion.coded import make_clip

    return spread_arms(make_clip(name))


def _read_clip(name: str) -> Motion:
    parts = ("poses", "translations", "source")
    with np.load(CLIPS_FILE) as file:  # reads what is asked for
        poses, translations, source = (file[f"{name}/{part}"] for part in parts)
    source = f"CMU motion capture: {source}"
    return Motion(name, poses, translations, kind=CLIPS[name].content, source=source)


def _segment(name: str, clip: Motion) -> Motion:
    _, start, stop = SEGMENTS[name]
    part = clip.cut(start, stop)
    turned = turn_about_vertical(part, -heading(part.poses[0]))
    turned.translations[:, 1] += part.translations[0, 1]  # the floor stays where it is
    source = f"{clip.source}; frames {start} to {stop - 1}"
    return replace(turned, name=name, source=source)
