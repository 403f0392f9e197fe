"""Recovery of a run that was cut off: the whole frames of its file, and whether it is the same run.

A resumed run takes up positions and velocity exactly as they were, and prepares the last step once more
(terms may remember something of it, as lagged friction does), so that on one machine it ends in the same
bits as a run that was never interrupted. What a minimiser has learned in earlier steps is not stored: see
`simulate` for the two that learn.
"""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from reference_sim.files.atomic_files import create
from reference_sim.files.trial import try_out
from reference_sim.trajectory.trajectory import Trajectory, TrajectoryError, read_frames
from reference_sim.trajectory.writer import BEFORE_LAST_STEP, END_OF_FILE, FIRST_FAILURE, UNFINISHED

if TYPE_CHECKING:
    import h5py


@dataclass(frozen=True, eq=False)
class PartialRun:
    """Whole frames of an earlier run.

    Attributes:
        trajectory: those frames, with the status of the worst that failed, or "converged".
        before: positions and velocity (2, V, 3) from which the last step to the last frame was made; None
            where the file does not hold them.
        ended: False if the run that wrote the file did not end by itself.
    """

    trajectory: Trajectory
    before: np.ndarray | None
    ended: bool

    def complete(self, frames: int) -> bool:
        """Return whether nothing is left to do for a run of `frames` frames."""
        return self.ended and (self.trajectory.frames == frames or self.trajectory.status == "diverged")


def recover(path: str | Path, provenance: dict[str, Any], *, frames: int) -> PartialRun | None:
    """Return the whole frames of the run in `path`, or None if there is no such file.

    Args:
        path: VTKHDF file.
        provenance: of the run that is to go on; the file's must be the same.
        frames: number of frames that is asked for.

    Raises:
        TrajectoryError: the file cannot be read at all, another run wrote it, or it holds more than `frames`.
    """
    path = Path(path)
    if not path.exists():
        return None
    try:
        if wrong := try_out(read_whole_frames, path):
            raise ValueError(wrong)
        earlier = read_whole_frames(path)
    except ImportError:
        raise
    except Exception as error:
        raise TrajectoryError(
            f"{path}: nothing to resume: not a readable trajectory ({_one_line(error)}); "
            "remove it, or write elsewhere"
        ) from None
    _check_same_run(path, earlier.trajectory.provenance, provenance)
    if earlier.trajectory.frames > frames:
        raise TrajectoryError(
            f"{path}: holds {earlier.trajectory.frames} frames already, more than the {frames} asked for"
        )
    return earlier


def read_whole_frames(path: Path) -> PartialRun:
    """Read the frames of a file that are whole; its end may be cut off.

    Raises:
        Exception: of any kind, for a file that is no trajectory or is damaged.
    """
    with _opened(path) as file:
        return _whole_frames(file)


@contextmanager
def _opened(path: Path) -> Iterator[h5py.File]:
    """Open the file, or a copy of it as long as HDF5 believes it to be, where its end was cut off."""
    import h5py

    with open(path, "rb") as raw:
        head = raw.read(END_OF_FILE.stop)
    missing = int.from_bytes(head[END_OF_FILE], "little") - path.stat().st_size
    if not (head.startswith(b"\x89HDF\r\n\x1a\n\0") and 0 < missing < 1 << 32):
        with h5py.File(path, "r") as file:
            yield file
        return
    copy = path.with_name(path.name + ".recovered")
    try:
        create(copy)
        shutil.copyfile(path, copy)
        os.truncate(copy, path.stat().st_size + missing)
        with h5py.File(copy, "r") as file:
            yield file
    finally:
        copy.unlink(missing_ok=True)


def _whole_frames(file: h5py.File) -> PartialRun:
    benchmark, points = file["benchmark"], file["VTKHDF/Points"]
    vertex_count = int(file["VTKHDF/NumberOfPoints"][0])
    written = min(int(benchmark.attrs["frames"]), len(points) // vertex_count)
    whole = 0
    while whole < written:
        try:
            _ = points[whole * vertex_count : (whole + 1) * vertex_count]
        except OSError:  # the compressed block was cut off or overwritten
            break
        whole += 1
    if whole == 0:
        raise ValueError("no whole frame in it")
    last = whole - 1
    held = BEFORE_LAST_STEP in benchmark and last >= written - 2
    before = benchmark[BEFORE_LAST_STEP][last % 2] if held else None
    trajectory = read_frames(file, frames=whole)
    ended = trajectory.status != UNFINISHED
    if not ended:
        status, reason = json.loads(benchmark.attrs.get(FIRST_FAILURE, '["converged", ""]'))
        trajectory = replace(trajectory, status=status, reason=reason)
    return PartialRun(trajectory, before, ended)


def _check_same_run(path: Path, then: dict[str, Any], now: dict[str, Any]) -> None:
    """Refuse to mix two runs; the message names what differs."""
    then, now = _flat(then), _flat(json.loads(json.dumps(now)))
    different = [
        f"{key} ({then.get(key)}, now {now.get(key)})"
        for key in dict.fromkeys([*now, *then])
        if json.dumps(then.get(key)) != json.dumps(now.get(key))  # where NaN is NaN
    ]
    if different:
        raise TrajectoryError(
            f"{path}: made by another run, differing in {', '.join(different)}: write elsewhere or anew"
        )


def _flat(tree: dict[str, Any], prefix: str = "") -> dict[str, Any]:
    """Return the leaves of nested dictionaries by dotted name."""
    leaves: dict[str, Any] = {}
    for key, value in tree.items():
        leaves |= _flat(value, f"{prefix}{key}.") if isinstance(value, dict) else {f"{prefix}{key}": value}
    return leaves


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())
