"""Print the composition of the library, as docs/protocol.md has it: python -m snug.motion.composition.

The first table has the recorded clips with their roles and digests. The second has the distance of each
validation and test motion to the training poses (`snug.motion.motion.nearest_pose`).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from snug.motion.library import DYNAMIC_VALIDATION, TEST, TRAIN, VALIDATION, make_motion
from snug.motion.motion import nearest_pose
from snug.motion.recorded.table import CLIPS, clip_of

ROLES = {
    "training": TRAIN,
    "validation": (*VALIDATION, *DYNAMIC_VALIDATION),
    "test": TEST,
}


def composition() -> str:
    """Return both tables in Markdown."""
    clips = _table(("clip", "content", "frames", "role", "digest"), _clip_rows())
    title = ("motion", "role", "content", "frames", "mean distance [deg]", "largest distance [deg]")
    return f"{clips}\n\n{_table(title, _distance_rows())}"


def _clip_rows() -> Iterator[tuple[str, ...]]:
    role_of = {clip_of(name): role for role, names in ROLES.items() for name in names}
    for name, (content, frames, digest) in CLIPS.items():
        yield f"`{name}`", content, str(frames), role_of[name], f"`{digest}`"


def _distance_rows() -> Iterator[tuple[str, ...]]:
    known = np.concatenate([make_motion(name).poses for name in TRAIN])
    for role in ("test", "validation"):
        for name in ROLES[role]:
            motion = make_motion(name)
            degrees = np.rad2deg(nearest_pose(motion.poses, known))
            content = motion.kind if clip_of(name) in CLIPS else f"{motion.kind}, by code"
            mean, largest = f"{degrees.mean():.1f}", f"{degrees.max():.1f}"
            yield f"`{name}`", role, content, str(motion.frames), mean, largest


def _table(title: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [title, ["---"] * len(title), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


if __name__ == "__main__":
    print(composition())
