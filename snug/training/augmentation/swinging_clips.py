"""Training motions with turns and stops, which give a garment secondary motion, joined into one.

Secondary motion shows after a turn and a stop, and few motions have either. Each clip is played at
another speed; its trunk turns to and fro about the vertical, a random share of it from the pelvis; at a
random frame the body stops dead and holds still for up to a second. Joined into one long motion they need one
settled start, and the ways between them are motions too. Half of the clips are pieces of the original
motions: mixed ones alone hardly come near a pose that people take, and there the network then stretches the
cloth.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from snug.body.skeleton import JOINT, axis_angles, rotation_matrices
from snug.motion.clips.posture import SPINE_SHARES
from snug.motion.motion import (
    Motion,
    heading,
    mirror_motion,
    resample,
    smoothstep,
    transition,
    turn_about_vertical,
)

ORIGINAL_SHARE = 0.5  # of the clips: pieces of the original motions
SPEEDS = (0.6, 1.5)
TURN_HERTZ = (0.35, 1.8)  # of the turns
MAX_DEGREES, MAX_DEGREE_HERTZ = 65.0, 60.0  # to one side; and that times the frequency of the turns
HELD_FRAMES = 40  # frames, at most
TRANSITION_FRAMES = 16  # frames from one clip to the next
VERTICAL = np.array([0.0, 1.0, 0.0])


def make_swinging_motion(
    clips: Sequence[Motion], name: str, *, seed: int, originals: Sequence[Motion] = ()
) -> Motion:
    """Join the clips, changed so, to one motion; deterministic for a seed. 60 frames become some 80.

    Args:
        clips: mixed clips.
        name: of the motion.
        seed: of all random choices.
        originals: motions of which pieces take the place of a share ORIGINAL_SHARE of the clips.
    """
    random = np.random.default_rng(seed)
    joined = _swing(_choose_clip(clips[0], originals, random), random)
    for clip in clips[1:]:
        after = _swing(_choose_clip(clip, originals, random), random)
        height = after.translations[0] * VERTICAL
        # Each goes on the way the last one faced: to turn about on the spot in half a second is no motion.
        after = turn_about_vertical(after, heading(joined.poses[-1]) - heading(after.poses[0]))
        way = transition(joined.poses[-1], after.poses[0], TRANSITION_FRAMES + 1)[1:-1]
        # Horizontally it goes on where it was; it rises and falls with the timing of the joints.
        goal = joined.translations[-1] * [1.0, 0.0, 1.0] + height
        rise = goal - joined.translations[-1]
        s = np.linspace(0.0, 1.0, TRANSITION_FRAMES + 1)[1:-1, None]
        lifted = joined.translations[-1] + rise * smoothstep(s)
        joined = joined.followed_by(
            replace(
                after,
                poses=np.concatenate([way, after.poses]),
                translations=np.concatenate([lifted, after.translations + goal]),
            )
        )
    return replace(joined, name=name, kind="swinging")


def _choose_clip(clip: Motion, originals: Sequence[Motion], random: np.random.Generator) -> Motion:
    """Return the clip or, with probability ORIGINAL_SHARE, a piece of an original motion.

    The piece is mirrored half of the time.
    """
    if not originals or random.random() >= ORIGINAL_SHARE:
        return clip
    source = originals[int(random.integers(len(originals)))]
    if random.random() < 0.5:
        source = mirror_motion(source)
    start = int(random.integers(max(1, source.frames - clip.frames + 1)))
    return source.cut(start, start + clip.frames)


def _swing(clip: Motion, random: np.random.Generator) -> Motion:
    """Play a clip at another speed, turn its trunk to and fro, stop it at some frame and hold it."""
    clip = resample(replace(clip, fps=clip.fps * _draw_between(SPEEDS, random)), clip.fps)
    poses, hertz = clip.poses.copy(), _draw_between(TURN_HERTZ, random)
    degrees = min(MAX_DEGREES, MAX_DEGREE_HERTZ / hertz) * random.uniform(-1.0, 1.0)
    phase = 2 * np.pi * (hertz * np.arange(clip.frames) / clip.fps + random.random())
    hips = random.random()
    for joint, share in (("pelvis", hips), *((name, (1.0 - hips) * share) for name, share in SPINE_SHARES)):
        turn = rotation_matrices(share * np.deg2rad(degrees) * np.sin(phase)[:, None] * VERTICAL)
        poses[:, JOINT[joint]] = axis_angles(turn @ rotation_matrices(poses[:, JOINT[joint]]))
    stop = int(random.integers(clip.frames // 4, clip.frames))
    frames = np.minimum(np.arange(stop + 1 + random.integers(HELD_FRAMES + 1)), stop)
    return replace(clip, poses=poses[frames], translations=clip.translations[frames])


def _draw_between(limits: tuple[float, float], random: np.random.Generator) -> float:
    """Draw a number within limits, uniform in its logarithm."""
    return float(np.exp(random.uniform(*np.log(limits))))
