"""The liveliest part of a motion: what suite speed looks at, where whole motions would take hours.

A clip is the run of frames in which the joints are fastest on average. It begins in the midst of the motion:
the garment is settled in its first pose and then has to come along.
"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np

    from snug.body import Body
    from snug.motion import Motion


def clip(body: Body, motion: Motion, frames: int) -> Motion:
    """The liveliest `frames` frames of the motion, or all of it, under the name "<motion>@clip"."""
    import numpy as np

    speed = joint_speeds(body, motion)
    sums = np.concatenate([[0.0], np.cumsum(speed)])
    steps = min(frames - 1, len(speed))
    start = int(np.argmax(sums[steps:] - sums[: len(sums) - steps]))
    return dataclasses.replace(motion.cut(start, start + steps + 1), name=f"{motion.name}@clip")


def joint_speeds(body: Body, motion: Motion) -> np.ndarray:
    """Mean speed of the joints between two frames, (T - 1,) [m/s]."""
    import numpy as np

    transforms = body.transforms(motion.poses, motion.translations)
    joints = np.einsum("tjab,jb->tja", transforms[..., :3], body.joints()) + transforms[..., 3]
    return motion.fps * np.linalg.norm(np.diff(joints, axis=0), axis=2).mean(1)
