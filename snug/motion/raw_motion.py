"""Motion as its file has it, before anything is checked or turned, and limits that every reader keeps."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from snug.motion.motion import MotionError
from snug.motion.options import MotionFileOptions

MAX_TEXT_BYTES = 64 << 20  # [bytes] of a file of text
MAX_FRAMES = 100_000  # 14 minutes at 120 frames per second
MAX_SECONDS = 1800.0  # [s] a clip of few frames per second becomes many at 30
LOWEST_RATE, HIGHEST_RATE = 5.0, 1000.0  # [1/s] rates of frames that a recording may have


@dataclass(frozen=True, kw_only=True)
class RawMotion:
    """A clip in the axes of its file. Numbers that the file lacks are NaN.

    Attributes:
        path: the file.
        poses: (T, 24, 3) [rad], axis-angle relative to the parent joint, as in snug.body.parametric_body.
        translations: (T, 3) [m] of the root.
        fps: frames per second [1/s].
        source: file and kind, in words.

    Raises:
        MotionError: a clip of more than MAX_SECONDS.
    """

    path: Path
    poses: np.ndarray
    translations: np.ndarray
    fps: float
    source: str

    def __post_init__(self) -> None:
        if (seconds := len(self.poses) / self.fps) > MAX_SECONDS:
            raise MotionError(
                f"{self.path}: lasts {seconds:.0f} s, more than {MAX_SECONDS:.0f}; cut the clip"
            )


@dataclass(slots=True)
class Line:
    """One line of a text file, split into tokens, and its place for messages."""

    path: Path
    number: int
    tokens: list[str]

    def error(self, problem: str) -> MotionError:
        """Return the error that names file and line."""
        return MotionError(f"{self.path}, line {self.number}: {problem}")

    def numbers(self, first: int, count: int, *, last: bool = False) -> list[float]:
        """Return `count` tokens from `first` on as numbers; last: the line ends with them.

        Raises MotionError unless they are there and finite.
        """
        try:
            values = [float(word) for word in self.tokens[first : None if last else first + count]]
        except ValueError:
            values = []
        if len(values) != count or not all(map(math.isfinite, values)):
            text = " ".join(self.tokens)[:60]
            raise self.error(
                f"{count} finite numbers should be in '{text}'; repair the file or fetch it again"
            )
        return values


def read_lines(path: Path, comment: str | None = None) -> Iterator[Line]:
    """Yield the lines of a text file that are not empty, up to the letter that begins a comment.

    Raises:
        MotionError: the file cannot be read or is too large.
    """
    try:
        if path.stat().st_size > MAX_TEXT_BYTES:
            raise MotionError(f"{path}: larger than {MAX_TEXT_BYTES >> 20} MB; cut the clip")
        text = path.read_text(encoding="utf-8", errors="replace")
    except OSError as problem:
        raise MotionError(f"{path}: cannot be read ({problem.strerror}); check the path") from None
    for number, line in enumerate(text.splitlines(), 1):
        if tokens := (line.split(comment)[0] if comment else line).split():
            yield Line(path, number, tokens)


def check_frame_count(path: Path, frames: int) -> None:
    """Raise MotionError unless a clip has between 1 and MAX_FRAMES frames."""
    if not 0 < frames <= MAX_FRAMES:
        remedy = "cut the clip" if frames else "give a clip with frames"
        raise MotionError(f"{path}: {frames} frames; between 1 and {MAX_FRAMES} are read: {remedy}")


def frame_rate(
    path: Path, stated: float | None, options: MotionFileOptions, usual: float | None = None
) -> float:
    """Return the frames per second [1/s]: of the file, else of the options, else `usual` for such files.

    Raises:
        MotionError: there is none of them, file and options disagree, or no recording has that rate.
    """
    given = options.fps
    if stated is not None and given is not None and abs(stated - given) > 0.01 * stated:
        raise MotionError(
            f"{path}: states {stated:g} frames per second, --motion-fps says {given:g}; leave it out"
        )
    fps = next((value for value in (stated, given, usual) if value is not None), None)
    if fps is None:
        raise MotionError(f"{path}: states no frame rate; give --motion-fps N")
    if not LOWEST_RATE <= fps <= HIGHEST_RATE:
        raise MotionError(f"{path}: {fps:g} frames per second; rates are {LOWEST_RATE:g} to {HIGHEST_RATE:g}")
    return fps
