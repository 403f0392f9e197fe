"""Table of the recorded clips: content, frames and digest of each, and how some are cut into segments."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

CLIPS_FILE = Path(__file__).with_name("clips.npz")


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
