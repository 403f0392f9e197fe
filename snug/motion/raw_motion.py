"""A clip as its file has it, before anything is checked or turned, and limits that every reader keeps."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from snug.motion.motion import MotionError
from snug.motion.options import MotionFileOptions

LARGEST_TEXT = 64 << 20  # [bytes] of a file of text
MOST_FRAMES = 100_000  # 14 minutes at 120 frames per second
LONGEST = 1800.0  # [s] a clip of few frames per second becomes many at 30
SLOWEST, FASTEST = 5.0, 1000.0  # [1/s] rates of frames that a recording may have


@dataclass(frozen=True, kw_only=True)
class RawMotion:
    """poses: (T, 24, 3) axis-angle [rad], relative to the parent, as in snug.body.parametric_body; translations: (T, 3) [m].

    The root's rotation and path are in the axes of the file. Numbers that the file lacks are NaN.
    Raises MotionError for a clip of more than LONGEST.
    """

    path: Path
    poses: np.ndarray
    translations: np.ndarray
    fps: float
    source: str

    def __post_init__(self) -> None:
        if (seconds := len(self.poses) / self.fps) > LONGEST:
            raise MotionError(f"{self.path}: lasts {seconds:.0f} s, more than {LONGEST:.0f}; cut the clip")


def open_text(path: Path) -> list[str]:
    """The lines of a file of text. Raises MotionError where it cannot be read or is too large."""
    try:
        if path.stat().st_size > LARGEST_TEXT:
            raise MotionError(f"{path}: larger than {LARGEST_TEXT >> 20} MB; cut the clip")
        return path.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError as problem:
        raise MotionError(f"{path}: cannot be read ({problem.strerror}); check the path") from None


def check_length(path: Path, frames: int) -> None:
    """Raises MotionError for a clip without frames, or with more than MOST_FRAMES."""
    if not 0 < frames <= MOST_FRAMES:
        remedy = "cut the clip" if frames > 0 else "give a clip with frames"
        raise MotionError(f"{path}: {frames} frames; between 1 and {MOST_FRAMES} are read: {remedy}")


def rate(path: Path, stated: float | None, reading: MotionFileOptions, usual: float | None = None) -> float:
    """Frames per second: what the file states, else what was given, else what is usual for such files.

    Raises MotionError where there is none of them, file and command disagree, or no recording has that rate.
    """
    given = reading.fps
    if stated is not None and given is not None and abs(stated - given) > 0.01 * stated:
        raise MotionError(
            f"{path}: states {stated:g} frames per second, --motion-fps says {given:g}; leave it out"
        )
    fps = next((value for value in (stated, given, usual) if value is not None), None)
    if fps is None:
        raise MotionError(f"{path}: states no frame rate; give --motion-fps N")
    if not SLOWEST <= fps <= FASTEST:
        raise MotionError(
            f"{path}: {fps:g} frames per second; a rate between {SLOWEST:g} and {FASTEST:g} is needed"
        )
    return fps
