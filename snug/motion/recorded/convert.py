"""Convert the original recordings into `clips.npz`, as a user's files are read, and repair them once.

    python -m snug.motion.recorded.convert FOLDER

Users never run this: the result is committed. FOLDER holds the files that NOTICE.md names. The command
prints each clip's line of the table in `snug.motion.recorded.table`, and the table of repairs of NOTICE.md.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from snug.body.skeleton import JOINT_NAMES
from snug.motion.files import HANDS, read_motion
from snug.motion.formats import READERS
from snug.motion.motion import Motion, clear_arms, place, resample
from snug.motion.options import MotionFileOptions
from snug.motion.raw_motion import RawMotion
from snug.motion.recorded.table import CLIPS, CLIPS_FILE, digest_of
from snug.motion.recording_errors import remove_recording_errors

# Half of what is let pass in a user's file. At 30 fps it is 57 degrees from frame to frame: the converted
# files twist a shoulder or a foot by that much for single frames, where no marker moves so fast.
TURN_LIMIT = 30.0  # [rad/s]
OPTIONS = MotionFileOptions(repair=True)


def convert(file: Path) -> tuple[Motion, list[tuple[str, str, str, str]]]:
    """Return a clip as the library has it, and its repairs: clip, rate [1/s], joint and frames of each."""
    recorded = READERS[file.suffix](file, OPTIONS)
    read = read_motion(file, OPTIONS)
    sampled = resample(read)
    raw = RawMotion(
        path=file, poses=sampled.poses, translations=sampled.translations, fps=sampled.fps, source=""
    )
    repaired = remove_recording_errors(raw, repair=True, turn_limit=TURN_LIMIT)
    repairs = [
        *_repairs(file.stem, recorded.poses, read.poses, recorded.fps),
        *_repairs(file.stem, sampled.poses, repaired.poses, sampled.fps),
    ]
    motion = Motion(file.stem, repaired.poses, repaired.translations, sampled.fps, source=read.source)
    return clear_arms(place(motion)), repairs


def _repairs(
    clip: str, before: np.ndarray, after: np.ndarray, fps: float
) -> Iterator[tuple[str, str, str, str]]:
    """Yield clip, rate, joint and frames where rotations (T,24,3) differ; hands were damped, not repaired."""
    changed = (np.abs(after - before) > 1e-9).any(axis=2)
    changed[:, HANDS] = False
    for joint in np.flatnonzero(changed.any(axis=0)):
        edges = np.flatnonzero(np.diff(np.concatenate([[0], changed[:, joint].astype(int), [0]])))
        spans = ", ".join(f"{first}-{last - 1}" for first, last in zip(edges[::2], edges[1::2]))
        yield clip, f"{fps:g}", JOINT_NAMES[joint], spans


def main() -> None:
    """Convert every clip of the table and write them to CLIPS_FILE."""
    parser = argparse.ArgumentParser(description="Convert recordings into the clips of the library.")
    parser.add_argument("folder", type=Path, help="folder of the .npz, .amc and .asf files of NOTICE.md")
    folder = parser.parse_args().folder
    files = {file.stem: file for file in sorted(folder.iterdir()) if file.suffix in (".npz", ".amc")}
    if missing := sorted(set(CLIPS) - set(files)):
        parser.error(f"{folder}: lacks the clips {', '.join(missing)}; give the folder that holds all")
    arrays: dict[str, np.ndarray] = {}
    repairs: list[tuple[str, str, str, str]] = []
    for name in CLIPS:
        motion, repaired = convert(files[name])
        poses, translations = motion.poses.astype(np.float32), motion.translations.astype(np.float32)
        arrays |= {f"{name}/poses": poses, f"{name}/translations": translations}
        arrays |= {f"{name}/source": np.array(motion.source)}
        repairs += repaired
        print(f"{name}: {motion.frames} frames, digest {digest_of(poses, translations)}")
    np.savez_compressed(CLIPS_FILE, **arrays)  # type: ignore[arg-type]
    print("\n".join(["| clip | frames a second | joint | frames repaired |", "| --- | --- | --- | --- |"]))
    print("\n".join(f"| {' | '.join(row)} |" for row in repairs))


if __name__ == "__main__":
    main()
