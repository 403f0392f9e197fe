"""Scenes of motions made hard for a network: too fast, too far, an extreme body, very long.

Walks made hard start in the walk's first pose and share its settled shirt; but for the extreme shapes,
which start in T-pose in the shirt's own rest shape, fitted to that body.

Nobody simulates a thousand frames and more. Of these only two stretches are kept that show the same motion,
early and late, and of a loop one frame in fifty besides.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.scene import BuiltScene, Dressed, Scene
from benchmarks.scenes.dressed_body import declare_energies, drape, dress, shape_of
from reference_sim.energies.bend_hinge import BendHinge
from reference_sim.energies.gravity import Gravity
from reference_sim.energies.stretch_stvk import StretchStVK
from snug.body.skeleton import JOINT, axis_angles, rotation_matrices
from snug.motion.library import make_motion
from snug.motion.motion import Motion, transition

if TYPE_CHECKING:
    from benchmarks.assets import Assets

ORDINARY_FRAMES = 44  # frames of the walk that the others are compared with
APPROACH = 12  # frames from the walk's first pose to another
STILL = 10  # frames for which a pose is kept, or a walk goes on
GLITCH = 12  # the frame that is wrong


def build_hard_motion(
    scene: Scene,
    assets: Assets,
    *,
    change: str,
    settle_frames: int,
    betas: tuple[float, ...] = (),
    material: Mapping[str, float] | None = None,
    **options: Any,
) -> BuiltScene:
    """Build the scene of the walk after `change`, one of CHANGES, with these options.

    betas: see dressed_body.shape_of, which says what is raised. material: factors on the material, of the
    simulator and of the energies that are measured.
    """
    body, garment = assets.body, assets.garments[scene.garment]
    motion = CHANGES[change](make_motion(scene.motion), **options)
    shape = shape_of(body, betas, scene.name)
    changed = {
        name: factor * getattr(garment.material, name) for name, factor in (material or {}).items()
    }
    cloth = garment.cloth(replace(garment.material, **changed))
    energies = declare_energies(cloth)

    def settle() -> np.ndarray:
        if shape is None:
            return drape(cloth, energies, dressed, settle_frames)
        root = body.transforms(motion.poses[:1], motion.translations[:1], shape)[0, 0]
        return garment.rest_for(body, shape) @ root[:, :3].T + root[:, 3]

    glitch = GLITCH if change in ("root_jumps", "limb_flips") else None
    dressed = Dressed(body, garment, motion, shape)
    return dress(scene, dressed, cloth=cloth, energies=energies, settle=settle, glitch=glitch)


def ordinary(walk: Motion) -> Motion:
    """Return the first frames of the walk, as they are."""
    return walk.cut(0, ORDINARY_FRAMES)


def faster(walk: Motion, times: int) -> Motion:
    """Return every `times`-th frame of the walk."""
    return replace(walk, poses=walk.poses[::times], translations=walk.translations[::times])


def another_faster(walk: Motion, times: int, other: str) -> Motion:
    """Return a way into the first pose of another motion, then that motion `times` faster."""
    motion = faster(make_motion(other), times)
    return _approach(walk, motion.poses, motion.translations)


def posed(walk: Motion, degrees: Mapping[str, tuple[float, float, float]]) -> Motion:
    """Return a way into the walk's first pose with some joints turned, and STILL frames there."""
    pose = walk.poses[0].copy()
    for joint, angles in degrees.items():
        pose[JOINT[joint]] = np.deg2rad(angles)
    return _approach(walk, np.repeat(pose[None], STILL, axis=0), np.zeros((STILL, 3)))


def from_t_pose(walk: Motion) -> Motion:
    """Return a way from T-pose into the walk's first pose, and STILL frames of the walk."""
    t_pose = np.zeros_like(walk.poses[0])
    t_pose[0] = walk.poses[0, 0]
    poses = np.concatenate([transition(t_pose, walk.poses[0], APPROACH), walk.poses[1:STILL]])
    start = np.repeat(walk.translations[:1], APPROACH, axis=0)
    return replace(walk, poses=poses, translations=np.concatenate([start, walk.translations[1:STILL]]))


def root_jumps(walk: Motion) -> Motion:
    """Return the walk with the root one metre to the side for a single frame."""
    motion = ordinary(walk)
    translations = motion.translations.copy()
    translations[GLITCH, 0] += 1.0
    return replace(motion, translations=translations)


def limb_flips(walk: Motion) -> Motion:
    """Return the walk with the left arm turned by 180 degrees about the chest's front for a frame."""
    motion, joint = ordinary(walk), JOINT["left_shoulder"]
    poses = motion.poses.copy()
    half = rotation_matrices(np.array([0.0, 0.0, np.pi]))
    poses[GLITCH, joint] = axis_angles(half @ rotation_matrices(poses[GLITCH, joint]))
    return replace(motion, poses=poses)


def _approach(walk: Motion, poses: np.ndarray, translations: np.ndarray) -> Motion:
    """Return the walk's first pose, a smooth way to poses[0], then poses; the root goes on from there."""
    way = transition(walk.poses[0], poses[0], APPROACH)
    stand = np.repeat(walk.translations[:1], APPROACH, axis=0)
    moved = walk.translations[0] + translations - translations[0]
    return replace(
        walk, poses=np.concatenate([way, poses[1:]]), translations=np.concatenate([stand, moved[1:]])
    )


CHANGES = {
    function.__name__: function
    for function in (ordinary, faster, another_faster, posed, from_t_pose, root_jumps, limb_flips)
}


FRAMES, ENDS = 1000, 100  # there and back: at least so many in all, and at either end
LOOP_BLEND = 10  # frames from a loop's end to its start
EVERY = 50  # one frame in so many of a loop is kept


def build_long_motion(scene: Scene, assets: Assets, *, loop_frames: int = 0) -> BuiltScene:
    """Build the scene of the motion in a loop of `loop_frames`, or there and back without that number."""
    if loop_frames:
        motion, early, late = repeat_walk(make_motion(scene.motion), loop_frames)
        frames = np.unique(np.concatenate([np.arange(0, loop_frames, EVERY), early, late]))
    else:
        motion = repeat_both_ways(assets.motion(scene.motion, "whole"))
        early, late = np.arange(ENDS), np.arange(motion.frames - ENDS, motion.frames)
        frames = np.concatenate([early, late])
    garment = assets.garments[scene.garment]
    cloth = garment.cloth()
    return BuiltScene(
        name=scene.name,
        cloth=cloth,
        energies=(StretchStVK(cloth), BendHinge(cloth), Gravity(cloth)),
        dt=1.0 / motion.fps,
        frames=len(frames),
        settle=lambda: cloth.rest_positions,
        dressed=Dressed(assets.body, garment, motion),
        kept=frames,
        repeated=(np.searchsorted(frames, early), np.searchsorted(frames, late)),
    )


def repeat_both_ways(motion: Motion) -> Motion:
    """Return the motion again and again, every second time backwards, for `FRAMES` frames or a round more.

    Its last hundred frames show the same as its first.
    """
    count = motion.frames
    period = np.concatenate([np.arange(count), np.arange(count - 2, 0, -1)])
    rounds = -(-(FRAMES - ENDS) // len(period))
    order = np.resize(period, rounds * len(period) + ENDS)
    return replace(motion, poses=motion.poses[order], translations=motion.translations[order])


def repeat_walk(walk: Motion, frames: int) -> tuple[Motion, np.ndarray, np.ndarray]:
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
