"""A trajectory as a PC2 point cache beside an OBJ: what Blender's Mesh Cache modifier reads.

A 32-byte header (signature, version 1, number of points, first frame, frames per sample, number of samples),
then float32 positions, sample by sample.
"""

from __future__ import annotations

import struct
from pathlib import Path

from .trajectory import Trajectory
from .whole_file import replacing

SIGNATURE = b"POINTCACHE2\0"


def write_point_cache(path: str | Path, trajectory: Trajectory) -> tuple[Path, Path]:
    """Write PC2 [m, y up, float32] at `path` and the first frame as OBJ beside it; returns both paths.

    Each file is written whole or not at all.

    Raises:
        ValueError: the name does not end in .pc2.
    """
    path = Path(path)
    if path.suffix.lower() != ".pc2":
        raise ValueError(f"{path}: a point cache ends in .pc2")
    mesh = path.with_suffix(".obj")
    frames, points, _ = trajectory.positions.shape
    header = SIGNATURE + struct.pack("<iiffi", 1, points, 0.0, 1.0, frames)
    with replacing(path) as temporary:
        temporary.write_bytes(header + trajectory.positions.astype("<f4").tobytes())
    lines = [f"v {x:.9g} {y:.9g} {z:.9g}\n" for x, y, z in trajectory.positions[0]]
    lines += [f"f {a} {b} {c}\n" for a, b, c in trajectory.faces + 1]
    with replacing(mesh) as temporary:
        temporary.write_text("".join(["# metres, y up\n", *lines]), encoding="utf-8")
    return path, mesh
