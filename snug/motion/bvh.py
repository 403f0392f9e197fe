"""Biovision motion capture (.bvh): a hierarchy of joints with offsets, and a line of channels per frame.

Format: M. Meredith and S. Maddock, Motion capture file formats explained, University of Sheffield, 2001.
The channels of a joint are applied to a column vector from the last to the first. With all of them zero the
joints stand at the sums of their offsets: the zero pose.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from snug.motion.motion import MotionError
from snug.motion.raw_motion import Line, check_frame_count, read_lines

MAX_JOINTS = 1000
MAX_ROTATIONS = 5_000_000  # joints times frames: 11 minutes of 60 joints at 120 frames per second
CHANNELS = tuple(f"{axis}{kind}" for kind in ("position", "rotation") for axis in "XYZ")


@dataclass
class Joint:
    """A joint of the hierarchy. An end site is a joint without channels and without a name.

    Attributes:
        parent: index, -1 for the root.
        offset: (3,) in the file's unit.
        channels: "Xposition" and so on, from column `first` of the frames on.
    """

    name: str
    parent: int
    offset: np.ndarray = field(default_factory=lambda: np.zeros(3))
    channels: tuple[str, ...] = ()
    first: int = 0


@dataclass(frozen=True)
class BvhClip:
    """A parsed file.

    Attributes:
        joints: parents first.
        frames: (T, C) numbers.
        fps: frames per second [1/s], None where the file states none.
    """

    joints: list[Joint]
    frames: np.ndarray
    fps: float | None

    def turns(self, joint: Joint) -> np.ndarray:
        """Return the rotation of a joint relative to its parent, (T, 3, 3)."""
        rotation = Rotation.identity(len(self.frames))
        for column, channel in enumerate(joint.channels, joint.first):
            if channel.endswith("rotation"):
                angles = self.frames[:, column, None]
                rotation = rotation * Rotation.from_euler(channel[0].lower(), angles, degrees=True)
        return rotation.as_matrix()

    def shift(self, joint: Joint) -> np.ndarray:
        """Return a joint's place in its parent's axes, (T, 3): its positions, or its offset without any."""
        shift = np.tile(joint.offset, (len(self.frames), 1))
        for column, channel in enumerate(joint.channels, joint.first):
            if channel.endswith("position"):
                shift[:, "XYZ".index(channel[0])] = self.frames[:, column]
        return shift


def read_clip(path: Path) -> BvhClip:
    """Parse a file. Raises MotionError, naming the file, and the line of what is damaged or too large."""
    lines = read_lines(path)
    _next_line(lines, path, "HIERARCHY")
    joints = _hierarchy(lines, path)
    columns = joints[-1].first + len(joints[-1].channels)
    frames, frame_time = _header(lines, path, len(joints))
    rows: list[np.ndarray] = []
    for line in lines:
        if len(rows) == frames:
            raise line.error(f"more than the {frames} frames that 'Frames:' declares; export it again")
        rows.append(np.array(_numbers(line, 0, columns)))
    if len(rows) < frames:
        raise MotionError(
            f"{path}: declares {frames} frames and holds {len(rows)}; it is cut off, export it again"
        )
    return BvhClip(joints, np.stack(rows), 1.0 / frame_time if frame_time else None)


def _next_line(lines: Iterator[Line], path: Path, *tokens: str) -> Line:
    """Return the next line. Raises MotionError where there is none that begins so, in any case."""
    line = next(lines, None)
    if line is None:
        raise MotionError(f"{path}: ends before it is whole; export it again")
    if [word.lower() for word in line.tokens[: len(tokens)]] != [word.lower() for word in tokens]:
        raise line.error(
            f"'{' '.join(line.tokens)[:40]}' where '{' '.join(tokens)}' should be; is it a .bvh file?"
        )
    return line


def _numbers(line: Line, first: int, count: int) -> list[float]:
    """Return the tokens from `first` on as numbers. Raises MotionError unless they are `count`."""
    values = line.numbers(first)
    if len(values) != count:
        raise line.error(f"{count} numbers should be here, not {len(values)}; export it again")
    return values


def _hierarchy(lines: Iterator[Line], path: Path) -> list[Joint]:
    joints: list[Joint] = []
    open_joints: list[int] = []
    columns = 0
    while True:
        line = _next_line(lines, path)
        tokens = line.tokens
        word = tokens[0].lower()
        if word in ("root", "joint", "end"):
            if (word == "root") != (not joints):
                raise line.error("there is one ROOT, and JOINTs and End Sites below it")
            name = "" if word == "end" else " ".join(tokens[1:])
            if word != "end" and (not name or any(joint.name == name for joint in joints)):
                raise line.error(f"joint '{name[:40]}' has no name or one that is taken")
            if len(joints) == MAX_JOINTS:
                raise line.error(f"more than {MAX_JOINTS} joints; is it the skeleton of one body?")
            joints.append(Joint(name, open_joints[-1] if open_joints else -1, first=columns))
            open_joints.append(len(joints) - 1)
            _next_line(lines, path, "{")
        elif not open_joints:
            raise line.error(f"'{tokens[0][:40]}' where ROOT should be; is it a .bvh file?")
        elif word == "offset":
            joints[open_joints[-1]].offset = np.array(_numbers(line, 1, 3))
        elif word == "channels" and open_joints[-1] == len(joints) - 1 and columns == joints[-1].first:
            joints[-1].channels = _channels(line)
            columns += len(joints[-1].channels)
        elif word == "}":
            open_joints.pop()
            if not open_joints:
                return joints
        else:
            raise line.error(f"'{' '.join(tokens)[:40]}' is not known in a hierarchy, or out of place")


def _channels(line: Line) -> tuple[str, ...]:
    tokens = line.tokens
    known = {channel.lower(): channel for channel in CHANNELS}
    channels = tuple(known.get(word.lower(), "") for word in tokens[2:])
    if tokens[1:2] != [str(len(channels))] or len(set(channels)) != len(channels) or "" in channels:
        raise line.error(f"'{' '.join(tokens)[:60]}' declares other channels than it names, or unknown ones")
    return channels


def _header(lines: Iterator[Line], path: Path, joints: int) -> tuple[int, float | None]:
    """Return the number of frames, and seconds a frame where it is stated."""
    _next_line(lines, path, "MOTION")
    line = _next_line(lines, path, "Frames:")
    tokens = line.tokens[1:]
    if len(tokens) != 1 or not (tokens[0].isascii() and tokens[0].isdigit() and len(tokens[0]) < 10):
        raise line.error(f"'{' '.join(tokens)[:40]}' is no number of frames")
    frames = int(tokens[0])
    check_frame_count(path, frames)
    if frames * joints > MAX_ROTATIONS:
        raise line.error(f"{frames} frames of {joints} joints are too many; cut the clip")
    line = _next_line(lines, path, "Frame", "Time:")
    seconds = _numbers(line, 2, 1)[0]
    if seconds < 0:
        raise line.error("the frame time is negative")
    return frames, seconds or None
