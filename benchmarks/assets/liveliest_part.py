"""The liveliest part of a motion, for suite speed: whole motions would take hours.

A clip is the run of frames in which the joints are fastest on average, and the frames before it that are
simulated and not evaluated. It begins in the midst of the motion, with the cloth as it is there: simulated
from the motion's own start, see benchmarks.scenes.dressed_body.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np

    from snug.body.parametric_body import Body
    from snug.motion.motion import Motion


def liveliest_part(body: Body, motion: Motion, frames: int, warm_up: int = 0) -> range:
    """Return the liveliest `frames` frames and `warm_up` before them; all of a motion too short."""
    import numpy as np

    speed = joint_speeds(body, motion)
    sums = np.concatenate([[0.0], np.cumsum(speed)])
    steps = min(frames - 1, len(speed))
    before = min(warm_up, len(speed) - steps)
    start = int(np.argmax((sums[steps:] - sums[: len(sums) - steps])[before:]))
    return range(start, start + before + steps + 1)


def joint_speeds(body: Body, motion: Motion) -> np.ndarray:
    """Return the mean speed of the joints between two frames, (T - 1,) [m/s]."""
    import numpy as np

    transforms = body.transforms(motion.poses, motion.translations)
    joints = np.einsum("tjab,jb->tja", transforms[..., :3], body.joints()) + transforms[..., 3]
    return motion.fps * np.linalg.norm(np.diff(joints, axis=0), axis=2).mean(1)
