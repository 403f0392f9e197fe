"""Check of the counts that a mesh file declares against its length, before a library believes them.

meshio reads a header that does not end for ever; meshio and VTK make room for as many vertices as a file
claims, and look for all of them.
"""

from __future__ import annotations

import re
from pathlib import Path

from reference_sim.cloth import MeshError
from reference_sim.files.array_file import MOST_PACKED

EXPORT_AGAIN = "export it again, as OBJ or PLY"
SECTIONS = (
    b"POINTS|VERTICES|LINES|POLYGONS|TRIANGLE_STRIPS|CELLS|CELL_TYPES|POINT_DATA|CELL_DATA|"
    rb"DIMENSIONS|[XYZ]_COORDINATES|FIELD\s+\S+|LOOKUP_TABLE\s+\S+|COLOR_SCALARS\s+\S+"
)
# Suffix -> where numbers of elements stand, and how many may lie in a byte.
COUNTS = {
    ".ply": (rb"^[ \t]*element[ \t]+\w+((?:[ \t]+\d+)+)", 1),
    ".off": (rb"^[ \t]*(\d+[ \t]+\d+[ \t]+\d+)[ \t]*$", 1),
    ".vtk": (rb"^[ \t]*(?:" + SECTIONS + rb")((?:[ \t]+\d+)+)", 1),
    ".vtp": (rb"NumberOf\w+\s*=\s*[\"']\s*(\d+)", MOST_PACKED),
    ".vtu": (rb"NumberOf\w+\s*=\s*[\"']\s*(\d+)", MOST_PACKED),
}


def check_header(path: Path) -> None:
    """Refuse a file shorter than its header says, and a PLY or OFF file without a header.

    Raises:
        MeshError: the message names file and line.
    """
    pattern, dense = COUNTS.get(path.suffix.lower(), (b"", 0))
    if not pattern:
        return
    data = path.read_bytes()
    most, kind = dense * len(data), path.suffix.lower()
    end = re.search(rb"^\s*end_header\s*$", data, re.MULTILINE) if kind == ".ply" else None  # in no comment
    head = data[: end.start()] if end else data
    lines = list(re.finditer(pattern, head, re.MULTILINE | re.IGNORECASE))
    if (kind == ".ply" and not end) or (kind == ".off" and not lines):
        raise MeshError(f"{path}: cannot be read (its header does not end): {EXPORT_AGAIN}")
    for line in lines[:1] if kind == ".off" else lines:  # vertices of OFF may be whole numbers too
        for count in line[1].split():
            if len(count) > 20 or int(count) > most:
                text = " ".join(line[0].decode(errors="replace").split())[:60]
                raise MeshError(f"{path}: cannot be read (shorter than '{text}' says): {EXPORT_AGAIN}")
