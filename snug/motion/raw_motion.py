"""Motion as its file has it, the limits that every reader keeps, and the mending of recording errors."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from snug.body.skeleton import JOINT, JOINT_NAMES, axis_angles, joint_positions, rotation_matrices
from snug.file_options import MotionFileOptions
from snug.motion.motion import MotionError, slerp

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
    """

    path: Path
    poses: np.ndarray
    translations: np.ndarray
    fps: float
    source: str


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


def frame_rate(
    path: Path, frames: int, stated: float | None, options: MotionFileOptions, usual: float | None = None
) -> float:
    """Return the frames per second [1/s]: of the file, else of the options, else `usual` for such files.

    Raises:
        MotionError: there is none of them, file and options disagree, no recording has that rate, or the
            clip has no frame, more than MAX_FRAMES, or more than MAX_SECONDS.
    """
    given = options.fps
    if stated is not None and given is not None and abs(stated - given) > 0.01 * stated:
        raise MotionError(
            f"{path}: states {stated:g} frames per second, fps={given:g} is given; leave it out"
        )
    fps = next((value for value in (stated, given, usual) if value is not None), None)
    if fps is None:
        raise MotionError(f"{path}: states no frame rate; add ,fps=N behind the path")
    if not LOWEST_RATE <= fps <= HIGHEST_RATE:
        raise MotionError(f"{path}: {fps:g} frames per second; rates are {LOWEST_RATE:g} to {HIGHEST_RATE:g}")
    if not 0 < frames <= min(MAX_FRAMES, MAX_SECONDS * fps):
        limits = f"1 to {MAX_FRAMES} frames and at most {MAX_SECONDS:.0f} s are read"
        raise MotionError(f"{path}: {frames} frames, which last {frames / fps:.0f} s; {limits}: cut the clip")
    return fps


# 30 degrees in 1/120 s: twice the fastest joint of a kick or a sprint. A swapped or lost marker does it.
MAX_TURN_SPEED = np.deg2rad(30.0) * 120.0  # [rad/s]
MAX_ROOT_SPEED = 10.0  # [m/s] of the root: a sprinter's speed
SAME_ERROR = 0.25  # [s] two jumps closer than this bound one error
UNTRUSTED = 2  # frames on either side of a jump that are not trusted
MAX_WRONG = 0.25  # share of frames that may be wrong in a file that is mended
# A joint that turns further, or a root that is further away, was not written in radians or metres.
MAX_ANGLE = 4.0 * np.pi  # [rad] of all joints but the root, whose turns may have been added up
MAX_ROOT_ANGLE = 1e3  # [rad] of the root
MAX_DISTANCE = 1e4  # [m]
MAX_NAMED = 4  # joints, and errors of each, in a message; the others are counted


def remove_recording_errors(raw: RawMotion, *, repair: bool) -> RawMotion:
    """Return the motion with all numbers finite and no jump; its source names what was repaired.

    Repaired: the shortest arc, or the straight line, between the good frames around an error; at an end of
    the clip the nearest good frame is held.

    Raises:
        MotionError: an error without `repair`, or one that cannot be repaired: too many, a jump that stays,
            other units.
    """
    poses, path = (np.where(np.isfinite(x), x, np.nan) for x in (raw.poses, raw.translations))
    angles = np.linalg.norm(poses, axis=2)
    if (angles[:, 1:] > MAX_ANGLE).any() or (angles[:, 0] > MAX_ROOT_ANGLE).any():
        raise MotionError(f"{raw.path}: a joint turns by more than a person's; write radians, not degrees")
    if (np.abs(path) > MAX_DISTANCE).any():
        raise MotionError(f"{raw.path}: the root is more than {MAX_DISTANCE:g} m away; write metres")
    tracks = [(name, poses[:, joint], True) for joint, name in enumerate(JOINT_NAMES)]
    errors, any_wrong, stays = [], np.zeros(len(poses), dtype=bool), False
    for name, track, turns in [*tracks, ("the root's path", path, False)]:
        wrong = ~np.isfinite(track).all(axis=1)
        if wrong.all():
            raise MotionError(f"{raw.path}: {name} is not finite in any frame; export it again")
        _interpolate(track, wrong, turns)
        for first, last in _leaps(track, turns, raw.fps):
            wrong[max(first + 1 - UNTRUSTED, 0) : last + UNTRUSTED + 1] = True
        if wrong.any():
            frames = np.flatnonzero(wrong)
            runs = np.split(frames, np.flatnonzero(np.diff(frames) > 1) + 1)
            errors.append(f"{name} in frames {_short([f'{run[0]}-{run[-1]}' for run in runs])}")
            any_wrong |= wrong
            _interpolate(track, wrong, turns)
            stays = stays or bool(_leaps(track, turns, raw.fps))
    if not errors:
        return raw
    named = _short(errors)
    problem = f"jumps, or numbers that are not finite: {named}"
    if any_wrong.mean() > MAX_WRONG:
        share = f"{100 * any_wrong.mean():.0f} % of the frames"
        raise MotionError(f"{raw.path}: {problem}, {share}; check frame rate and units, export it again")
    if not repair:
        raise MotionError(
            f"{raw.path}: {problem}; add ,repair behind the path to interpolate, or cut the clip"
        )
    if stays:
        raise MotionError(f"{raw.path}: {problem}; a jump is left by interpolation, so cut the clip there")
    return replace(raw, poses=poses, translations=path, source=f"{raw.source}; repaired: {named}")


def _short(names: list[str]) -> str:
    return ", ".join(names[:MAX_NAMED]) + f" and {len(names) - MAX_NAMED} more" * (len(names) > MAX_NAMED)


def _leaps(track: np.ndarray, turns: bool, fps: float) -> list[tuple[int, int]]:
    """Return the first and the last jump of each error of a track (T, 3).

    A jump k is one from frame k to frame k + 1; jumps in quick succession bound one error.
    """
    steps = np.diff(track, axis=0)
    if turns:
        rotations = rotation_matrices(track)
        steps = axis_angles(np.swapaxes(rotations[:-1], -1, -2) @ rotations[1:])
    limit = MAX_TURN_SPEED if turns else MAX_ROOT_SPEED
    jumps = np.flatnonzero(np.linalg.norm(steps, axis=1) * fps > limit)
    groups = np.split(jumps, np.flatnonzero(np.diff(jumps) > SAME_ERROR * fps) + 1)
    return [(group[0], group[-1]) for group in groups if len(group)]


def _interpolate(track: np.ndarray, wrong: np.ndarray, turns: bool) -> None:
    """Fill the wrong frames (T,) of a track (T, 3), in place, from the good ones around them, if any."""
    frames, good = np.flatnonzero(wrong), np.flatnonzero(~wrong)
    if not (len(frames) and len(good)):
        return
    place = np.searchsorted(good, frames)
    before, after = good[np.maximum(place - 1, 0)], good[np.minimum(place, len(good) - 1)]
    share = np.where(after > before, (frames - before) / np.maximum(after - before, 1), 0.0)
    straight = track[before] + share[:, None] * (track[after] - track[before])
    track[frames] = slerp(track[before], track[after], share) if turns else straight


# From the axes of a file, by the one that is vertical, to ours: with z up (x, y, z) becomes (x, z, -y).
TO_Y_UP = {
    "y": np.eye(3),
    "z": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]),
}
MAX_LYING_COSINE = 0.3  # between the vertical and the way from ankles to head: below it a body lies or crawls
MAX_RISE = 1.0  # [m] the lowest joint may rise and fall where no axis is given: more than a jump


def turn_y_up(raw: RawMotion, up: str) -> RawMotion:
    """Turn a raw motion so that y is up.

    In a frame the body stands along the axis that is nearest to the direction from its ankles to its head.
    The axis of more than half of the frames is taken; a body that lies in the others, as after a fall, is
    fine.

    Args:
        raw: in the axes of its file.
        up: its vertical axis, "y" or "z"; empty: the one along which the body stands.

    Raises:
        MotionError: no axis is that, the given one is not, or a body that should stand along the axis found
            travels along it: it may be crawling.
    """
    joints = joint_positions(raw.poses, raw.translations)
    ankles = joints[:, [JOINT["left_ankle"], JOINT["right_ankle"]]].mean(axis=1)
    directions = joints[:, JOINT["head"]] - ankles
    directions /= np.maximum(np.linalg.norm(directions, axis=1, keepdims=True), 1e-9)
    nearest = np.concatenate([directions, -directions], axis=1).argmax(axis=1)
    shares = {axis: np.mean(nearest == "xyz".index(axis)) for axis in TO_Y_UP}
    axis = up or max(shares, key=lambda axis: shares[axis])
    share = f"{100 * shares[axis]:.0f} % of the frames"
    along = "xyz".index(axis)
    stands = (directions[:, along] > MAX_LYING_COSINE).mean() if up else shares[axis]
    if stands <= 0.5:
        raise MotionError(
            f"{raw.path}: the body stands along {axis} in {share} only; add ,up=y or ,up=z behind the path, "
            "turn the root's rotation and path, or give a clip that stands"
        )
    rise = float(np.ptp(joints[..., along].min(axis=1)))
    if not up and rise > MAX_RISE:
        raise MotionError(
            f"{raw.path}: the body points along {axis} in {share}, and its lowest joint moves by "
            f"{rise:.3g} m along it; if {axis} is up and the path in metres add ,up={axis}"
        )
    note = f"{up} up as given" if up else f"{axis} up, as the body stands in {share}"
    poses, turn = raw.poses.copy(), TO_Y_UP[axis]
    poses[:, 0] = axis_angles(turn @ rotation_matrices(poses[:, 0]))
    return replace(raw, poses=poses, translations=raw.translations @ turn.T, source=f"{raw.source}; {note}")
