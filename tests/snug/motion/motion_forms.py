"""Files of motions in the forms that people keep them in, written by code of its own; speeds of joints."""

import pickle
import re
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from snug.body.skeleton import JOINT_NAMES, PARENTS, REST_JOINTS, axis_angles, rotation_matrices
from snug.file_options import MotionFileOptions
from snug.motion.files import load_motions, read_motion
from snug.motion.motion import MotionError

Y_UP = np.eye(3)
# From y up to z up: (x, y, z) becomes (x, -z, y).
TO_Z_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
MIXAMO = {
    "pelvis": "Hips", "spine1": "Spine", "spine2": "Spine1", "spine3": "Spine2", "neck": "Neck",
    "head": "Head",
    **{f"{side}_{ours}": side.capitalize() + theirs for side in ("left", "right") for ours, theirs in (
        ("hip", "UpLeg"), ("knee", "Leg"), ("ankle", "Foot"), ("foot", "ToeBase"), ("collar", "Shoulder"),
        ("shoulder", "Arm"), ("elbow", "ForeArm"), ("wrist", "Hand"), ("hand", "HandMiddle1"))},
}  # fmt: skip


def read(path, **options):
    return read_motion(path, MotionFileOptions(**options))


def refuse(path, words, named=None, **options):
    """Reading ends in one line that has these words and names the file."""
    with pytest.raises(MotionError) as caught:
        load_motions(path, options=MotionFileOptions(**options))
    message = str(caught.value)
    assert re.search(words, message), message
    assert (named or path).name in message and "\n" not in message and len(message) < 500


def of_root(motion, turn):
    """Poses and path with the world turned by a matrix (3, 3)."""
    poses = motion.poses.copy()
    poses[:, 0] = (Rotation.from_matrix(turn) * Rotation.from_rotvec(poses[:, 0])).as_rotvec()
    return poses, motion.translations @ turn.T


def columns(poses, joints):
    """(T, 3 joints): the body's joints where SMPL+H and SMPL-X have them, nothing in the fingers."""
    wide = np.zeros((len(poses), joints, 3))
    count = 24 if joints == 24 else 22
    wide[:, :count] = poses[:, :count]
    return wide.reshape(len(poses), -1)


def write_forms(folder: Path, motion, turn=Y_UP) -> list[Path]:
    """The motion in a file of each form."""
    poses, trans = of_root(motion, turn)
    fps = motion.fps
    forms = {
        "smpl": {"poses": columns(poses, 24), "trans": trans, "fps": fps},
        "joints": {"poses": poses, "transl": trans[:, None], "framerate": fps},
        "smplh": {"poses": columns(poses, 52), "trans": trans, "mocap_framerate": fps},
        "smplx": {"poses": columns(poses, 55), "trans": trans, "mocap_frame_rate": fps},
        "body": {"poses": poses[:, :22], "trans": trans, "fps": fps},
        "parts": {"root_orient": poses[:, 0], "pose_body": columns(poses, 24)[:, 3:66], "trans": trans,
                  "fps": fps},
        "estimated": {"global_orient": poses[:, :1], "body_pose": poses[:, 1:], "translations": trans,
                      "fps": fps},
    }  # fmt: skip
    files = []
    for name, arrays in forms.items():
        files.append(folder / f"{name}.npz")
        np.savez(files[-1], **arrays)
    files.append(folder / "pickled.pkl")
    files[-1].write_bytes(pickle.dumps(forms["smpl"]))
    files.append(folder / "ours.bvh")
    files[-1].write_text(bvh(poses, trans, fps))
    files.append(folder / "mixamo.bvh")
    names = {ours: f"mixamorig:{theirs}" for ours, theirs in MIXAMO.items()}
    files[-1].write_text(bvh(poses, trans, fps, names=names, order="XYZ", unit=0.01))
    return files


def bvh(poses, trans, fps, *, names=None, order="ZXY", unit=1.0, rest=REST_JOINTS) -> str:
    """The text of a BVH of our skeleton; unit: [m] of its lengths."""
    names = names or {name: name for name in JOINT_NAMES}
    lines, walked = ["HIERARCHY"], []

    def numbers(values) -> str:
        return " ".join(f"{value:.7f}" for value in values)

    def write(joint: int, depth: int) -> None:
        walked.append(joint)
        space, parent = "\t" * depth, PARENTS[joint]
        offset = (rest[joint] - (rest[parent] if parent >= 0 else 0.0)) / unit
        channels = "".join(f" {axis}rotation" for axis in order)
        lines.append(f"{space}{'JOINT' if depth else 'ROOT'} {names[JOINT_NAMES[joint]]}")
        lines.extend([f"{space}{{", f"{space}\tOFFSET {numbers(offset)}"])
        moved = " Xposition Yposition Zposition" if depth == 0 else ""
        lines.append(f"{space}\tCHANNELS {3 + 3 * (depth == 0)}{moved}{channels}")
        children = [child for child, above in enumerate(PARENTS) if above == joint]
        for child in children:
            write(child, depth + 1)
        if not children:
            lines.extend(
                [f"{space}\tEnd Site", f"{space}\t{{", f"{space}\t\tOFFSET 0 0.1 0", f"{space}\t}}"]
            )
        lines.append(f"{space}}}")

    write(0, 0)
    angles = Rotation.from_rotvec(poses[:, walked].reshape(-1, 3)).as_euler(order, degrees=True)
    rows = np.concatenate([(trans + rest[0]) / unit, angles.reshape(len(poses), -1)], axis=1)
    lines += ["MOTION", f"Frames: {len(poses)}", f"Frame Time: {1 / fps:.7f}", *map(numbers, rows)]
    return "\n".join(lines) + "\n"


def joint_speeds(motion):
    """Angular speed of every joint relative to its parent, (T - 1, 24) [rad/s]."""
    rotations = rotation_matrices(motion.poses)
    steps = axis_angles(np.swapaxes(rotations[:-1], -1, -2) @ rotations[1:])
    return np.linalg.norm(steps, axis=-1) * motion.fps


def cmu_like() -> str:
    """A skeleton with CMU's bone names: legs splayed, arms along x, hinge axes tilted as CMU's are."""
    s, c = np.sin(np.radians(20.0)), np.cos(np.radians(20.0))
    down, up = {"l": (s, -c, 0), "r": (-s, -c, 0)}, (0, 1, 0)
    bones = [
        ("lowerback", up, 2, (0, 0, 0), "rx ry rz", "root"),
        ("upperback", up, 2, (0, 0, 0), "", "lowerback"),
        ("thorax", up, 2, (0, 0, 0), "", "upperback"),
        ("lowerneck", up, 2, (0, 0, 0), "", "thorax"),
        ("upperneck", up, 2, (0, 0, 0), "", "lowerneck"),
        ("head", up, 2, (0, 0, 0), "rx", "upperneck"),
    ]
    for side, sign in (("l", 1), ("r", -1)):
        leg, arm = (0, 0, sign * 20.0), (180, -sign * 30, -sign * 90)
        bones += [
            (f"{side}hipjoint", (sign * 0.6, -0.7, 0.3), 2.4, (0, 0, 0), "", "root"),
            (f"{side}femur", down[side], 7.0, leg, "rx ry rz", f"{side}hipjoint"),
            (f"{side}tibia", down[side], 7.4, leg, "rx", f"{side}femur"),
            (f"{side}foot", (0, -0.2, 0.98), 2.3, (-90, 0, 0), "rx", f"{side}tibia"),
            (f"{side}toes", (0, 0, 1), 1.1, (-90, 0, 0), "", f"{side}foot"),
            (f"{side}clavicle", (sign * 0.93, 0.35, 0), 3.5, (0, 0, 0), "ry rz", "thorax"),
            (f"{side}humerus", (sign, 0, 0), 5.0, arm, "rx ry rz", f"{side}clavicle"),
            (f"{side}radius", (sign, 0, 0), 3.5, arm, "rx", f"{side}humerus"),
            (f"{side}wrist", (sign, 0, 0), 1.7, (0, sign * 90, sign * 90), "ry", f"{side}radius"),
            (f"{side}hand", (sign, 0, 0), 0.7, (0, sign * 90, sign * 90), "rx", f"{side}wrist"),
            (f"{side}fingers", (sign, 0, 0), 0.6, (0, sign * 90, sign * 90), "", f"{side}hand"),
        ]
    text = "# comment\n:units\n length 0.45\n angle deg\n:root\n order TX TY TZ RX RY RZ\n"
    text += " axis XYZ\n position 0 0 0\n orientation 0 0 0\n:bonedata\n"
    for name, direction, length, axis, dof, _ in bones:
        text += f"begin\n name {name}\n direction {' '.join(map(str, direction))}\n length {length}\n"
        text += f" axis {' '.join(map(str, axis))} XYZ\n" + (f" dof {dof}\n" if dof else "") + "end\n"
    return text + ":hierarchy\nbegin\n" + "".join(f" {b[5]} {b[0]}\n" for b in bones) + "end\n"


def amc_frame(number: int, **bones: tuple[float, ...]) -> str:
    """One frame of the CMU-like skeleton: zero everywhere but for the bones given."""
    counts = {"root": 6, "lowerback": 3, "head": 1}
    for side in "lr":
        counts |= {f"{side}femur": 3, f"{side}tibia": 1, f"{side}foot": 1, f"{side}clavicle": 2}
        counts |= {f"{side}humerus": 3, f"{side}radius": 1, f"{side}wrist": 1, f"{side}hand": 1}
    values = {name: bones.get(name, (0.0,) * count) for name, count in counts.items()}
    return f"{number}\n" + "".join(f"{name} {' '.join(map(str, v))}\n" for name, v in values.items())


def write_clip(folder: Path, frames: list[str]) -> Path:
    (folder / "07.asf").write_text(cmu_like())
    clip = folder / "07_01.amc"
    clip.write_text(":FULLY-SPECIFIED\n:DEGREES\n" + "".join(frames))
    return clip
