"""Motions from files of motion capture, made ready to be worn: checked, upright, resampled, arms spread."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from snug.body.skeleton import JOINT
from snug.motion.formats import READERS
from snug.motion.motion import Motion, MotionError, clear_arms, place, resample, spread_arms
from snug.motion.options import MotionFileOptions
from snug.motion.recording_errors import without_glitches
from snug.motion.vertical_axis import turned_upright

# As the authors of SNUG did: recorded hands are noisy and drive nothing.
HAND_DAMPING = 0.1
HANDS = [JOINT[f"{side}_{joint}"] for side in ("left", "right") for joint in ("wrist", "hand")]

LONGEST_NAME = 100  # bytes of a motion's name


def load_motions(
    path: str | Path,
    *,
    spread_degrees: float | None = None,
    options: MotionFileOptions | None = None,
) -> list[Motion]:
    """Motions from a file, or from every motion file of a folder, in the order of their names.

    Each comes back whole, at 30 frames per second, placed on the floor at the origin facing +z, with the arms
    spread by `spread_degrees` (0: as recorded; None: as far as clear_arms finds needed) and the hands' turns
    at a tenth. options: what the files do not say. CMU files (.amc) need their skeleton (.asf) beside them.
    Raises MotionError, one line with file, element and remedy, for anything that cannot be read.
    """
    path, known = Path(path), ", ".join(READERS)
    if not path.exists():
        raise MotionError(f"{path}: no such file or folder; give a motion file ({known}) or a folder")
    files = [path]
    if path.is_dir():
        files = sorted(file for file in path.iterdir() if file.suffix.lower() in READERS)
    if not files:
        raise MotionError(f"{path}: holds no motion file ({known}); give a folder of motion capture clips")
    clips = [resample(place(read_motion(file, options or MotionFileOptions()))) for file in files]
    if spread_degrees is None:
        return [clear_arms(clip) for clip in clips]
    return [spread_arms(clip, spread_degrees) for clip in clips]


def read_motion(file: Path, reading: MotionFileOptions) -> Motion:
    """One clip as recorded, at the file's rate, upright and without glitches. Raises MotionError."""
    if not file.stem.isprintable() or len(file.stem.encode(errors="replace")) > LONGEST_NAME:
        raise MotionError(
            f"{str(file)[:200]!a}: files are named after a motion; give this one a name of at most "
            f"{LONGEST_NAME} printable bytes"
        )
    reader = READERS.get(file.suffix.lower())
    if reader is None:
        remedy = " Give the .amc clips that belong to it." if file.suffix.lower() == ".asf" else ""
        raise MotionError(
            f"{file}: unknown kind of file; motions are read from {', '.join(READERS)}.{remedy}"
        )
    # Absurd numbers overflow here, and are refused by name where glitches are looked for.
    with np.errstate(all="ignore"):
        recording = reader(file, reading)
        damped = recording.poses.copy()
        damped[:, HANDS] *= HAND_DAMPING
        recording = without_glitches(replace(recording, poses=damped), repair=reading.repair)
    recording = turned_upright(recording, reading.up)
    return Motion(
        file.stem, recording.poses, recording.translations, recording.fps, "recorded", recording.source
    )
