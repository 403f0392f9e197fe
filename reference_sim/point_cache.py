"""Trajectory as a PC2 point cache beside an OBJ, as Blender's Mesh Cache modifier reads it.

A 32-byte header (signature, version 1, number of points, first frame, frames per sample, number of samples),
then float32 positions, sample by sample. PC16 is the same in float16.
"""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np

from reference_sim.files.atomic_files import replacing
from reference_sim.trajectory import Trajectory, TrajectoryError

SIGNATURE = b"POINTCACHE2\0"
HEADER_SIZE = len(SIGNATURE) + 20
TYPES = {".pc2": "<f4", ".pc16": "<f2"}


def write_point_cache(path: str | Path, trajectory: Trajectory) -> tuple[Path, Path]:
    """Write PC2 [m, y up, float32] at `path` and the first frame as OBJ beside it; return both paths.

    Each file is written whole or not at all.

    Raises:
        ValueError: the name does not end in .pc2.

    >>> import tempfile
    >>> faces, times = np.array([[0, 1, 2]]), np.array([0.0, 1 / 30])
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     cache, mesh = write_point_cache(f"{folder}/a.pc2", Trajectory(np.zeros((2, 3, 3)), faces, times))
    ...     read_point_cache(cache).shape
    (2, 3, 3)
    """
    path = Path(path)
    if path.suffix.lower() != ".pc2":
        raise ValueError(f"{path}: a point cache ends in .pc2")
    mesh = path.with_suffix(".obj")
    frames, points, _ = trajectory.positions.shape
    header = SIGNATURE + struct.pack("<iiffi", 1, points, 0.0, 1.0, frames)
    with replacing(path) as temporary:
        temporary.write_bytes(header + trajectory.positions.astype("<f4").tobytes())
    write_obj(mesh, trajectory.positions[0], trajectory.faces)
    return path, mesh


def write_obj(path: Path, positions: np.ndarray, faces: np.ndarray) -> None:
    """Write vertices (V,3) [m, y up] with the digits of float32 and faces (F,3), whole or not at all."""
    lines = [f"v {x:.9g} {y:.9g} {z:.9g}\n" for x, y, z in positions.tolist()]
    lines += [f"f {a} {b} {c}\n" for a, b, c in (faces + 1).tolist()]
    with replacing(path) as temporary:
        temporary.write_text("".join(["# metres, y up\n", *lines]), encoding="utf-8")


def read_point_cache(path: str | Path) -> np.ndarray:
    """Read positions (T, V, 3) of a .pc2 (float32) or .pc16 (float16) file, in its unit and axes.

    Raises:
        TrajectoryError: no such file, no point cache, or not as long as its header says.

    >>> read_point_cache("cloth.pc2").shape  # of a file with 50 frames of 1002 vertices  # doctest: +SKIP
    (50, 1002, 3)
    """
    path = Path(path)
    if not path.is_file():
        raise TrajectoryError(f"{path}: no such file")
    if path.suffix.lower() not in TYPES:
        raise TrajectoryError(f"{path}: a point cache is named {' or '.join(TYPES)}")
    kind, length = np.dtype(TYPES[path.suffix.lower()]), path.stat().st_size
    with path.open("rb") as file:
        header = file.read(HEADER_SIZE)
        if len(header) < HEADER_SIZE or not header.startswith(SIGNATURE):
            raise TrajectoryError(f"{path}: is no point cache: it does not begin with POINTCACHE2")
        version, points, _, _, frames = struct.unpack("<iiffi", header[len(SIGNATURE) :])
        declared = HEADER_SIZE + frames * points * 3 * kind.itemsize
        if version != 1 or points < 1 or frames < 1 or declared != length:
            raise TrajectoryError(
                f"{path}: version {version}, {frames} samples of {points} points take {declared} bytes, the "
                f"file has {length}: write it again"
            )
        return np.fromfile(file, kind).reshape(frames, points, 3)
