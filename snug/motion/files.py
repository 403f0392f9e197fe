"""Motions from files of motion capture, ready to use: checked, y up, resampled, arms spread.

Arrays of SMPL's joints, axis-angle relative to the parent joint, are read by their names from .npz in
AMASS's layout and from pickled dicts. SMPL, SMPL+H and SMPL-X begin with the same 22 joints; fingers,
shape coefficients and soft tissue are left out.

| content | arrays, the first that is there | shape, T frames |
| --- | --- | --- |
| axis-angle [rad] | `poses`, `pose` | SMPL (T, 72), (T, 24, 3), SMPL+H (T, 156), SMPL-X (T, 165), (T, 66) |
| the same, root apart | `poses`, `pose`, `pose_body`, `body_pose` | (T, 63), (T, 69) |
| root apart | `root_orient`, `global_orient` | (T, 3), (T, 1, 3) |
| path of the root [m] | `trans`, `transl`, `translations` | (T, 3), (T, 1, 3) |
| rate [1/s] | `mocap_framerate`, `mocap_frame_rate`, `framerate`, `frame_rate`, `fps` | one number |
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable, Mapping
from dataclasses import replace
from fnmatch import fnmatch
from pathlib import Path

import numpy as np

from reference_sim.files.array_file import ArrayFileError, read_arrays, read_pickled_arrays
from snug.body.skeleton import BODY_JOINTS, JOINT, JOINT_NAMES
from snug.file_options import MotionFileOptions
from snug.motion.acclaim import read_asf_amc
from snug.motion.bvh import read_bvh
from snug.motion.motion import Motion, MotionError, clear_arms, place, resample
from snug.motion.recording import are_positions, check_recording, frame_rate, turn_y_up

LAYOUTS = {22: "body", 24: "SMPL", 52: "SMPL+H", 55: "SMPL-X"}  # joints, the root among them
# Of several names the first that a file has is read.
ROTATIONS = ("poses", "pose", "pose_body", "body_pose")
ROOT_ROTATIONS = ("root_orient", "global_orient")
PATHS = ("trans", "transl", "translations")
RATES = ("mocap_framerate", "mocap_frame_rate", "framerate", "frame_rate", "fps")
ARRAY_NAMES = (*ROTATIONS, *ROOT_ROTATIONS, *PATHS, *RATES)


def read_smpl_arrays(path: Path, options: MotionFileOptions) -> Motion:
    """Read an .npz or a pickled dict with arrays of the table. Nothing in a pickle is executed.

    Raises:
        MotionError: names file, array and remedy.
    """
    read = read_pickled_arrays if path.suffix.lower() == ".pkl" else read_arrays
    try:
        arrays = read(path, ARRAY_NAMES)
    except ArrayFileError as error:
        raise MotionError(f"{error}; give an .npz with 'poses', 'trans' and 'fps'") from None
    for name, array in arrays.items():
        if array.dtype.kind not in "iuf" or array.size == 0:
            raise MotionError(f"array '{name}' is empty or holds no numbers; give floating-point values")
    arrays = {name: array.astype(np.float64) for name, array in arrays.items()}
    name = _first(arrays, ROTATIONS, "rotations (frames, 72) [rad]")
    turns, frames = _triples(arrays, name), len(arrays[name])
    if turns.shape[1] + 1 in LAYOUTS:
        root = _first(arrays, ROOT_ROTATIONS, f"the root's rotation beside '{name}'")
        turns = np.concatenate([_triples(arrays, root, frames)[:, :1], turns], axis=1)
        name = f"{root} and {name}"
    if turns.shape[1] not in LAYOUTS:
        sizes = ", ".join(f"{3 * joints} ({layout})" for joints, layout in LAYOUTS.items())
        raise MotionError(
            f"'{name}' has shape {arrays[name].shape}; give (frames, columns), columns one of {sizes}"
        )
    if are_positions(turns):
        raise MotionError(f"'{name}' holds positions of joints; give their rotations, axis-angle [rad]")
    poses = np.zeros((frames, len(JOINT_NAMES), 3))
    count = poses.shape[1] if turns.shape[1] == poses.shape[1] else BODY_JOINTS
    poses[:, :count] = turns[:, :count]
    place = _first(arrays, PATHS, "the root's path (frames, 3) [m]; zeros where it stays")
    translations = _triples(arrays, place, frames)[:, 0]
    stated = next((arrays[rate] for rate in RATES if rate in arrays), None)
    if stated is not None and stated.size != 1:
        raise MotionError(f"the frames per second are {stated.size} numbers; give one")
    fps = frame_rate(frames, None if stated is None else stated.item(), options.fps)
    source = f"{path.name} ({name}, {LAYOUTS[turns.shape[1]]} layout)"
    return Motion(path.stem, poses, translations, fps, "recorded", source)


def _first(arrays: Mapping[str, np.ndarray], names: tuple[str, ...], meaning: str) -> str:
    """Return the first of `names` that the arrays have. Raises MotionError."""
    for name in names:
        if name in arrays:
            return name
    keys = ", ".join(sorted(arrays)) or "none that is known"
    raise MotionError(f"no array '{names[0]}' (found {keys}); give {meaning}")


def _triples(arrays: Mapping[str, np.ndarray], name: str, frames: int = 0) -> np.ndarray:
    """Return (T, N, 3) of an array (T, 3 N) or (T, N, 3). Raises MotionError.

    frames: T of an array that has one triple a frame; 0 for any T and N.
    """
    array, shape = arrays[name], arrays[name].shape
    if frames and shape not in ((frames, 3), (frames, 1, 3)):
        raise MotionError(f"'{name}' has shape {shape}; give ({frames}, 3), a row for each pose")
    if not (shape[2:] == (3,) or (len(shape) == 2 and shape[1] % 3 == 0)):
        raise MotionError(
            f"'{name}' has shape {shape}; give (frames, 3 joints) or (frames, joints, 3) [rad]"
        )
    return array.reshape(len(array), -1, 3)


# Extension of a motion file: its reader. Each gives the clip as recorded, in the axes of the file.
READERS: dict[str, Callable[[Path, MotionFileOptions], Motion]] = {
    ".amc": read_asf_amc,
    ".bvh": read_bvh,
    ".npz": read_smpl_arrays,
    ".pkl": read_smpl_arrays,
}
# As the authors of SNUG did: recorded hands are noisy and drive nothing.
HAND_DAMPING = 0.1
HANDS = [JOINT[f"{side}_{joint}"] for side in ("left", "right") for joint in ("wrist", "hand")]

# Of a motion: rows of CSV files and lists in options hold it.
NAME = re.compile(r"\w[\w.+()-]*( [\w.+()-]+)*")
MAX_NAME_BYTES = 100
# Of a subject, which AMASS keeps beside its clips, and what macOS leaves beside each file on other disks.
SHAPE_FILES = ("shape.npz", "*_stagei.npz", "._*")
CMU_FILE = re.compile(r"(\d+_\d+)(_poses|_stageii)?")  # CMU's number of a clip; AMASS adds to it


def load_motions(path: str | Path, *, options: MotionFileOptions | None = None) -> list[Motion]:
    """Read motions from a file, or from every motion file of a folder, in the order of their names.

    Each comes back whole, at 30 frames per second, placed on the floor at the origin facing +z, with the
    arms spread by `clear_arms` and the hands' rotations at a tenth. CMU files (.amc) need their skeleton
    (.asf) beside them. Of a folder, a subject's shape as AMASS keeps it beside the clips (SHAPE_FILES) is
    left out. With the option `split` its clips alone are read, named by their numbers; one
    that cannot be read is left out with a warning.

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
    options = options or MotionFileOptions()
    motions = []
    for name, file in _files_by_name(Path(path), options).items():
        try:
            motion = clear_arms(resample(place(read_motion(file, options))))
        except MotionError as error:
            if not options.split:
                raise
            warnings.warn(f"{error} (left out of split {options.split})", stacklevel=2)
        else:
            motions.append(replace(motion, name=name))
    return motions


def _files_by_name(path: Path, options: MotionFileOptions) -> dict[str, Path]:
    """Return name -> file of the motions of a file or folder, as `load_motions` takes them."""
    readable = ", ".join(READERS)
    if not path.exists():
        raise MotionError(f"{path}: no such file or folder; give a motion file ({readable}) or a folder")
    files = [path]
    if path.is_dir():
        listed = path.rglob("*") if options.split else path.iterdir()
        motion_files = sorted(file for file in listed if file.suffix.lower() in READERS)
        files = [f for f in motion_files if not any(fnmatch(f.name, shape) for shape in SHAPE_FILES)]
    clips = options.clips("train", "test")
    named: dict[str, Path] = {}
    for file in files:
        number = CMU_FILE.fullmatch(file.stem)
        name = number[1] if options.split and number else file.stem
        if options.split and name not in clips:
            continue
        if name in named:
            raise MotionError(f"{path}: {name} is in {named[name]} and {file}: leave one")
        named[name] = file
    if not named:
        kind = f"file of a clip of split {options.split}" if options.split else "motion file"
        raise MotionError(f"{path}: holds no {kind} ({readable}); give a folder of motion capture clips")
    return named


def read_motion(file: Path, options: MotionFileOptions) -> Motion:
    """Read one clip as recorded, at its rate, y up and without recording errors. Raises MotionError."""
    name = file.stem
    if not NAME.fullmatch(name) or len(name.encode(errors="replace")) > MAX_NAME_BYTES:
        raise MotionError(
            f"{str(file)[:200]!a}: a motion is named after its file; give it a name of at most "
            f"{MAX_NAME_BYTES} bytes: letters, digits, single spaces"
        )
    reader = READERS.get(file.suffix.lower())
    try:
        if reader is None:
            raise MotionError(f"unknown kind of file; motions are read from {', '.join(READERS)}")
        with np.errstate(all="ignore"):  # absurd numbers overflow here, and are refused
            motion = reader(file, options)
            motion.poses[:, HANDS] *= HAND_DAMPING
            check_recording(motion)
        return turn_y_up(motion, options.up)
    except MotionError as error:
        raise MotionError(f"{file}: {error}") from None
