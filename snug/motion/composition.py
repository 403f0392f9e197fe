"""Composition of the library, for docs/protocol.md.

The recorded clips have roles and digests. A validation or test motion has a distance to the training poses
(`snug.motion.motion.nearest_pose`).
"""

from __future__ import annotations

from collections.abc import Iterator

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
    known = np.concatenate([make_motion(name).poses for name in TRAIN])
    for role in ("test", "validation"):
        for name in ROLES[role]:
            motion = make_motion(name)
            degrees = np.rad2deg(nearest_pose(motion.poses, known))
            content = motion.kind if clip_of(name) in CLIPS else f"{motion.kind}, by code"
            mean, largest = f"{degrees.mean():.1f}", f"{degrees.max():.1f}"
            yield f"`{name}`", role, content, str(motion.frames), mean, largest
