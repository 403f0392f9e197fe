"""Acclaim motion capture: a skeleton (.asf) and its clips (.amc), as the CMU database has them.

Format: J. Lander, Working with motion capture file formats, Game Developer, January 1998. A bone's angles
are given in its own axes C (columns in the world of the zero pose), so with M the product of its rotations
the bone turns, relative to its parent and seen from the zero pose, by C M C^-1, and
G_bone = G_parent C M C^-1 is its rotation in the world. Its far end lies at G_bone direction length.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from snug.body.skeleton import LEG_LENGTH
from snug.file_options import MotionFileOptions
from snug.motion.motion import MotionError
from snug.motion.raw_motion import Line, RawMotion, frame_rate, read_lines
from snug.motion.retarget import FEET, HINGES, LIMBS, retarget

CMU_RATE = 120.0  # [1/s] the .amc format has no field for it
INCH = 0.0254  # [m]
ROTATIONS, TRANSLATIONS = ("rx", "ry", "rz"), ("tx", "ty", "tz")
# Our joint: the CMU bone whose turn it takes. Thumbs and the half bones inside hips and neck are not needed.
JOINT_BONES = {
    "pelvis": "root", "spine1": "lowerback", "spine2": "upperback", "spine3": "thorax",
    "neck": "upperneck", "head": "head",
    **{f"{side}_{joint}": side[0] + bone for side in ("left", "right") for joint, bone in (
        ("hip", "femur"), ("knee", "tibia"), ("ankle", "foot"), ("foot", "toes"), ("collar", "clavicle"),
        ("shoulder", "humerus"), ("elbow", "radius"), ("wrist", "hand"), ("hand", "fingers"))},
}  # fmt: skip


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

    direction: np.ndarray
    length: float
    axes: np.ndarray
    channels: tuple[str, ...]
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
    degrees: bool


def read_asf_amc(path: Path, options: MotionFileOptions) -> RawMotion:
    """Read an .amc with the .asf of its subject (01_05.amc: 01.asf, or 01_05.asf).

    The path is scaled by the ratio of leg lengths, so that steps and legs agree.

    Raises:
        MotionError: no skeleton, a damaged file, or a skeleton without the bones of CMU's.
    """
    names = (path.stem, path.stem.split("_")[0])
    candidates = [path.with_name(name + end) for name in names for end in (".asf", ".ASF")]
    file = next((file for file in candidates if file.is_file()), None)
    if file is None:
        raise MotionError(f"{path}: its skeleton {names[1]}.asf is missing; put it beside the clip")
    skeleton = read_asf(file)
    bones = skeleton.bones
    if missing := [bone for bone in JOINT_BONES.values() if bone not in bones]:
        raise MotionError(f"{file}: no bone '{missing[0]}'; only skeletons with CMU's bone names are read")
    leg = bones["lfemur"].length + bones["ltibia"].length
    if leg <= 0.0:
        raise MotionError(f"{file}: the left leg has no length; fetch the skeleton again")
    channels = read_amc(path, skeleton)
    fps = frame_rate(path, len(channels["root"]), None, options, CMU_RATE)
    turned = world_turns(skeleton, channels)
    poses = retarget(
        file,
        {joint: turned[bone] for joint, bone in JOINT_BONES.items()},
        {joint: bones[JOINT_BONES[joint]].direction for joint in LIMBS | FEET},
        {joint: bones[JOINT_BONES[joint]].axes[:, 0] for joint in HINGES},
    )
    order = bones["root"].channels
    root = skeleton.position + np.stack(
        [channels["root"][:, order.index(axis)] if axis in order else np.zeros(len(poses))
         for axis in TRANSLATIONS], axis=1,
    )  # fmt: skip
    return RawMotion(
        path=path, poses=poses, translations=LEG_LENGTH / leg * root,
        fps=fps, source=f"{path.name} with {file.name}",
    )  # fmt: skip


def world_turns(skeleton: Skeleton, channels: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return G (T, 3, 3) of every bone: its rotation in the world, from the zero pose."""
    turned: dict[str, np.ndarray] = {}
    for name, bone in skeleton.bones.items():
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


def read_asf(path: Path) -> Skeleton:
    """Parse a skeleton. Raises MotionError with file and line."""
    sections: dict[str, list[Line]] = {"": []}
    current = sections[""]
    for line in read_lines(path, comment="#"):
        if line.tokens[0].startswith(":"):
            current = sections.setdefault(line.tokens[0][1:].lower(), [])
            line.tokens = line.tokens[1:]
        elif current is sections[""]:
            raise line.error("no section such as :root before this; is it an .asf file?")
        if line.tokens:
            current.append(line)
    for name in ("root", "bonedata", "hierarchy"):
        if not sections.get(name):
            raise MotionError(f"{path}: section :{name} is missing or empty; fetch the skeleton again")
    units = {line.tokens[0]: line for line in sections.get("units", [])}
    unit = units["length"].numbers(1, 1)[0] if "length" in units else 1.0
    if unit <= 0:
        raise units["length"].error("the unit of length must be positive")
    metres = INCH / unit  # CMU's lengths times 1 / unit are inches
    degrees = "angle" not in units or units["angle"].tokens[1:] != ["rad"]
    root = {line.tokens[0].lower(): line for line in sections["root"]}
    if "order" not in root or len(root["order"].tokens) == 1:
        raise sections["root"][0].error("the root has no 'order' of its channels")
    position = root["position"].numbers(1, 3) if "position" in root else [0.0, 0.0, 0.0]
    bones = {"root": _bone(root, metres, degrees)}
    listed = {name: _bone(block, metres, degrees) for name, block in _blocks(sections["bonedata"]).items()}
    _attach(sections["hierarchy"], listed, bones)
    return Skeleton(bones, metres, np.array(position) * metres, degrees)


def _blocks(lines: list[Line]) -> dict[str, dict[str, Line]]:
    """Return the lines of each bone, which follow a 'begin', by their first words."""
    blocks: dict[str, dict[str, Line]] = {}
    block: dict[str, Line] = {}
    for line in lines:
        word = line.tokens[0].lower()
        if word == "begin":
            block = {}
        elif word == "name" and len(line.tokens) > 1:
            if word in block or line.tokens[1] in blocks:
                raise line.error(f"second name, or bone: '{line.tokens[1]}'; is a 'begin' missing?")
            blocks[line.tokens[1]] = block
        block[word] = line
    return blocks


def _bone(block: dict[str, Line], metres: float, degrees: bool) -> Bone:
    """Return a bone, or the root, whose channels are 'order' and whose axes 'orientation'."""
    root = "order" in block
    direction, length, axes = np.zeros(3), 0.0, np.eye(3)
    if "direction" in block:
        direction = np.array(block["direction"].numbers(1, 3))
        norm = float(np.linalg.norm(direction))
        if not 1e-6 < norm < 1e6:
            raise block["direction"].error("a bone's direction cannot be zero, nor so long")
        direction /= norm
    if "length" in block:
        length = block["length"].numbers(1, 1)[0] * metres
    if line := block.get("orientation" if root else "axis"):
        order = (block["axis"].tokens[1:2] if root and "axis" in block else line.tokens[4:5]) or ["XYZ"]
        letters = order[0].lower()
        if sorted(letters) != ["x", "y", "z"]:
            raise line.error(f"axis order '{order[0]}' is not a permutation of XYZ")
        angles = np.array([line.numbers(1, 3)])
        axes = product([f"r{letter}" for letter in letters], np.radians(angles) if degrees else angles)[0]
    line = block.get("order" if root else "dof")
    channels = tuple(word.lower() for word in line.tokens[1:]) if line else ()
    allowed = TRANSLATIONS + ROTATIONS if root else ROTATIONS
    if line and (unknown := [channel for channel in channels if channel not in allowed]):
        raise line.error(f"channel '{unknown[0]}' is not supported here; known are {' '.join(allowed)}")
    return Bone(direction, length, axes, channels)


def _attach(lines: list[Line], listed: dict[str, Bone], bones: dict[str, Bone]) -> None:
    """Hang the bones of a skeleton on each other, below the root, as its hierarchy says."""
    for line in lines:
        parent, *children = line.tokens
        if parent in ("begin", "end"):
            continue
        if parent not in bones:
            raise line.error(f"'{parent}' is not joined to the root yet; list parents before children")
        for child in children:
            if child not in listed:
                raise line.error(f"bone '{child}' has no entry in :bonedata")
            if child in bones:
                raise line.error(f"bone '{child}' has two parents")
            listed[child].parent = parent
            bones[child] = listed[child]


def read_amc(path: Path, skeleton: Skeleton) -> dict[str, np.ndarray]:
    """Parse a clip: bone -> (T, channels), angles in radians, translations in metres. Raises MotionError."""
    moving = {name: len(bone.channels) for name, bone in skeleton.bones.items() if bone.channels}
    frames: list[dict[str, list[float]]] = []
    degrees = skeleton.degrees
    for line in read_lines(path, comment="#"):
        word = line.tokens[0]
        if word.startswith(":"):
            degrees = {":degrees": True, ":radians": False}.get(word.lower(), degrees)
        elif len(line.tokens) == 1 and word.isdigit():
            frames.append({})
        elif not frames:
            raise line.error(f"'{word}' comes before the first frame number; is it an .amc file?")
        elif word not in moving:
            raise line.error(
                f"unknown bone '{word[:40]}'; the skeleton does not have it, give the right .asf"
            )
        else:
            frames[-1][word] = line.numbers(1, moving[word], last=True)
    for number, frame in enumerate(frames, 1):
        if missing := [name for name in moving if name not in frame]:
            raise MotionError(
                f"{path}: frame {number} ends without bone '{missing[0]}'; it is cut off, fetch it again"
            )
    channels = {}
    for name in moving:
        scale = [
            (math.pi / 180 if degrees else 1.0) if channel in ROTATIONS else skeleton.metres
            for channel in skeleton.bones[name].channels
        ]
        rows = np.array([frame[name] for frame in frames])
        channels[name] = rows.reshape(len(frames), len(scale)) * scale
    return channels
