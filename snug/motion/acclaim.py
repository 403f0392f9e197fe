"""Acclaim motion capture: a skeleton (.asf) and its clips (.amc), as the CMU database has them.

Format: J. Lander, Working with motion capture file formats, Game Developer, January 1998. A bone's angles
are given in its own axes C (columns in the world of the zero pose), so with M the product of its rotations
the bone turns, relative to its parent and seen from the zero pose, by C M C^-1, and
G_bone = G_parent C M C^-1 is its rotation in the world. Its far end lies at G_bone direction length.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
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
    """A bone of the skeleton; one named "root" is the root.

    Attributes:
        direction: (3,) unit, in the zero pose.
        length: [m].
        axes: (3, 3), C.
        channels: in the file's order.
        parent: name of the bone that it hangs on.
    """

    direction: np.ndarray = field(default_factory=lambda: np.zeros(3))
    length: float = 0.0
    axes: np.ndarray = field(default_factory=lambda: np.eye(3))
    channels: tuple[str, ...] = ()
    parent: str = ""


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
    bones, metres = read_asf(file)
    if missing := [bone for bone in JOINT_BONES.values() if bone not in bones]:
        raise MotionError(f"{file}: no bone '{missing[0]}'; only skeletons with CMU's bone names are read")
    leg = bones["lfemur"].length + bones["ltibia"].length
    if leg <= 0.0:
        raise MotionError(f"{file}: the left leg has no length; fetch the skeleton again")
    channels = read_amc(path, bones, metres)
    fps = frame_rate(path, len(channels["root"]), None, options, CMU_RATE)
    turned = world_turns(bones, channels)
    poses = retarget(
        file,
        {joint: turned[bone] for joint, bone in JOINT_BONES.items()},
        {joint: bones[JOINT_BONES[joint]].direction for joint in LIMBS | FEET},
        {joint: bones[JOINT_BONES[joint]].axes[:, 0] for joint in HINGES},
    )
    root = channels["root"][:, [bones["root"].channels.index(axis) for axis in TRANSLATIONS]]
    source = f"{path.name} with {file.name}"
    return RawMotion(path=path, poses=poses, translations=LEG_LENGTH / leg * root, fps=fps, source=source)


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
    """Parse a skeleton as CMU writes them: angles in degrees, axes in the order XYZ, its root at the origin.

    Returns:
        The bones by name, parents first, and the length [m] of the file's unit.

    Raises:
        MotionError: file and line.
    """
    section, metres, bone = "", INCH, Bone()
    bones, unattached = {"root": Bone()}, dict[str, Bone]()
    for line in read_lines(path, comment="#"):
        word, *rest = line.tokens
        word = word.lower()
        if word.startswith(":"):
            section = word
        elif not section:
            raise line.error("no section such as :root before this; is it an .asf file?")
        elif section == ":units" and word == "length":
            [unit] = line.numbers(1, 1)
            if unit <= 0:
                raise line.error("the unit of length must be positive")
            metres = INCH / unit  # CMU's lengths times 1 / unit are inches
        elif (word == "angle" and rest != ["deg"]) or (word == "axis" and rest[-1:] != ["XYZ"]):
            raise line.error("only angles in degrees and axes in the order XYZ are read")
        elif section == ":root":
            if word == "order":
                bones["root"].channels = _channels(line, TRANSLATIONS + ROTATIONS)
            elif word in ("position", "orientation") and any(line.numbers(1, 3)):
                raise line.error("only roots at the origin and without a turn are read")
        elif section == ":bonedata" and word == "name":
            bone = unattached.setdefault(" ".join(rest), Bone())
        elif section == ":bonedata":
            _describe(bone, word, line, metres)
        elif section == ":hierarchy" and word not in ("begin", "end"):
            for child in rest:
                if line.tokens[0] not in bones or child not in unattached:
                    raise line.error(
                        f"'{child}' has no entry in :bonedata, two parents, or one not joined to the root"
                    )
                bones[child] = unattached.pop(child)
                bones[child].parent = line.tokens[0]
    if not set(TRANSLATIONS) <= set(bones["root"].channels):
        raise MotionError(f"{path}: the root has no 'order' of channels with {' '.join(TRANSLATIONS)}")
    return bones, metres


def _describe(bone: Bone, word: str, line: Line, metres: float) -> None:
    """Take what a line says of a bone. Raises MotionError."""
    if word == "direction":
        direction = np.array(line.numbers(1, 3))
        norm = float(np.linalg.norm(direction))
        if not 1e-6 < norm < 1e6:
            raise line.error("a bone's direction cannot be zero, nor so long")
        bone.direction = direction / norm
    elif word == "length":
        bone.length = line.numbers(1, 1)[0] * metres
    elif word == "axis":
        bone.axes = product(ROTATIONS, np.radians([line.numbers(1, 3)]))[0]
    elif word == "dof":
        bone.channels = _channels(line, ROTATIONS)


def _channels(line: Line, allowed: tuple[str, ...]) -> tuple[str, ...]:
    channels = tuple(word.lower() for word in line.tokens[1:])
    if unknown := [channel for channel in channels if channel not in allowed]:
        raise line.error(f"channel '{unknown[0]}' is not supported here; known are {' '.join(allowed)}")
    return channels


def read_amc(path: Path, bones: dict[str, Bone], metres: float) -> dict[str, np.ndarray]:
    """Parse a clip: bone -> (T, channels), angles in radians, translations in metres. Raises MotionError."""
    moving = {name: len(bone.channels) for name, bone in bones.items() if bone.channels}
    frames: list[dict[str, list[float]]] = []
    for line in read_lines(path, comment="#"):
        word = line.tokens[0]
        if word.lower() == ":radians":
            raise line.error("only angles in degrees are read")
        if word.startswith(":"):
            continue
        if len(line.tokens) == 1 and word.isdigit():
            frames.append({})
        elif word not in moving or not frames:
            raise line.error(f"'{word[:40]}' is no bone of the skeleton, or before the first frame")
        else:
            frames[-1][word] = line.numbers(1, moving[word], last=True)
    for number, frame in enumerate(frames, 1):
        if missing := [name for name in moving if name not in frame]:
            raise MotionError(
                f"{path}: frame {number} ends without bone '{missing[0]}'; it is cut off, fetch it again"
            )
    channels = {}
    for name in moving:
        scale = [np.pi / 180 if channel in ROTATIONS else metres for channel in bones[name].channels]
        rows = np.array([frame[name] for frame in frames])
        channels[name] = rows.reshape(len(frames), len(scale)) * scale
    return channels
