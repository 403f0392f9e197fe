"""Biovision motion capture (.bvh): a hierarchy of joints with offsets, and a line of channels per frame.

Format: M. Meredith and S. Maddock, Motion capture file formats explained, University of Sheffield, 2001.
The channels of a joint are applied to a column vector from the last to the first. With all of them zero
the joints stand at the sums of their offsets: the zero pose.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from snug.body.skeleton import LEG_LENGTH
from snug.file_options import MotionFileOptions
from snug.motion.motion import Motion, MotionError
from snug.motion.recording import finite_numbers, frame_rate, parse_lines
from snug.motion.retarget import FEET, LIMBS, match_joints, retarget, way_up

MAX_LEAN = 40.0  # [degrees] of the trunk in a zero pose, which replaces our upright one
CHANNELS = {f"{axis}{kind}" for kind in ("position", "rotation") for axis in "XYZ"}


@dataclass
class Joint:
    """A joint of the hierarchy. An end site is a joint without channels and without a name."""

    name: str
    parent: int  # index, -1 for the root
    offset: np.ndarray = field(default_factory=lambda: np.zeros(3))  # (3,) in the file's unit
    channels: tuple[str, ...] = ()  # "Xposition" and so on
    first: int = 0  # column of the frames at which its channels begin


def read_bvh(path: Path, options: MotionFileOptions) -> Motion:
    """Read a .bvh of one body, whatever its unit: the path is scaled by the length of the legs.

    Raises MotionError.
    """
    joints, frames, stated = parse_lines(path, _parse)
    fps = frame_rate(len(frames), stated, options.fps)
    parents = [joint.parent for joint in joints]
    matches = match_joints([joint.name for joint in joints], parents)
    places = np.zeros((len(parents), 3))
    for index, joint in enumerate(joints):
        places[index] = joint.offset + (places[joint.parent] if joint.parent >= 0 else 0.0)
    axes, leg = _find_axes({name: places[index] for name, index in matches.items()})
    places = places @ axes
    directions = {
        joint: places[matches[child]] - places[matches[joint]]
        for joint, child in (LIMBS | FEET).items()
        if child in matches
    }
    for ankle in FEET:
        if ankle in directions and directions[ankle][2] < -0.02 * leg:
            raise MotionError(f"{FEET[ankle]} points backwards; are left and right exchanged?")
    turned: dict[int, np.ndarray] = {}
    for index in sorted({link for joint in matches.values() for link in way_up(parents, joint)}):
        local = turns_of(joints[index], frames)
        turned[index] = turned[parents[index]] @ local if parents[index] >= 0 else local
    root, *chain = reversed(way_up(parents, matches["pelvis"]))
    pelvis = shift_of(joints[root], frames)
    for index in chain:
        pelvis = pelvis + np.einsum("tij,tj->ti", turned[parents[index]], shift_of(joints[index], frames))
    poses = retarget({name: turned[k] @ axes for name, k in matches.items()}, directions, {})
    source = f"{path.name} ({len(matches)} of 24 joints)"
    return Motion(path.stem, poses, LEG_LENGTH / leg * pelvis, fps, "recorded", source)


def turns_of(joint: Joint, frames: np.ndarray) -> np.ndarray:
    """Return the rotation of a joint relative to its parent, (T, 3, 3), in frames (T, C)."""
    rotation = Rotation.identity(len(frames))
    for column, channel in enumerate(joint.channels, joint.first):
        if channel.endswith("rotation"):
            turn = Rotation.from_euler(channel[0].lower(), frames[:, column, None], degrees=True)
            rotation = rotation * turn
    return rotation.as_matrix()


def shift_of(joint: Joint, frames: np.ndarray) -> np.ndarray:
    """Return a joint's place in its parent's axes, (T, 3): its positions, or its offset without any."""
    shift = np.tile(joint.offset, (len(frames), 1))
    for column, channel in enumerate(joint.channels, joint.first):
        if channel.endswith("position"):
            shift[:, "XYZ".index(channel[0])] = frames[:, column]
    return shift


def _find_axes(at: Mapping[str, np.ndarray]) -> tuple[np.ndarray, float]:
    """Return our axes as columns (3, 3) in the zero pose with joints `at` (3,), and the length of its leg.

    Up is the axis nearest to the direction from ankles to head; left leads from hip to hip. Raises
    MotionError.
    """
    hip, knee, ankle = (at[f"left_{joint}"] for joint in ("hip", "knee", "ankle"))
    leg = float(np.linalg.norm(hip - knee) + np.linalg.norm(knee - ankle))
    way = at["head"] - 0.5 * (at["left_ankle"] + at["right_ankle"])
    up = np.zeros(3)
    axis = np.abs(way).argmax()
    up[axis] = np.sign(way[axis])
    left = at["left_hip"] - at["right_hip"]
    left -= up * (up @ left)
    across = float(np.linalg.norm(left))
    if not (1e-6 < leg < 1e6 and across > 1e-3 * leg and up.any()):
        raise MotionError("legs or hips of its zero pose have no length; export it with offsets")
    trunk = at["head"] - at["pelvis"]
    if (lean := np.degrees(np.arctan2(np.linalg.norm(np.cross(up, trunk)), up @ trunk))) > MAX_LEAN:
        raise MotionError(
            f"its zero pose is no T or A pose: the trunk is turned by {lean:.0f} degrees; export it with a T "
            "pose at rest"
        )
    left /= across
    return np.stack((left, up, np.cross(left, up)), axis=1), leg


def _parse(lines: Iterator[list[str]]) -> tuple[list[Joint], np.ndarray, float | None]:
    """Return joints, parents first; numbers (T, C) of the frames; the rate [1/s]. Raises ValueError."""
    _expect(lines, "HIERARCHY")
    joints = _hierarchy(lines)
    columns = joints[-1].first + len(joints[-1].channels)
    _expect(lines, "MOTION")
    [declared] = finite_numbers(_expect(lines, "Frames:"), 1)
    [seconds] = finite_numbers(_expect(lines, "Frame", "Time:"), 1)
    rows = [np.array(finite_numbers(tokens, columns)) for tokens in lines]
    if len(rows) != declared:
        raise ValueError(f"declares {declared:g} frames and holds {len(rows)}")
    return joints, np.reshape(rows, (len(rows), columns)), 1.0 / seconds if seconds else None


def _expect(lines: Iterator[list[str]], *expected: str) -> list[str]:
    """Return what follows these words, in any case, on the next line, or raise ValueError."""
    tokens = next(lines, [])
    if [word.lower() for word in tokens[: len(expected)]] != [word.lower() for word in expected]:
        header = " ".join(expected)
        raise ValueError(f"'{' '.join(tokens)[:40]}' where '{header}' should be; is it a .bvh file?")
    return tokens[len(expected) :]


def _hierarchy(lines: Iterator[list[str]]) -> list[Joint]:
    """Return the joints of the lines up to the brace that closes the root. Raises ValueError."""
    joints: list[Joint] = []
    stack: list[int] = []  # open joints
    columns = 0
    while not joints or stack:
        line = next(lines, ["the end"])
        word, *tokens = line
        word = word.lower()
        if word == ("joint" if joints else "root") or (word == "end" and joints):
            name = "" if word == "end" else " ".join(tokens)
            if name and name in [joint.name for joint in joints]:
                raise ValueError(f"joint '{name[:40]}' has a name that is taken")
            joints.append(Joint(name, stack[-1] if stack else -1, first=columns))
            stack.append(len(joints) - 1)
            _expect(lines, "{")
        elif word == "offset" and stack:
            joints[stack[-1]].offset = np.array(finite_numbers(tokens, 3))
        elif word == "channels" and stack[-1:] == [len(joints) - 1] and not joints[-1].channels:
            joints[-1].channels = tuple(word.capitalize() for word in tokens[1:])
            columns += len(joints[-1].channels)
            names = CHANNELS.intersection(joints[-1].channels)
            if not tokens[:1] == [str(len(tokens) - 1)] == [str(len(names))]:
                raise ValueError(f"'{' '.join(line)[:60]}' declares other channels than it names")
        elif word == "}" and stack:
            stack.pop()
        else:
            raise ValueError(f"'{' '.join(line)[:40]}' is not known in a hierarchy, or out of place")
    return joints
