"""Errors of a recording: numbers that are not finite, and jumps that no body makes. Named, or repaired."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from snug.body.skeleton import JOINT_NAMES, axis_angles, rotation_matrices
from snug.motion.motion import MotionError, slerp
from snug.motion.raw_motion import RawMotion

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
    _check_units(raw.path, poses, path)
    tracks = [(name, poses[:, joint], True) for joint, name in enumerate(JOINT_NAMES)]
    errors: dict[str, list[str]] = {}
    wrong, stays = np.zeros(len(poses), dtype=bool), ""
    for name, track, turns in [*tracks, ("the root's path", path, False)]:
        missing = ~np.isfinite(track).all(axis=1)
        if missing.all():
            raise MotionError(f"{raw.path}: {name} is not finite in any frame; export it again")
        for first, last in _runs(missing):
            errors.setdefault(f"{name} is not finite", []).append(f"{first}-{last}")
        _bridge(track, missing, turns)
        jumps = _jumps(track, turns, raw.fps)
        wrong |= missing
        for first, last in _spans_around(jumps, raw.fps, len(track)):
            errors.setdefault(f"{name} jumps", []).append(f"{first}-{last}")
            around = np.zeros(len(track), dtype=bool)
            around[first : last + 1] = True
            wrong |= around
            if not around.all():
                _bridge(track, around, turns)
        for frame in _jumps(track, turns, raw.fps)[:1]:
            stays = stays or f"{name} jumps after frame {frame}"
    if not errors:
        return raw
    named = _short([f"{what} in frames {_short(spans)}" for what, spans in errors.items()])
    share = f"recording errors in {100 * wrong.mean():.0f} % of the frames"
    if wrong.mean() > MAX_WRONG:
        raise MotionError(f"{raw.path}: {share} ({named}); check frame rate and units, export it again")
    if not repair:
        raise MotionError(f"{raw.path}: {named}; give --repair to interpolate, or cut the clip")
    if stays:
        raise MotionError(f"{raw.path}: {stays} and stays where it is then; cut the clip there")
    return replace(raw, poses=poses, translations=path, source=f"{raw.source}; repaired: {named}")


def _short(names: list[str]) -> str:
    return ", ".join(names[:MAX_NAMED]) + f" and {len(names) - MAX_NAMED} more" * (len(names) > MAX_NAMED)


def _check_units(file: Path, poses: np.ndarray, path: np.ndarray) -> None:
    angles = np.linalg.norm(poses, axis=2)
    limits = np.full(angles.shape[1], MAX_ANGLE)
    limits[0] = MAX_ROOT_ANGLE
    for frame, joint in np.argwhere(angles > limits)[:1]:
        raise MotionError(
            f"{file}: {JOINT_NAMES[joint]} turns by {angles[frame, joint]:.3g} rad in frame {frame}; write "
            "radians, not degrees"
        )
    for frame in np.flatnonzero((np.abs(path) > MAX_DISTANCE).any(axis=1))[:1]:
        raise MotionError(
            f"{file}: the root is more than {MAX_DISTANCE:g} m away in frame {frame}; write metres"
        )


def _jumps(track: np.ndarray, turns: bool, fps: float) -> np.ndarray:
    """Return the frames k of a track (T, 3) with a jump to frame k + 1."""
    steps = np.diff(track, axis=0)
    if turns:
        rotations = rotation_matrices(track)
        steps = axis_angles(np.swapaxes(rotations[:-1], -1, -2) @ rotations[1:])
    limit = MAX_TURN_SPEED if turns else MAX_ROOT_SPEED
    return np.flatnonzero(np.linalg.norm(steps, axis=1) * fps > limit)


def _spans_around(jumps: np.ndarray, fps: float, frames: int) -> list[tuple[int, int]]:
    """Return first and last frame that is not trusted around each error of a clip.

    An error is a jump, or all between jumps in quick succession.
    """
    groups = np.split(jumps, np.flatnonzero(np.diff(jumps) > SAME_ERROR * fps) + 1) if len(jumps) else []
    ends = ((int(group[0]) + 1 - UNTRUSTED, int(group[-1]) + UNTRUSTED) for group in groups)
    return [(max(first, 0), min(last, frames - 1)) for first, last in ends]


def _runs(mask: np.ndarray) -> Iterator[tuple[int, int]]:
    """Yield first and last index of each run of true entries of a mask (T,)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(int), [0]])))
    return ((int(start), int(stop) - 1) for start, stop in zip(edges[::2], edges[1::2]))


def _bridge(track: np.ndarray, bad: np.ndarray, turns: bool) -> None:
    """Fill the bad frames (T,), not all of them, of a track (T, 3) in place."""
    for first, last in _runs(bad):
        before, after = first - 1, last + 1
        if before < 0 or after >= len(track):
            track[first : last + 1] = track[after if before < 0 else before]
            continue
        share = np.linspace(0.0, 1.0, after - before + 1)[1:-1]
        start, end = (np.tile(track[k], (last - first + 1, 1)) for k in (before, after))
        straight = start + share[:, None] * (end - start)
        track[first : last + 1] = slerp(start, end, share) if turns else straight
