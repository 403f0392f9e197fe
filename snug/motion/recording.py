"""Steps that the readers of motion files share: lines of text, frame rate, recording errors, vertical axis.

Their errors name no file; `snug.motion.files.read_motion` puts it in front.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

import numpy as np

from reference_sim.given_files import demand_file
from snug.body.skeleton import (
    BODY_JOINTS,
    JOINT,
    JOINT_NAMES,
    PARENTS,
    REST_JOINTS,
    axis_angles,
    joint_positions,
    rotation_matrices,
    turn_joint,
)
from snug.motion.motion import Motion, MotionError

Content = TypeVar("Content")

MAX_TEXT_BYTES = 64 << 20  # [bytes] of a file of text
MAX_FRAMES = 100_000  # 14 minutes at 120 frames per second
MAX_SECONDS = 1800.0  # [s] a clip of few frames per second becomes many at 30
LOWEST_RATE, HIGHEST_RATE = 5.0, 1000.0  # [1/s] rates of frames that a recording may have


def parse_lines(
    path: Path, parse: Callable[[Iterator[list[str]]], Content], comment: str = "\0"
) -> Content:
    """Return what `parse` makes of the lines of a text file, each a list of words.

    Lines without a word are left out, and what follows the letter `comment`.

    Raises:
        MotionError: the file cannot be read or is too large, or names the line at which `parse` raised
            ValueError.
    """
    try:
        if demand_file(path).stat().st_size > MAX_TEXT_BYTES:
            raise MotionError(f"larger than {MAX_TEXT_BYTES >> 20} MB; cut the clip")
        lines = path.read_text(encoding="utf-8-sig", errors="replace").splitlines()
    except OSError as problem:
        raise MotionError(f"cannot be read ({problem.strerror or problem}); check the path") from None
    unread = iter(lines)
    rows = (line.partition(comment)[0].split() for line in unread)
    try:
        return parse(filter(None, rows))
    except ValueError as problem:
        number = len(lines) - len(list(unread))
        raise MotionError(f"line {number}: {str(problem)[:300]}; export the file again") from None


def finite_numbers(tokens: Sequence[str], count: int) -> list[float]:
    """Return tokens as `count` finite numbers. Raises ValueError."""
    values = [float(word) for word in tokens]
    if len(values) != count or not all(map(math.isfinite, values)):
        raise ValueError(f"'{' '.join(tokens)[:60]}' should be {count} finite numbers")
    return values


def frame_rate(
    frames: int, stated: float | None, option: float | None, usual: float | None = None
) -> float:
    """Return the frames per second [1/s]: of the file, else of the options, else `usual` for such files.

    Raises:
        MotionError: there is none of them, file and options disagree, no recording has that rate, or the
            clip has no frame, more than MAX_FRAMES, or more than MAX_SECONDS.
    """
    if stated is not None and option is not None and abs(stated - option) > 0.01 * stated:
        raise MotionError(f"states {stated:g} frames per second, fps={option:g} is given; leave it out")
    fps = next((value for value in (stated, option, usual) if value is not None), None)
    if fps is None:
        raise MotionError("states no frame rate; add ,fps=N behind the path")
    if not LOWEST_RATE <= fps <= HIGHEST_RATE:
        raise MotionError(f"{fps:g} frames per second; rates are {LOWEST_RATE:g} to {HIGHEST_RATE:g}")
    if not 0 < frames <= min(MAX_FRAMES, MAX_SECONDS * fps):
        limits = f"1 to {MAX_FRAMES} frames and at most {MAX_SECONDS:.0f} s are read"
        raise MotionError(f"{frames} frames, which last {frames / fps:.0f} s; {limits}: cut the clip")
    return fps


# 30 degrees in 1/120 s: twice the fastest joint of a kick or a sprint. A swapped or lost marker does it.
MAX_TURN_SPEED = np.deg2rad(30.0) * 120.0  # [rad/s]
MAX_ROOT_SPEED = 10.0  # [m/s] of the root: a sprinter's speed
# A joint that turns further, or a root that is further away, was not written in radians or metres.
MAX_ANGLE = 4.0 * np.pi  # [rad] of a joint; turns of the root may add up
MAX_ROOT_ANGLE = 1e3  # [rad] of the root
MAX_DISTANCE = 1e4  # [m]


def check_recording(motion: Motion) -> None:
    """Raise MotionError for other units and for jumps; the message names joints and first frames."""
    angles = np.linalg.norm(motion.poses, axis=2)
    if (angles[:, 1:] > MAX_ANGLE).any() or (angles[:, 0] > MAX_ROOT_ANGLE).any():
        raise MotionError("a joint turns by more than a person's; write radians, not degrees")
    if (np.abs(motion.translations) > MAX_DISTANCE).any():
        raise MotionError(f"the root is more than {MAX_DISTANCE:g} m away; write metres")
    rotations = rotation_matrices(motion.poses)
    turns = axis_angles(np.swapaxes(rotations[:-1], -1, -2) @ rotations[1:]) / MAX_TURN_SPEED
    shifts = np.diff(motion.translations, axis=0)[:, None] / MAX_ROOT_SPEED
    speeds = np.linalg.norm(np.concatenate([turns, shifts], axis=1), axis=2) * motion.fps
    errors = [
        f"{name} before frame {jumps.argmax() + 1}"
        for name, jumps in zip((*JOINT_NAMES, "the root"), (speeds > 1.0).T, strict=True)
        if jumps.any()
    ]
    if errors:
        first = ", ".join(errors[:4])
        raise MotionError(f"jumps, first of {first}; cut the clip there, or check frame rate and units")


MAX_BONE_CHANGE = 0.05  # share of a bone's length by which tracked joints may vary
# Ratio between most bones' lengths, each relative to ours: a child's are near an adult's.
MAX_BONE_RATIO = 2.0


def are_positions(triples: np.ndarray) -> bool:
    """Return whether triples (T, J, 3) of a body's joints are their positions, in any unit.

    Positions: most joints keep their distance to another one, though they move; or the bones have the
    proportions of a person's in most frames, with the joints in our order. Rotations do neither.
    """
    part = triples[:: -(-len(triples) // 100), :BODY_JOINTS]
    distances = np.linalg.norm(part[:, :, None] - part[:, None], axis=-1)
    moved = np.linalg.norm(part.std(axis=0), axis=-1)
    rigid = distances.std(axis=0) < MAX_BONE_CHANGE * np.minimum(distances.mean(axis=0), moved[:, None])
    start, end = list(PARENTS[1:BODY_JOINTS]), list(range(1, BODY_JOINTS))
    ratios = distances[:, start, end] / np.linalg.norm(REST_JOINTS[end] - REST_JOINTS[start], axis=1)
    low, high = np.quantile(ratios, (0.1, 0.9))
    return bool(rigid.any(axis=1).mean() > 0.8 or 0.0 < high < MAX_BONE_RATIO * low)


# From the axes of a file, by the one that is vertical, to ours: with z up (x, y, z) becomes (x, z, -y).
TO_Y_UP = {"y": np.eye(3), "z": np.array([[1.0, 0, 0], [0, 0, 1.0], [0, -1.0, 0]])}
# Between the vertical and the way from ankles to head: below it a body lies or crawls.
MAX_LYING_COSINE = 0.3
# Between trunk and legs of a person who is bent as far as one can be.
MAX_FOLD_COSINE = -0.8
# [m] by which the lowest joint rises, each second's lowest: a jump comes down again.
MAX_RISE = 1.0
# [m] across the body, which one that lies does not go; [rad/m] of one that rolls there.
TRAVEL, ROLL = 1.0, 3.0
# [m] between the floor and height 0, of a body that stands and of one that lies.
FLOOR_ROOM, LYING_ROOM = 0.35, 0.1
# [m] of a wrist, knee or foot above the lowest joint; a crawling pelvis is twice as high.
ON_FLOOR = 0.15
WRISTS = [JOINT[f"{side}_wrist"] for side in ("left", "right")]
LEGS = [JOINT[f"{side}_{name}"] for name in ("knee", "foot") for side in ("left", "right")]


def turn_y_up(motion: Motion, up: str) -> Motion:
    """Turn a motion in the axes of its file so that y is up.

    In a frame the body points along the axis that is nearest to the direction from its ankles to its
    head. The axis of more than half of the frames is taken, if the body stands along it on its feet; one
    that lies in the others, as after a fall, is fine. A given axis `up`, "y" or "z", is taken whether the
    body stands, crawls or lies.

    Raises:
        MotionError: no axis is that, or the body may lie along it; the body walks along another axis than
            the given one, or hangs from it head down; the trunk is folded on the legs.
    """
    joints = joint_positions(motion.poses, motion.translations)
    ankles = joints[:, [JOINT["left_ankle"], JOINT["right_ankle"]]].mean(axis=1)
    trunk, legs = joints[:, JOINT["head"]] - joints[:, 0], joints[:, 0] - ankles
    directions = (trunk + legs) / np.maximum(np.linalg.norm(trunk + legs, axis=1, keepdims=True), 1e-9)
    nearest = np.concatenate([directions, -directions], axis=1).argmax(axis=1)
    shares = {axis: np.mean(nearest == "xyz".index(axis)) for axis in TO_Y_UP}
    axis = up or max(shares, key=lambda axis: shares[axis])
    share, along = f"{100 * shares[axis]:.0f} % of the frames", "xyz".index(axis)
    pointed = int(np.bincount(nearest % 3).argmax())
    heights = joints[..., along]
    hangs = heights[:, WRISTS].min(axis=1) > heights[:, JOINT["head"]]
    hangs &= directions[:, along] < -MAX_LYING_COSINE
    walks = pointed != along and (nearest % 3 == pointed).mean() > 0.5 and _walks(motion, pointed)
    if hangs.mean() > 0.5 or walks or (not up and shares[axis] <= 0.5):
        raise MotionError(
            f"the body stands along {axis} in {share} only; add ,up=y or ,up=z behind the path, "
            "turn the root's rotation and path, or give a clip that stands"
        )
    folds = np.einsum("ti,ti->t", trunk, legs) / np.linalg.norm(trunk, axis=1)
    folds /= np.maximum(np.linalg.norm(legs, axis=1), 1e-9)
    if (low := np.mean(folds < (MAX_FOLD_COSINE if up else -MAX_LYING_COSINE))) > 0.5:
        raise MotionError(
            f"the head is not above the pelvis in {100 * low:.0f} % of the frames; export it with a T pose "
            "at rest and rotations relative to the parent joint, or give a clip that stands"
        )
    if not up and (doubt := _doubt(motion, joints, along)):
        raise MotionError(
            f"the body points along {axis} in {share}, but {doubt}: it may lie or crawl; "
            "add ,up=y or ,up=z behind the path"
        )
    note = f"{up} up as given" if up else f"{axis} up, as the body stands in {share}"
    poses, turn = motion.poses.copy(), TO_Y_UP[axis]
    turn_joint(poses, 0, turn)
    translations = motion.translations @ turn.T
    return replace(motion, poses=poses, translations=translations, source=f"{motion.source}; {note}")


def _walks(motion: Motion, along: int) -> bool:
    """Return whether a body that points along that axis travels across it, and does not roll."""
    across = [(along + 1) % 3, (along + 2) % 3]
    path = motion.translations[:, across]
    travel = float(np.linalg.norm(path - path[0], axis=1).max())
    facing = rotation_matrices(motion.poses[:, 0])[:, across, 2]
    turned = np.ptp(np.unwrap(np.arctan2(facing[:, 1], facing[:, 0])))
    return travel > TRAVEL and turned < ROLL * travel


def _doubt(motion: Motion, joints: np.ndarray, along: int) -> str:
    """Return why a body that points along that axis may not stand along it, or empty.

    joints: (T, 24, 3) [m]. Heights are of the file, whose floor is at 0, or of the root where one that
    stands has 0.
    """
    from scipy.ndimage import minimum_filter1d  # slow to load; names are listed without

    heights = joints - joints.min(axis=1, keepdims=True)
    floors = motion.translations - heights[:, 0]
    lows = minimum_filter1d(floors[:, along], max(1, round(motion.fps)), mode="nearest")
    if (rise := float(np.ptp(lows))) > MAX_RISE:
        return f"its lowest joint moves by {rise:.3g} m along it"
    floor = np.median(floors, axis=0)
    offs = np.minimum(np.abs(floors), np.abs(floors + REST_JOINTS[0, 1]))
    walks = _walks(motion, along)
    for axis in {1, 2} - {along}:
        touch = heights[..., axis] < ON_FLOOR
        crawls = touch[:, WRISTS].all(axis=1)
        crawls &= touch[:, LEGS].any(axis=1)
        crawls &= heights[:, 0, axis] > 2 * ON_FLOOR
        if crawls.mean() > 0.5:
            return "wrists and feet, or knees, are on one level beside it"
        flat = np.quantile(offs[:, axis], 0.9) < LYING_ROOM
        raised = abs(np.median(motion.translations[:, axis])) > LYING_ROOM / 2
        if flat and raised and not walks and abs(floor[along]) > FLOOR_ROOM:
            return f"lies at height 0 along {'xyz'[axis]}"
    if np.median(offs[:, along]) > FLOOR_ROOM and not walks:
        return f"stays in place with its feet at {floor[along]:.3g} m, not on a floor at 0"
    return ""
