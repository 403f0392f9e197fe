"""Composition of the library, for docs/protocol.md and the CSV files next to it.

The recorded clips have roles and digests. A validation or test motion has a distance to the training poses
(`snug.motion.motion.nearest_pose`).
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache

import numpy as np

from snug.motion.library import DYNAMIC_VALIDATION, TEST, TRAIN, VALIDATION, make_motion
from snug.motion.motion import nearest_pose
from snug.motion.recorded.table import CLIPS, clip_of

ROLES = {
    "training": TRAIN,
    "validation": (*VALIDATION, *DYNAMIC_VALIDATION),
    "test": TEST,
}


def clip_rows() -> Iterator[tuple[str, ...]]:
    """Yield a heading and a row of each recorded clip: name, content, frames, role, digest."""
    yield "Clip", "Content", "Frames", "Role", "Digest"
    role_of = {clip_of(name): role for role, names in ROLES.items() for name in names}
    for name, (content, frames, digest) in CLIPS.items():
        yield f"`{name}`", content, str(frames), role_of[name], f"`{digest}`"


def distance_rows() -> Iterator[tuple[str, ...]]:
    """Yield a heading and a row of each test or validation motion: its distance [deg] to training poses."""
    yield "Motion", "Role", "Content", "Frames", "Mean distance [deg]", "Largest distance [deg]"
    for role in ("test", "validation"):
        for name in ROLES[role]:
            degrees = _distances(name)
            mean, largest = f"{degrees.mean():.1f}", f"{degrees.max():.1f}"
            yield f"`{name}`", role, _content(name), str(len(degrees)), mean, largest


def source_rows() -> Iterator[tuple[str, ...]]:
    """Yield a heading and a row of each independent source of test motions: a recording or one made by code.

    The distances [deg] to training poses are over the frames of all test motions of the source.
    """
    yield "Test motions", "Content", "Frames", "Mean distance [deg]", "Largest distance [deg]"
    motions: dict[str, list[str]] = {}
    for name in sorted(ROLES["test"], key=lambda name: (clip_of(name) not in CLIPS, name)):
        motions.setdefault(clip_of(name), []).append(name)
    for names in motions.values():
        degrees = np.concatenate([_distances(name) for name in names])
        listed = f"`{names[0]}` to `{names[-1]}`" if len(names) > 1 else f"`{names[0]}`"
        mean, largest = f"{degrees.mean():.1f}", f"{degrees.max():.1f}"
        yield listed, _content(names[0]), str(len(degrees)), mean, largest


def _content(name: str) -> str:
    motion = make_motion(name)
    return motion.kind if clip_of(name) in CLIPS else f"{motion.kind}, by code"


@cache
def _training_poses() -> np.ndarray:
    return np.concatenate([make_motion(name).poses for name in TRAIN])


@cache
def _distances(name: str) -> np.ndarray:
    """Return the distance of each frame of a motion to the nearest training pose, (T,) [deg]."""
    return np.rad2deg(nearest_pose(make_motion(name).poses, _training_poses()))
