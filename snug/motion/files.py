"""Motions from files of motion capture, ready to use: checked, y up, resampled, arms spread.

Read motions of SMPL's joints from arrays: .npz in AMASS's layout and others by their keys, .npy, .pkl.

Axis-angle, rotation matrices or unit quaternions, relative to the parent joint. SMPL, SMPL+H and SMPL-X
begin with the same 22 joints. Only SMPL's own two hand joints are the ones of our tree; the others carry
fingers there, which a garment never meets. Shape coefficients and soft tissue are left out: shape is the
caller's choice.

| content | arrays, the first that is there | shape, T frames |
| --- | --- | --- |
| axis-angle [rad] | `poses`, `pose` | SMPL (T, 72), (T, 24, 3), SMPL+H (T, 156), SMPL-X (T, 165), (T, 66) |
| the same, root apart | `poses`, `pose`, `pose_body`, `body_pose` | (T, 63), (T, 69) |
| root apart | `root_orient`, `global_orient` | (T, 3), (T, 1, 3), (T, 3, 3), (T, 1, 3, 3) |
| matrices | `rotations`, `rotation_matrices`, or any above | (T, joints, 3, 3) |
| quaternions, w first | `quaternions`, `rotations_quat`, `quaternions_wxyz` | (T, joints, 4) |
| quaternions, w last | `quaternions_xyzw` | (T, joints, 4) |
| path of the root [m] | `trans`, `transl`, `translations` | (T, 3), (T, 1, 3) |
| rate [1/s] | `mocap_framerate`, `mocap_frame_rate`, `framerate`, `frame_rate`, `fps` | one number |
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from fnmatch import fnmatch
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from reference_sim.files.array_file import (
    ArrayFileError,
    array_names,
    read_array,
    read_arrays,
    read_pickled_arrays,
)
from snug.body.skeleton import BODY_JOINTS, JOINT, JOINT_NAMES, axis_angles
from snug.file_options import MotionFileOptions
from snug.motion.acclaim import read_asf_amc
from snug.motion.bvh import read_bvh
from snug.motion.motion import Motion, MotionError, clear_arms, place, resample
from snug.motion.raw_motion import (
    RawMotion,
    check_frame_count,
    frame_rate,
    remove_recording_errors,
    turn_y_up,
)

LAYOUTS = {22: "body", 24: "SMPL", 52: "SMPL+H", 55: "SMPL-X"}  # joints, the root among them
# Of several names the first that a file has is read.
QUATERNIONS = {  # name: where w stands
    "quaternions": 0, "rotations_quat": 0, "quaternions_wxyz": 0, "quaternions_xyzw": 3,
}  # fmt: skip
ROTATIONS = ("poses", "pose", "rotations", "rotation_matrices", *QUATERNIONS)
BODY_ROTATIONS = ("pose_body", "body_pose")
ROOT_ROTATIONS = ("root_orient", "global_orient")
PATHS = ("trans", "transl", "translations")
RATES = ("mocap_framerate", "mocap_frame_rate", "framerate", "frame_rate", "fps")
ARRAY_NAMES = (*ROTATIONS, *BODY_ROTATIONS, *ROOT_ROTATIONS, *PATHS, *RATES)
UNIT = 0.02  # a quaternion's length, and a matrix's entries, may be off by as much


def read_smpl_arrays(path: Path, options: MotionFileOptions) -> RawMotion:
    """Read an .npz or a pickled dict with arrays of the table, or an .npy with rotations alone.

    The root of the latter stays in place. Nothing in a pickle is executed. Raises MotionError.
    """
    note, suffix = "", path.suffix.lower()
    try:
        if suffix == ".npy":
            poses = read_array(path)
            arrays = {"poses": poses, "trans": np.zeros((len(np.atleast_1d(poses)), 3))}
            note = "; no path: the root stays"
        elif suffix == ".pkl":
            arrays = read_pickled_arrays(path, ARRAY_NAMES)
        else:
            arrays = read_arrays(path, ARRAY_NAMES)
            if not arrays:
                raise ArrayFileError(
                    f"{path}: no array of a motion among {', '.join(array_names(path)[:12])}"
                )
    except ArrayFileError as error:
        raise MotionError(f"{error}; give an .npz with 'poses', 'trans' and 'fps'") from None
    return make_raw_motion(path, arrays, options, note)


def make_raw_motion(
    path: Path, arrays: Mapping[str, np.ndarray], options: MotionFileOptions, note: str = ""
) -> RawMotion:
    """Make a motion of arrays by the names of the table. Raises MotionError."""
    for name, array in arrays.items():
        if array.dtype.kind not in "iuf" or array.size == 0:
            raise MotionError(
                f"{path}: array '{name}' is empty or holds no numbers; give floating-point values"
            )
    arrays = {name: array.astype(np.float64) for name, array in arrays.items()}
    turns, what = _rotations(path, arrays)
    check_frame_count(path, len(turns))
    name = _first(path, arrays, PATHS, "the root's path (frames, 3) [m]; zeros where it stays")
    translations = arrays[name]
    if translations.shape not in ((len(turns), 3), (len(turns), 1, 3)):
        raise MotionError(
            f"{path}: '{name}' has shape {translations.shape}; give ({len(turns)}, 3), a row for each pose"
        )
    poses = np.zeros((len(turns), len(JOINT_NAMES), 3))
    kept = poses.shape[1] if turns.shape[1] == poses.shape[1] else BODY_JOINTS
    poses[:, :kept] = turns[:, :kept]
    rates = [name for name in RATES if name in arrays]
    if rates and arrays[rates[0]].size != 1:
        raise MotionError(f"{path}: '{rates[0]}' is not one number; give the frames per second")
    fps = frame_rate(path, arrays[rates[0]].item() if rates else None, options)
    source = f"{path.name} ({what}, {LAYOUTS[turns.shape[1]]} layout{note})"
    return RawMotion(path=path, poses=poses, translations=translations.reshape(-1, 3), fps=fps, source=source)


def _first(path: Path, arrays: Mapping[str, np.ndarray], names: Iterable[str], meaning: str) -> str:
    """Return the first of `names` that the arrays have. Raises MotionError."""
    names = tuple(names)
    if found := [name for name in names if name in arrays]:
        return found[0]
    given = ", ".join(sorted(arrays))
    raise MotionError(f"{path}: no array '{names[0]}' (found {given}); give {meaning}")


def _rotations(path: Path, arrays: Mapping[str, np.ndarray]) -> tuple[np.ndarray, str]:
    """Return rotations (T, J, 3) [rad] of the root and the others, J one of LAYOUTS, and their array's name.

    Raises MotionError.
    """
    name = _first(path, arrays, (*ROTATIONS, *BODY_ROTATIONS), "rotations (frames, 72) [rad]")
    turns = _axis_angles(path, name, arrays[name])
    known = ", ".join(f"{3 * joints} ({layout})" for joints, layout in LAYOUTS.items())
    if turns.shape[1] + 1 in LAYOUTS:
        root = _first(path, arrays, ROOT_ROTATIONS, f"the root's rotation beside '{name}'")
        matrices = arrays[root].shape[1:] == (3, 3)
        first = _axis_angles(path, root, arrays[root][:, None] if matrices else arrays[root])
        if first.shape != (len(turns), 1, 3):
            raise MotionError(
                f"{path}: '{root}' has shape {arrays[root].shape}; give one rotation for each of the "
                f"{len(turns)} frames of '{name}'"
            )
        turns, name = np.concatenate([first, turns], axis=1), f"{root} and {name}"
    if turns.shape[1] not in LAYOUTS:
        raise MotionError(
            f"{path}: '{name}' has shape {arrays[name].shape}; give (frames, columns), columns one of {known}"
        )
    return turns, name


def _axis_angles(path: Path, name: str, array: np.ndarray) -> np.ndarray:
    """Return (T, J, 3) [rad] of axis-angles (T, 3 J) or (T, J, 3), matrices, or quaternions (T, J, 4)."""
    shape = array.shape
    if name in QUATERNIONS and shape[2:] == (4,):
        return _from_quaternions(path, name, array)
    if name not in QUATERNIONS and shape[2:] == (3, 3):
        return _from_matrices(path, name, array)
    if name not in QUATERNIONS and (shape[2:] == (3,) or (len(shape) == 2 and shape[1] % 3 == 0)):
        return array.reshape(len(array), -1, 3)
    wanted = "(frames, joints, 4)" if name in QUATERNIONS else (
        "(frames, 3 joints), (frames, joints, 3) [rad] or rotation matrices (frames, joints, 3, 3)"
    )  # fmt: skip
    raise MotionError(f"{path}: '{name}' has shape {shape}; give {wanted}")


def _from_matrices(path: Path, name: str, matrices: np.ndarray) -> np.ndarray:
    whole = np.isfinite(matrices).all(axis=(2, 3))
    matrices = np.where(whole[..., None, None], matrices, np.eye(3))
    off = np.abs(np.swapaxes(matrices, -1, -2) @ matrices - np.eye(3)).max(axis=(2, 3))
    _check_entries(path, name, (off > UNIT) | (np.linalg.det(matrices) <= 0), "rotation matrix")
    return np.where(whole[..., None], axis_angles(matrices), np.nan)


def _from_quaternions(path: Path, name: str, quaternions: np.ndarray) -> np.ndarray:
    w = QUATERNIONS[name]
    whole = np.isfinite(quaternions).all(axis=2)
    quaternions = np.where(whole[..., None], quaternions, np.eye(4)[w])
    off = np.abs(np.linalg.norm(quaternions, axis=2) - 1.0)
    _check_entries(path, name, off > UNIT, "unit quaternion")
    # Most joints turn by less than 90 degrees most of the time: w is then the largest of the four.
    if (np.abs(quaternions).argmax(axis=2) == 3 - w).mean() > 0.5:
        order = "quaternions_xyzw" if w == 0 else "quaternions_wxyz"
        raise MotionError(f"{path}: '{name}' has w at the other end; name the array '{order}'")
    ordered = quaternions if w == 3 else quaternions[..., [1, 2, 3, 0]]
    turns = Rotation.from_quat(ordered.reshape(-1, 4)).as_rotvec().reshape(*whole.shape, 3)
    return np.where(whole[..., None], turns, np.nan)


def _check_entries(path: Path, name: str, wrong: np.ndarray, kind: str) -> None:
    for frame, joint in np.argwhere(wrong)[:1]:
        raise MotionError(
            f"{path}: '{name}' of frame {frame}, joint {joint} is no {kind}; give rotations relative to "
            "the parent"
        )


# Extension of a motion file: its reader. Each gives the clip as recorded, in the axes of the file.
READERS: dict[str, Callable[[Path, MotionFileOptions], RawMotion]] = {
    ".amc": read_asf_amc,
    ".bvh": read_bvh,
    ".npz": read_smpl_arrays,
    ".npy": read_smpl_arrays,
    ".pkl": read_smpl_arrays,
}
# As the authors of SNUG did: recorded hands are noisy and drive nothing.
HAND_DAMPING = 0.1
HANDS = [JOINT[f"{side}_{joint}"] for side in ("left", "right") for joint in ("wrist", "hand")]

MAX_NAME_BYTES = 100  # bytes of a motion's name
SHAPE_FILES = ("shape.npz", "*_stagei.npz")  # of a subject: AMASS keeps them beside its clips
FORMULA = ("=", "+", "-", "@")  # what begins with one of these is a formula to programs that open CSV files


def load_motions(path: str | Path, *, options: MotionFileOptions | None = None) -> list[Motion]:
    """Read motions from a file, or from every motion file of a folder, in the order of their names.

    Each comes back whole, at 30 frames per second, placed on the floor at the origin facing +z, with the arms
    spread by `clear_arms` and the hands' rotations at a tenth. CMU files (.amc) need their skeleton (.asf)
    beside them. Of a folder of AMASS, files of a subject's shape (SHAPE_FILES) are left out where they hold
    no motion.

    Args:
        path: a file of a kind in `READERS`, or a folder of them.
        options: facts that the files do not state.

    Raises:
        MotionError: one line with file, element and remedy, for anything that cannot be read.

    >>> import tempfile, numpy as np
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = f"{folder}/standing.npz"
    ...     np.savez(file, poses=np.zeros((60, 72)), trans=np.zeros((60, 3)), mocap_framerate=60.0)
    ...     [motion] = load_motions(file)
    >>> motion.name, motion.frames, motion.fps
    ('standing', 31, 30.0)
    """
    path, known = Path(path), ", ".join(READERS)
    if not path.exists():
        raise MotionError(f"{path}: no such file or folder; give a motion file ({known}) or a folder")
    files = [path]
    if path.is_dir():
        listed = sorted(file for file in path.iterdir() if file.suffix.lower() in READERS)
        files = [file for file in listed if not holds_shape_alone(file)] or listed
    if not files:
        raise MotionError(f"{path}: holds no motion file ({known}); give a folder of motion capture clips")
    options = options or MotionFileOptions()
    return [clear_arms(resample(place(read_motion(file, options)))) for file in files]


def read_motion(file: Path, options: MotionFileOptions) -> Motion:
    """Read one clip as recorded, at its rate, y up and without recording errors. Raises MotionError."""
    name = file.stem
    # Rows of CSV files and lists in options hold names: no commas, no formulas, no spaces side by side.
    plain = name.isprintable() and "," not in name and name == " ".join(name.split())
    if not plain or name.startswith(FORMULA) or len(name.encode(errors="replace")) > MAX_NAME_BYTES:
        raise MotionError(
            f"{str(file)[:200]!a}: files are named after a motion; give this one a name of at most "
            f"{MAX_NAME_BYTES} printable bytes without a comma, without spaces side by side or at the ends, "
            f"that begins with none of {' '.join(FORMULA)}"
        )
    reader = READERS.get(file.suffix.lower())
    if reader is None:
        clips = "; give the .amc clips that belong to it" * (file.suffix.lower() == ".asf")
        raise MotionError(f"{file}: unknown kind of file; motions are read from {', '.join(READERS)}{clips}")
    # Absurd numbers overflow here, and are refused by name where recording errors are looked for.
    with np.errstate(all="ignore"):
        raw = reader(file, options)
        damped = raw.poses.copy()
        damped[:, HANDS] *= HAND_DAMPING
        raw = remove_recording_errors(replace(raw, poses=damped), repair=options.repair)
    raw = turn_y_up(raw, options.up)
    return Motion(name, raw.poses, raw.translations, raw.fps, "recorded", raw.source)


def holds_shape_alone(file: Path) -> bool:
    """Return whether a file is what AMASS keeps beside a subject's clips: a body's shape, and no motion."""
    if not any(fnmatch(file.name, pattern) for pattern in SHAPE_FILES):  # others are opened once, to be read
        return False
    try:
        return not set(array_names(file)) & set(ARRAY_NAMES)
    except ArrayFileError:  # a damaged file is refused where it is read
        return False
