"""Motions from files of motion capture, ready to use: checked, y up, resampled, arms spread."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from fnmatch import fnmatch
from pathlib import Path

import numpy as np

from reference_sim.files.array_file import ArrayFileError, array_names
from snug.body.skeleton import JOINT
from snug.motion.acclaim import read_asf_amc
from snug.motion.bvh import read_bvh
from snug.motion.motion import Motion, MotionError, clear_arms, place, resample
from snug.motion.options import MotionFileOptions
from snug.motion.raw_motion import RawMotion
from snug.motion.recording_errors import remove_recording_errors
from snug.motion.smpl_arrays import ARRAY_NAMES, read_smpl_arrays
from snug.motion.vertical_axis import turn_y_up

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
