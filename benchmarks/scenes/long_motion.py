"""Scenes of a thousand frames and more, for networks alone: does a garment end where it began?

Nobody simulates so long, so there is no body to collide with. Of ten thousand frames the body alone would
take gigabytes. Only some frames are kept: those of two stretches that show the same motion, early and late,
and of a loop one in fifty besides.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.scene import BuiltScene, Dressed, Scene
from reference_sim.energies.bend_hinge import BendHinge
from reference_sim.energies.gravity import Gravity
from reference_sim.energies.stretch_stvk import StretchStVK
from snug.motion.library import make_motion
from snug.motion.motion import Motion, transition

if TYPE_CHECKING:
    from benchmarks.assets import Assets

FRAMES, ENDS = 1000, 100  # there and back: at least so many in all, and at either end
LOOP_BLEND = 10  # frames from a loop's end to its start
EVERY = 50  # one frame in so many of a loop is kept


def build(scene: Scene, assets: Assets, *, loop_frames: int = 0) -> BuiltScene:
    """Build the scene of the motion in a loop of `loop_frames`, or there and back without that number."""
    if loop_frames:
        motion, early, late = looped(make_motion(scene.motion), loop_frames)
        kept = np.unique(np.concatenate([np.arange(0, loop_frames, EVERY), early, late]))
    else:
        motion = repeated_there_and_back(assets.motion(scene.motion, "whole"))
        early, late = np.arange(ENDS), np.arange(motion.frames - ENDS, motion.frames)
        kept = np.concatenate([early, late])
    garment = assets.garments[scene.garment]
    cloth = garment.cloth()
    return BuiltScene(
        name=scene.name,
        cloth=cloth,
        energies=(StretchStVK(cloth), BendHinge(cloth), Gravity(cloth)),
        dt=1.0 / motion.fps,
        frames=len(kept),
        settle=lambda: cloth.rest_positions,
        dressed=Dressed(assets.body, garment, motion),
        kept=kept,
        repeated=(np.searchsorted(kept, early), np.searchsorted(kept, late)),
    )


def repeated_there_and_back(motion: Motion) -> Motion:
    """Return the motion again and again, every second time backwards, for `FRAMES` frames or a few more.

    Its last hundred frames show the same as its first.
    """
    count = motion.frames
    period = np.concatenate([np.arange(count), np.arange(count - 2, 0, -1)])
    rounds = -(-(FRAMES - ENDS) // len(period))
    order = np.resize(period, rounds * len(period) + ENDS)
    return replace(motion, poses=motion.poses[order], translations=motion.translations[order])


def looped(walk: Motion, frames: int) -> tuple[Motion, np.ndarray, np.ndarray]:
    """Repeat the walk for so many frames, its end led back into its start.

    Returns:
        The motion, the frames of its second loop, and those of the last whole one.

    Raises:
        ValueError: fewer than three loops.
    """
    back = transition(walk.poses[-1], walk.poses[0], LOOP_BLEND + 2)[1:-1]
    poses = np.concatenate([walk.poses, back])
    loop = len(poses)
    if frames < 3 * loop:
        raise ValueError(f"a drift needs three loops, {3 * loop} frames, not {frames}")
    steps = np.diff(walk.translations, axis=0)
    # The way back adds no ground, and takes the height back to where it began.
    home = np.zeros((LOOP_BLEND + 1, 3))
    home[:, 1] = (walk.translations[0, 1] - walk.translations[-1, 1]) / len(home)
    loops = -(-frames // loop)
    moves = np.tile(np.concatenate([steps, home]), (loops, 1))[: frames - 1]
    translations = walk.translations[0] + np.concatenate([np.zeros((1, 3)), np.cumsum(moves, axis=0)])
    motion = replace(walk, poses=np.tile(poses, (loops, 1, 1))[:frames], translations=translations)
    last = (frames // loop - 1) * loop
    return motion, np.arange(loop, 2 * loop), np.arange(last, last + loop)
