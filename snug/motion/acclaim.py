"""Acclaim motion capture: a skeleton (.asf) and its clips (.amc), as the CMU database has them.

Format: J. Lander, Working with motion capture file formats, Game Developer, January 1998. A bone's angles
are given in its own axes C (columns in the world of the zero pose), so with M the product of its rotations
the bone turns, relative to its parent and seen from the zero pose, by C M C^-1, and
G_bone = G_parent C M C^-1 is its rotation in the world. Its far end lies at G_bone direction length.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from snug.motion.motion import MotionError
from snug.motion.raw_motion import Line, check_frame_count, read_lines

INCH = 0.0254  # [m]
_ROTATIONS = ("rx", "ry", "rz")
_TRANSLATIONS = ("tx", "ty", "tz")


@dataclass
class Bone:
    """A bone of the skeleton.

    Attributes:
        direction: (3,) unit, in the zero pose.
        length: [m].
        axes: (3, 3), C.
        channels: in the file's order.
        parent: name of the bone that it hangs on.
    """

    name: str
    direction: np.ndarray = field(default_factory=lambda: np.zeros(3))
    length: float = 0.0
    axes: np.ndarray = field(default_factory=lambda: np.eye(3))
    channels: tuple[str, ...] = ()
    parent: str = ""


@dataclass
class Skeleton:
    """Bones by name, parents first; "root" is one of them.

    Attributes:
        bones: by name.
        metres: length of the file's unit [m].
        position: (3,) [m] of the root.
        degrees: whether angles are in degrees.
    """

    bones: dict[str, Bone]
    metres: float
    position: np.ndarray
    degrees: bool = True


def read_asf(path: Path) -> Skeleton:
    """Parse a skeleton. Raises MotionError with file and line."""
    sections: dict[str, list[Line]] = {}
    for line in _lines(path):
        if line.tokens[0].startswith(":"):
            current = sections.setdefault(line.tokens[0][1:].lower(), [])
            line.tokens = line.tokens[1:]
            if not line.tokens:
                continue
        elif not sections:
            raise line.error("no section such as :root before this; is it an .asf file?")
        current.append(line)
    for name in ("root", "bonedata", "hierarchy"):
        if not sections.get(name):
            raise MotionError(f"{path}: section :{name} is missing or empty; fetch the skeleton again")
    units = {line.tokens[0]: line for line in sections.get("units", [])}
    unit = units["length"].numbers(1, 2)[0] if "length" in units else 1.0
    if unit <= 0:
        raise units["length"].error("the unit of length must be positive")
    degrees = "angle" not in units or units["angle"].tokens[1:] != ["rad"]
    # CMU's lengths times 1 / unit are inches.
    skeleton = Skeleton({}, INCH / unit, np.zeros(3), degrees)
    skeleton.bones["root"] = _root(sections["root"], skeleton)
    bones = _bones(sections["bonedata"], skeleton)
    _attach(sections["hierarchy"], bones, skeleton)
    return skeleton


def read_amc(path: Path, skeleton: Skeleton) -> dict[str, np.ndarray]:
    """Parse a clip: bone -> (T, channels), angles in radians, translations in metres. Raises MotionError."""
    moving = {name: len(bone.channels) for name, bone in skeleton.bones.items() if bone.channels}
    frames: list[dict[str, list[float]]] = []
    degrees = skeleton.degrees
    lines = _lines(path)
    for line in lines:
        word = line.tokens[0]
        if word.startswith(":"):
            degrees = {":degrees": True, ":radians": False}.get(word.lower(), degrees)
        elif len(line.tokens) == 1 and word.isdigit():
            _check_whole(line, frames, moving)
            frames.append({})
        elif not frames:
            raise line.error(f"'{word}' comes before the first frame number; is it an .amc file?")
        elif word not in moving:
            raise line.error(
                f"unknown bone '{word[:40]}'; the skeleton does not have it, give the right .asf"
            )
        else:
            values = line.numbers(1)
            if len(values) != moving[word]:
                raise line.error(
                    f"bone '{word}' has {len(values)} numbers, its skeleton {moving[word]}; fetch again"
                )
            frames[-1][word] = values
    if not frames:
        raise MotionError(f"{path}: holds no frame; give a whole .amc file")
    check_frame_count(path, len(frames))
    _check_whole(lines[-1], frames, moving)
    channels = {}
    for name in moving:
        scale = [
            (math.pi / 180 if degrees else 1.0) if channel in _ROTATIONS else skeleton.metres
            for channel in skeleton.bones[name].channels
        ]
        channels[name] = np.array([frame[name] for frame in frames]) * scale
    return channels


def turns(channels: tuple[str, ...], values: np.ndarray) -> np.ndarray:
    """Return M (T, 3, 3) of a bone: the product of its rotations (T, channels), the first applied first."""
    rotation = Rotation.identity(len(values))
    for channel, angles in zip(channels, values.T):
        if channel in _ROTATIONS:
            rotation = Rotation.from_euler(channel[1], angles[:, None]) * rotation
    return rotation.as_matrix()


def _lines(path: Path) -> list[Line]:
    lines = list(read_lines(path, comment="#"))
    if not lines:
        raise MotionError(f"{path}: the file is empty; fetch it again")
    return lines


def _check_whole(line: Line, frames: list[dict[str, list[float]]], moving: dict[str, int]) -> None:
    if frames and len(frames[-1]) < len(moving):
        missing = next(name for name in moving if name not in frames[-1])
        raise line.error(
            f"frame {len(frames)} ends without bone '{missing}'; the file is cut off, fetch it again"
        )


def _axes(line: Line, angles: list[float], order: str, degrees: bool) -> np.ndarray:
    if sorted(order.lower()) != ["x", "y", "z"]:
        raise line.error(f"axis order '{order}' is not a permutation of XYZ")
    values = np.radians([angles]) if degrees else np.array([angles])
    return turns(tuple(f"r{letter}" for letter in order.lower()), values)[0]


def _root(lines: list[Line], skeleton: Skeleton) -> Bone:
    entries = {line.tokens[0].lower(): line for line in lines}
    if "order" not in entries:
        raise lines[0].error("the root has no 'order' of its channels")
    bone = Bone("root", channels=_channels(entries["order"], _TRANSLATIONS + _ROTATIONS))
    if "position" in entries:
        skeleton.position = np.array(entries["position"].numbers(1, 4)) * skeleton.metres
    if "orientation" in entries:
        order = entries["axis"].tokens[1] if "axis" in entries and len(entries["axis"].tokens) > 1 else "XYZ"
        line = entries["orientation"]
        bone.axes = _axes(line, line.numbers(1, 4), order, skeleton.degrees)
    return bone


def _channels(line: Line, allowed: tuple[str, ...]) -> tuple[str, ...]:
    channels = tuple(word.lower() for word in line.tokens[1:])
    for channel in channels:
        if channel not in allowed:
            raise line.error(f"channel '{channel}' is not supported here; known are {' '.join(allowed)}")
    return channels


def _bones(lines: list[Line], skeleton: Skeleton) -> dict[str, Bone]:
    bones: dict[str, Bone] = {}
    bone = Bone("")
    for line in lines:
        word = line.tokens[0].lower()
        if word == "begin":
            bone = Bone("")
        elif word == "name" and len(line.tokens) > 1:
            if bone.name or line.tokens[1] in bones:
                raise line.error(f"second name, or bone: '{line.tokens[1]}'; is a 'begin' missing?")
            bone.name = line.tokens[1]
            bones[bone.name] = bone
        elif word == "direction":
            bone.direction = np.array(line.numbers(1, 4))
            norm = float(np.linalg.norm(bone.direction))
            if not 1e-6 < norm < 1e6:
                raise line.error("a bone's direction cannot be zero, nor so long")
            bone.direction /= norm
        elif word == "length":
            bone.length = line.numbers(1, 2)[0] * skeleton.metres
        elif word == "axis":
            order = line.tokens[4] if len(line.tokens) > 4 else "XYZ"
            bone.axes = _axes(line, line.numbers(1, 4), order, skeleton.degrees)
        elif word == "dof":
            bone.channels = _channels(line, _ROTATIONS)
    return bones


def _attach(lines: list[Line], bones: dict[str, Bone], skeleton: Skeleton) -> None:
    for line in lines:
        parent, *children = line.tokens
        if parent in ("begin", "end"):
            continue
        if parent not in skeleton.bones:
            raise line.error(f"'{parent}' is not joined to the root yet; list parents before children")
        for child in children:
            if child not in bones:
                raise line.error(f"bone '{child}' has no entry in :bonedata")
            if child in skeleton.bones:
                raise line.error(f"bone '{child}' has two parents")
            bones[child].parent = parent
            skeleton.bones[child] = bones[child]
