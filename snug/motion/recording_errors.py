"""Glitches of a recording: numbers that are not finite, and jumps that no body makes. Named, or mended."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from snug.body.skeleton import JOINT_NAMES, axis_angles, rotation_matrices
from snug.motion.motion import MotionError, slerp
from snug.motion.raw_motion import RawMotion

# 30 degrees in 1/120 s: twice the fastest joint of a kick or a sprint. A swapped or lost marker does it.
FASTEST_TURN = np.deg2rad(30.0) * 120.0  # [rad/s]
FASTEST_PATH = 10.0  # [m/s] of the root: a sprinter's speed
TOGETHER = 0.25  # [s] two jumps closer than this bound one glitch
MARGIN = 2  # frames on either side of a jump that are not trusted
MOST = 0.25  # share of frames that may be wrong in a file that is mended
# A joint that turns further, or a root that is further away, was not written in radians or metres.
LARGEST_ANGLE = 4.0 * np.pi  # [rad] of all joints but the root, whose turns may have been added up
LARGEST_TURN = 1e3  # [rad] of the root
FARTHEST = 1e4  # [m]
NAMED = 4  # joints, and glitches of each, in a message; the others are counted


def without_glitches(recording: RawMotion, *, repair: bool) -> RawMotion:
    """The recording, all of its numbers finite and no jump in it; its source names what was mended.

    Mended: the shortest arc, or the straight line, between the good frames around a glitch; at an end of the
    clip the nearest good frame is held. Raises MotionError for a glitch without `repair`, and for what cannot
    be mended: too many, a jump that stays, other units.
    """
    poses, path = (np.where(np.isfinite(x), x, np.nan) for x in (recording.poses, recording.translations))
    _check_units(recording.path, poses, path)
    tracks = [(name, poses[:, joint], True) for joint, name in enumerate(JOINT_NAMES)]
    found: dict[str, list[str]] = {}
    wrong, stays = np.zeros(len(poses), dtype=bool), ""
    for name, track, turns in [*tracks, ("the root's path", path, False)]:
        missing = ~np.isfinite(track).all(axis=1)
        if missing.all():
            raise MotionError(f"{recording.path}: {name} is not finite in any frame; export it again")
        for first, last in _runs(missing):
            found.setdefault(f"{name} is not finite", []).append(f"{first}-{last}")
        _bridge(track, missing, turns)
        jumps = _jumps(track, turns, recording.fps)
        wrong |= missing
        wrong[jumps] = True
        for first, last in _spans_around(jumps, recording.fps, len(track)):
            found.setdefault(f"{name} jumps", []).append(f"{first}-{last}")
            around = np.zeros(len(track), dtype=bool)
            around[first : last + 1] = True
            if not around.all():
                _bridge(track, around, turns)
        for frame in _jumps(track, turns, recording.fps)[:1]:
            stays = stays or f"{name} jumps after frame {frame}"
    if not found:
        return recording
    named = _short([f"{what} in frames {_short(spans)}" for what, spans in found.items()])
    share = f"glitches in {100 * wrong.mean():.0f} % of the frames"
    if wrong.mean() > MOST:
        raise MotionError(f"{recording.path}: {share} ({named}); check frame rate and units, export it again")
    if not repair:
        raise MotionError(f"{recording.path}: {named}; give --repair to interpolate, or cut the clip")
    if stays:
        raise MotionError(f"{recording.path}: {stays} and stays where it is then; cut the clip there")
    return replace(recording, poses=poses, translations=path, source=f"{recording.source}; repaired: {named}")


def _short(items: list[str]) -> str:
    return ", ".join(items[:NAMED]) + f" and {len(items) - NAMED} more" * (len(items) > NAMED)


def _check_units(file: Path, poses: np.ndarray, path: np.ndarray) -> None:
    angles = np.linalg.norm(poses, axis=2)
    limits = np.full(angles.shape[1], LARGEST_ANGLE)
    limits[0] = LARGEST_TURN
    for frame, joint in np.argwhere(angles > limits)[:1]:
        raise MotionError(
            f"{file}: {JOINT_NAMES[joint]} turns by {angles[frame, joint]:.3g} rad in frame {frame}; write "
            "radians, not degrees"
        )
    for frame in np.flatnonzero((np.abs(path) > FARTHEST).any(axis=1))[:1]:
        raise MotionError(f"{file}: the root is more than {FARTHEST:g} m away in frame {frame}; write metres")


def _jumps(track: np.ndarray, turns: bool, fps: float) -> np.ndarray:
    """Frames k of a track (T, 3) with a jump to frame k + 1."""
    steps = np.diff(track, axis=0)
    if turns:
        rotations = rotation_matrices(track)
        steps = axis_angles(np.swapaxes(rotations[:-1], -1, -2) @ rotations[1:])
    return np.flatnonzero(np.linalg.norm(steps, axis=1) * fps > (FASTEST_TURN if turns else FASTEST_PATH))


def _spans_around(jumps: np.ndarray, fps: float, frames: int) -> list[tuple[int, int]]:
    """First and last frame that is not trusted around each glitch of a clip.

    A glitch is a jump, or all between jumps in quick succession.
    """
    groups = np.split(jumps, np.flatnonzero(np.diff(jumps) > TOGETHER * fps) + 1) if len(jumps) else []
    ends = ((int(group[0]) + 1 - MARGIN, int(group[-1]) + MARGIN) for group in groups)
    return [(max(first, 0), min(last, frames - 1)) for first, last in ends]


def _runs(mask: np.ndarray) -> Iterator[tuple[int, int]]:
    """First and last index of each run of true entries of a mask (T,)."""
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
