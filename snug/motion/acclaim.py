"""Acclaim motion capture: a skeleton (.asf) and its clips (.amc), as the CMU database has them.

Format: J. Lander, Working with motion capture file formats, Game Developer, January 1998. A bone's angles
are given in its own axes C (columns in the world of the zero pose), so with M the product of its
rotations the bone turns, relative to its parent and seen from the zero pose, by C M C^-1, and
G_bone = G_parent C M C^-1 is its rotation in the world. Its far end lies at G_bone direction length.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from snug.body.skeleton import LEG_LENGTH
from snug.file_options import MotionFileOptions
from snug.motion.motion import Motion, MotionError
from snug.motion.recording import finite_numbers, frame_rate, parse_lines
from snug.motion.retarget import FEET, HINGES, LIMBS, retarget

CMU_RATE = 120.0  # [1/s] the .amc format has no field for it
INCH = 0.0254  # [m]
ROTATIONS, TRANSLATIONS = ("rx", "ry", "rz"), ("tx", "ty", "tz")
# Our joint: the CMU bone whose turn it takes. Thumbs and the half bones inside hips and neck are not
# needed.
JOINT_BONES = {
    "pelvis": "root", "spine1": "lowerback", "spine2": "upperback", "spine3": "thorax",
    "neck": "upperneck", "head": "head",
    **{f"{side}_{joint}": side[0] + bone for side in ("left", "right") for joint, bone in (
        ("hip", "femur"), ("knee", "tibia"), ("ankle", "foot"), ("foot", "toes"), ("collar", "clavicle"),
        ("shoulder", "humerus"), ("elbow", "radius"), ("wrist", "hand"), ("hand", "fingers"))},
}  # fmt: skip


@dataclass
class Bone:
    """A bone of the skeleton; one named "root" is the root."""

    direction: np.ndarray = field(default_factory=lambda: np.zeros(3))  # (3,) unit, in the zero pose
    length: float = 0.0  # [m]
    axes: np.ndarray = field(default_factory=lambda: np.eye(3))  # (3, 3), C
    channels: tuple[str, ...] = ()  # in the file's order
    parent: str = ""  # name of the bone that it hangs on


def read_asf_amc(path: Path, options: MotionFileOptions) -> Motion:
    """Read an .amc with the .asf of its subject, in the file's axes.

    Of the skeletons beside it, that is the one with the longest name that begins the clip's: 01.asf of
    01_05.amc, HDM_bd.asf of HDM_bd_01.amc.
    The path is scaled by the ratio of leg lengths, so that steps and legs agree.

    Raises:
        MotionError: no skeleton, a damaged file, or a skeleton without the bones of CMU's.
    """
    files = (file for file in path.parent.glob("*") if file.suffix.lower() == ".asf")
    matches = [file for file in files if re.match(re.escape(file.stem) + r"(?![^\W_])", path.stem)]
    file = max(matches, key=lambda file: len(file.stem), default=None)
    if file is None:
        subject = path.stem.split("_")[0]
        raise MotionError(f"its skeleton {subject}.asf is missing; put it beside the clip")
    try:
        bones, metres = read_asf(file)
    except MotionError as error:
        raise MotionError(f"its skeleton {file.name}, {error}") from None
    if gaps := [bone for bone in JOINT_BONES.values() if bone not in bones]:
        raise MotionError(f"{file.name} has no bone '{gaps[0]}'; only CMU's bone names are read")
    leg = bones["lfemur"].length + bones["ltibia"].length
    if leg <= 0.0:
        raise MotionError(f"the left leg of {file.name} has no length; fetch the skeleton again")
    channels = read_amc(path, bones, metres)
    turned = world_turns(bones, channels)
    poses = retarget(
        {joint: turned[bone] for joint, bone in JOINT_BONES.items()},
        {joint: bones[JOINT_BONES[joint]].direction for joint in LIMBS | FEET},
        {joint: bones[JOINT_BONES[joint]].axes[:, 0] for joint in HINGES},
    )
    root = channels["root"][:, [bones["root"].channels.index(axis) for axis in TRANSLATIONS]]
    fps = frame_rate(len(root), None, options.fps, CMU_RATE)
    source = f"{path.name} with {file.name}"
    return Motion(path.stem, poses, LEG_LENGTH / leg * root, fps, "recorded", source)


def world_turns(bones: dict[str, Bone], channels: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return G (T, 3, 3) of every bone: its rotation in the world, from the zero pose."""
    turned: dict[str, np.ndarray] = {}
    for name, bone in bones.items():
        local = np.eye(3)
        if bone.channels:
            local = bone.axes @ product(bone.channels, channels[name]) @ bone.axes.T
        turned[name] = turned[bone.parent] @ local if bone.parent else local
    return turned


def product(channels: Sequence[str], values: np.ndarray) -> np.ndarray:
    """Return M (T, 3, 3) of a bone: the product of its rotations (T, channels), the first applied first."""
    rotation = Rotation.identity(len(values))
    for channel, angles in zip(channels, values.T):
        if channel in ROTATIONS:
            rotation = Rotation.from_euler(channel[1], angles[:, None]) * rotation
    return rotation.as_matrix()


def read_asf(path: Path) -> tuple[dict[str, Bone], float]:
    """Parse a skeleton: its bones by name, parents first, and the length [m] of the file's unit.

    Raises:
        MotionError: names the line, and what is not as CMU writes it.
    """
    return parse_lines(path, _parse_bones, comment="#")


def _parse_bones(lines: Iterator[list[str]]) -> tuple[dict[str, Bone], float]:
    section, metres, bone = "", INCH, Bone()
    bones, unattached = {"root": Bone()}, dict[str, Bone]()
    for name, *tokens in lines:
        word = name.lower()
        if word.startswith(":"):
            section = word
        elif (word == "angle" and tokens != ["deg"]) or (word == "axis" and tokens[-1:] != ["XYZ"]):
            raise ValueError("only angles in degrees and axes in the order XYZ are read")
        elif section == ":units" and word == "length":
            [unit] = finite_numbers(tokens, 1)
            if unit <= 0:
                raise ValueError("the unit of length must be positive")
            metres = INCH / unit  # CMU's lengths times 1 / unit are inches
        elif section == ":root" and word == "order":
            bones["root"].channels = _channels(tokens, TRANSLATIONS + ROTATIONS)
        elif section == ":root" and word in ("position", "orientation"):
            if any(finite_numbers(tokens, 3)):
                raise ValueError("only roots at the origin and without a turn are read")
        elif section == ":bonedata" and word == "name":
            bone = unattached.setdefault(" ".join(tokens), Bone())
        elif section == ":bonedata" and word == "direction":
            direction = np.array(finite_numbers(tokens, 3))
            length = np.linalg.norm(direction)
            if not 1e-6 < length < 1e6:
                raise ValueError("a bone's direction cannot be zero, nor so long")
            bone.direction = direction / length
        elif section == ":bonedata" and word == "length":
            bone.length = finite_numbers(tokens, 1)[0] * metres
        elif section == ":bonedata" and word == "axis":
            bone.axes = product(ROTATIONS, np.radians([finite_numbers(tokens[:3], 3)]))[0]
        elif section == ":bonedata" and word == "dof":
            bone.channels = _channels(tokens, ROTATIONS)
        elif section == ":hierarchy" and word not in ("begin", "end"):
            for child in tokens:
                if name not in bones or child not in unattached:
                    raise ValueError(
                        f"'{child}' has no entry in :bonedata, two parents, or one not joined to the root"
                    )
                bones[child] = unattached.pop(child)
                bones[child].parent = name
    if not set(TRANSLATIONS) <= set(bones["root"].channels):
        raise ValueError(f"the root has no 'order' of channels with {' '.join(TRANSLATIONS)}")
    return bones, metres


def _channels(tokens: Sequence[str], choices: tuple[str, ...]) -> tuple[str, ...]:
    channels = tuple(word.lower() for word in tokens)
    if unknown := [channel for channel in channels if channel not in choices]:
        raise ValueError(f"channel '{unknown[0]}' is not supported here; known are {' '.join(choices)}")
    return channels


def read_amc(path: Path, bones: dict[str, Bone], metres: float) -> dict[str, np.ndarray]:
    """Parse a clip: bone -> (T, channels), angles in radians, translations in metres. Raises MotionError."""
    moving = {name: len(bone.channels) for name, bone in bones.items() if bone.channels}

    def parse(lines: Iterator[list[str]]) -> list[dict[str, list[float]]]:
        frames: list[dict[str, list[float]]] = []
        numbers: list[int] = []
        for word, *tokens in lines:
            if word.lower() == ":radians":
                raise ValueError("only angles in degrees are read")
            if word.startswith(":"):
                continue
            if not tokens and word.isdigit():
                if numbers and int(word) != numbers[-1] + 1:
                    raise ValueError(f"frame {word} follows frame {numbers[-1]}; fetch it again")
                numbers.append(int(word))
                frames.append({})
            elif word not in moving or not frames:
                raise ValueError(f"'{word[:40]}' is no bone of the skeleton, or before the first frame")
            else:
                frames[-1][word] = finite_numbers(tokens, moving[word])
        return frames

    frames = parse_lines(path, parse, comment="#")
    for number, frame in enumerate(frames, 1):
        if gaps := moving.keys() - frame.keys():
            raise MotionError(f"frame {number} is cut off before bone '{min(gaps)}'; fetch it again")
    channels = {}
    for name in moving:
        scale = [np.pi / 180 if channel in ROTATIONS else metres for channel in bones[name].channels]
        rows = np.array([frame[name] for frame in frames])
        channels[name] = rows.reshape(len(frames), len(scale)) * scale
    return channels
