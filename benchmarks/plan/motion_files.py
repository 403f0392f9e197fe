"""Files that the option --motions names: which of a folder are motions, and what they may be called."""

from __future__ import annotations

from collections.abc import Sequence
from fnmatch import fnmatch
from pathlib import Path

from benchmarks.assets.inputs import LIBRARY
from benchmarks.plan.plan import PlanError

BODY_SHAPES = ("shape.npz", "*_stagei.npz")  # of a subject: AMASS keeps them beside its clips


def list_motion_files(paths: Sequence[str]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Replace each folder by its motion files, in the order of their names.

    In a folder files of BODY_SHAPES are left out where they hold no motion. A folder without any motion
    stays, for its reader to refuse.

    Args:
        paths: files and folders; the word "library" stays as it is.

    Returns:
        The paths, and a remark on each file that is left out.

    Raises:
        PlanError: a file with a comma in its name, which no option could name, or with spaces side by side or
            at the ends of its name, which rows write as one or none.
    """
    if not any(path != LIBRARY for path in paths):
        return tuple(paths), ()
    from snug.motion.formats import READERS  # loads scipy

    files, remarks = list[str](), list[str]()
    for path in paths:
        folder = Path(path)
        if path == LIBRARY or not folder.is_dir():
            files.append(path)
            continue
        clips = sorted(file for file in folder.iterdir() if file.suffix.lower() in READERS)
        others = {clip: names for clip in clips if (names := _without_motion(clip))}
        moving = [str(clip) for clip in clips if clip not in others]
        if moving:
            remarks += [
                f"--motions {clip}: left out: no array of a motion (found {names})"
                for clip, names in others.items()
            ]
        files += moving or [path]
    for file in files:
        stem = Path(file).stem
        if Path(file).is_file() and ("," in stem or stem != " ".join(stem.split())):
            raise PlanError(
                f"--motions {file}: a motion is named after its file, without commas and without spaces side "
                "by side or at the ends: rename it"
            )
    return tuple(files), tuple(remarks)


def _without_motion(file: Path) -> str:
    """Return the names of the arrays in a file of BODY_SHAPES, none of which is of a motion; else empty."""
    if not any(fnmatch(file.name, pattern) for pattern in BODY_SHAPES):  # others are opened once, to be read
        return ""
    from reference_sim.files.array_file import ArrayFileError, array_names
    from snug.motion.smpl_arrays import ARRAY_NAMES

    try:
        names = array_names(file)
    except ArrayFileError:  # a damaged file is refused where it is read
        return ""
    return "" if set(names) & set(ARRAY_NAMES) else ", ".join(names[:12]) or "nothing"
