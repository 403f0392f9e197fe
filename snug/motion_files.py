"""Motions from files of motion capture, made ready to be worn: resampled, placed, arms spread."""

from __future__ import annotations

from pathlib import Path

from snug.formats import READERS
from snug.motion import Motion, MotionError, clear_arms, place, resample, spread_arms

LONGEST_NAME = 100  # bytes of a motion's name


def load_motions(path: str | Path, *, spread_degrees: float | None = None, fps: float = 30.0) -> list[Motion]:
    """Motions from a .amc or .npz file, or from every such file of a folder, in the order of their names.

    Each comes back whole, at `fps`, placed on the floor at the origin facing +z, with the arms spread by
    `spread_degrees` (0: as recorded; None: as far as clear_arms finds needed). CMU files (.amc) need their
    skeleton (.asf) beside them.
    Raises MotionError, one line with file, line and remedy, for anything that cannot be read.
    """
    path = Path(path)
    if not path.exists():
        raise MotionError(f"{path}: no such file or folder; give an .amc or .npz file, or a folder of them")
    files = [path]
    if path.is_dir():
        files = sorted(file for file in path.iterdir() if file.suffix.lower() in (".amc", ".npz"))
    if not files:
        raise MotionError(f"{path}: holds no .amc and no .npz file; give a folder of motion capture clips")
    clips = [resample(place(_read(file)), fps) for file in files]
    if spread_degrees is None:
        return [clear_arms(clip) for clip in clips]
    return [spread_arms(clip, spread_degrees) for clip in clips]


def _read(file: Path) -> Motion:
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
    return reader(file)
