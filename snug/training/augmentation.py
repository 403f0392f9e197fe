"""Augmented training motions: limbs of different clips put together, mirrored, and turned a little.

Recorded clips show a network few combinations of legs, spine and arms.
A mixed clip takes the root, the spine, each leg and each arm from six random places of the training clips
(mirrored half of the time), scales legs and spine, adds to each joint that carries cloth a slow turn
about a random axis, lifts some thighs, hangs each arm at a random distance from the torso, and opens the
hips where a thigh comes too near to it. Every part stays continuous in time.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import torch

from snug.body.skeleton import JOINT, axis_angles, rotation_matrices, turn_joint
from snug.kinds import Kind
from snug.motion.motion import Motion, arm_clearance, lap_clearance, mirror_motion
from snug.networks.dressed_body import DressedBody
from snug.recipe import DEFAULT, Recipe
from snug.training.training_set import TrainingSet

BODY_PARTS: tuple[tuple[str, ...], ...] = (
    ("pelvis",),
    ("left_hip", "left_knee", "left_ankle", "left_foot"),
    ("right_hip", "right_knee", "right_ankle", "right_foot"),
    ("spine1", "spine2", "spine3", "neck", "head"),
    ("left_collar", "left_shoulder", "left_elbow", "left_wrist", "left_hand"),
    ("right_collar", "right_shoulder", "right_elbow", "right_wrist", "right_hand"),
)
# Of legs and spine; an arm swung further might enter the torso.
PART_SCALES = dict.fromkeys((1, 2, 3), (0.6, 1.3))
# Degrees between upper arm and spine where an arm of a clip comes nearest. The lower end is where
# recorded arms are spread to (snug.motion.motion.ARMS_CLEAR): nearer, sleeves are pinched.
ARM_DEGREES = (25.0, 50.0)
# Degrees between thigh and spine: a hip bends by about 120 and no further. At 40, as a squat under the
# spine of a bow has it, thighs enter the belly, and no hem between them is free.
HIP_DEGREES = 60.0
# degrees, at most: a lifted thigh comes up and goes down again by a random part of it
LIFT_DEGREES = 90.0
# Turn of each joint, relative to the recipe's; the collar bone turns little, the shoulder most.
TURN_SHARES = {
    "pelvis": 1.0, "spine1": 1.0, "spine2": 1.0, "spine3": 1.0, "left_hip": 1.2, "right_hip": 1.2,
    "left_shoulder": 2.0, "right_shoulder": 2.0, "left_collar": 0.4, "right_collar": 0.4, "neck": 1.0,
    "head": 1.0,
}  # fmt: skip
TURN_HERTZ = (0.2, 1.0)  # Hz, of the slow turns and lifts
LIFTED = 0.25  # share of the thighs that are lifted
CLIP_FRAMES = 60  # of a mixed clip
MAX_AUGMENTED_FRAMES = 20_000  # frames: each keeps its body and its anchors
SHARED_SEED = 0  # of clips that are simulated: once, whatever the seed of the training
MAX_ANCHOR_BYTES = 2e9  # bytes, of those of mixed frames
ANCHOR_BYTES = 24  # bytes of a frame's for each vertex: six samples, four bytes each
HIPS, SIDEWAYS = (JOINT["left_hip"], JOINT["right_hip"]), np.array([1.0, 0.0, 0.0])
SHOULDERS, FRONT = (JOINT["left_shoulder"], JOINT["right_shoulder"]), np.array([0.0, 0.0, 1.0])
SHAPE_STREAM = 1  # stream of random numbers beside that of the clips
HIP_ROUNDS = 5  # leave less than a degree missing, almost always


def augment(motions: Sequence[Motion], recipe: Recipe, *, vertices: int, seed: int) -> list[Motion]:
    """Return the clips that a recipe adds to the motions, for a garment of that number of vertices."""
    original = sum(motion.frames for motion in motions)
    frames = min(
        round(recipe.mixed * original),
        MAX_AUGMENTED_FRAMES,
        int(MAX_ANCHOR_BYTES / (ANCHOR_BYTES * vertices)),
    )
    return make_mixed_clips(motions, frames, turn=recipe.turn, lifted=LIFTED, seed=seed)


def make_shared_clips(
    motions: Sequence[Motion], share: int, *, turns: float, vertices: int
) -> list[Motion]:
    """Return clips to simulate for the trainings of all seeds, mixed as the default recipe does.

    share: augmented frames for each original one. The clips of a smaller share are the first of a larger.
    turns: share of that recipe's turns.
    """
    recipe = replace(DEFAULT, mixed=float(share), turn=turns * DEFAULT.turn)
    return augment(motions, recipe, vertices=vertices, seed=SHARED_SEED)


def make_mixed_clips(
    motions: Sequence[Motion], frames: int, *, turn: float, lifted: float, seed: int
) -> list[Motion]:
    """Make about `frames` frames of mixed clips, named mixed_0, mixed_1, ...; deterministic for a seed.

    turn: standard deviation of the added turns, per axis [rad]; lifted: share of the thighs that are
    lifted.
    """
    random = np.random.default_rng(seed)
    count = max(1, round(frames / CLIP_FRAMES)) if frames > 0 else 0
    return [_mix(motions, random, turn, lifted, f"mixed_{number}") for number in range(count)]


def _mix(
    motions: Sequence[Motion], random: np.random.Generator, turn: float, lifted: float, name: str
) -> Motion:
    poses = np.zeros((CLIP_FRAMES, len(JOINT), 3))
    translations = np.zeros((CLIP_FRAMES, 3))
    fps = motions[0].fps
    for number, part in enumerate(BODY_PARTS):
        source = motions[int(random.integers(len(motions)))]
        if random.random() < 0.5:
            source = mirror_motion(source)
        start = random.integers(max(1, source.frames - CLIP_FRAMES + 1))
        # A clip that is too short rests at its end.
        frames = np.minimum(np.arange(start, start + CLIP_FRAMES), source.frames - 1)
        scale = random.uniform(*PART_SCALES.get(number, (1.0, 1.0)))
        joints = [JOINT[joint] for joint in part]
        poses[:, joints] = scale * source.poses[frames][:, joints]
        if number == 0:
            translations = source.translations[frames]
    seconds = np.arange(CLIP_FRAMES)[:, None] / fps
    for joint, share in TURN_SHARES.items():
        stays, swings = random.normal(0.0, share * turn, (2, 3))
        phase = 2 * np.pi * (random.uniform(*TURN_HERTZ) * seconds + random.random())
        added = rotation_matrices(stays + swings * np.sin(phase))
        poses[:, JOINT[joint]] = axis_angles(rotation_matrices(poses[:, JOINT[joint]]) @ added)
    for hip in HIPS:
        height = random.uniform(0.0, np.deg2rad(LIFT_DEGREES)) * (random.random() < lifted)
        phase = 2 * np.pi * (random.uniform(*TURN_HERTZ) * seconds + random.random())
        turn_joint(poses, hip, rotation_matrices(-0.5 * height * (1 + np.sin(phase)) * SIDEWAYS))
    mixed = open_hips(Motion(name, poses, translations, fps=fps, kind="mixed"))
    return hang_arms(mixed, np.deg2rad(random.uniform(*ARM_DEGREES, 2)))


def hang_arms(motion: Motion, nearest: np.ndarray) -> Motion:
    """Turn each shoulder about the chest's front axis, by one angle in all frames.

    The angle is that which brings the smallest angle between upper arm and downward spine to `nearest`,
    (2,) [rad], left and right, where the arm is square to that axis; others end elsewhere.
    """
    poses = motion.poses.copy()
    outward = (nearest - arm_clearance(motion).min(axis=0)) * [1.0, -1.0]
    for shoulder, angle in zip(SHOULDERS, outward):
        turn_joint(poses, shoulder, rotation_matrices(angle * FRONT))
    return replace(motion, poses=poses)


def open_hips(motion: Motion) -> Motion:
    """Turn each thigh back, in the frames where it is nearer to the spine than HIP_DEGREES.

    It turns about the axis through the hips, which a thigh to the side is not square to: hence
    repeatedly.
    """
    for _ in range(HIP_ROUNDS):
        turns = np.maximum(0.0, np.deg2rad(HIP_DEGREES) - lap_clearance(motion))
        poses = motion.poses.copy()
        for hip, angles in zip(HIPS, turns.T):
            turn_joint(poses, hip, rotation_matrices(angles[:, None] * SIDEWAYS))
        motion = replace(motion, poses=poses)
    return motion


def varies_shape(kind: Kind, dressed: DressedBody, recipe: Recipe) -> bool:
    """Return whether the network is trained on bodies of several shapes."""
    reads_shape = kind.physics and kind.network.feature_set == "motion"
    return bool(recipe.shape_range and dressed.body.shape_count and reads_shape)


def make_training_set(
    kind: Kind,
    dressed: DressedBody,
    motions: Sequence[Motion],
    recipe: Recipe,
    *,
    seed: int,
    device: torch.device,
) -> TrainingSet:
    """Make the training set: the motions and, if the energies teach the network, augmented clips.

    Where clips have shapes, the recipe's share of them has numbers from its U(-r, r); all else the mean
    body.
    """
    clips = augment(motions, recipe, vertices=dressed.vertices, seed=seed) if kind.physics else []
    shapes = None
    if varies_shape(kind, dressed, recipe) and recipe.shape_of == "clip":
        count, random = dressed.body.shape_count, np.random.default_rng([seed, SHAPE_STREAM])
        drawn = recipe.shape_range * random.uniform(-1.0, 1.0, (len(clips), count))
        drawn[random.random(len(clips)) >= recipe.shape_share] = 0.0
        shapes = np.concatenate([np.zeros((len(motions), count)), drawn])
    return TrainingSet(
        dressed, [*motions, *clips], recipe, features=kind.network.feature_set,
        sequences=kind.network.sequential, device=device, shapes=shapes,
    )  # fmt: skip
