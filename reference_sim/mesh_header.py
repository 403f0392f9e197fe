"""Counts that a mesh file declares, compared with its length before a library believes them.

meshio reads a PLY header that does not end for ever, and makes room for as many vertices as a file claims.
"""

from __future__ import annotations

import re
from pathlib import Path

from .cloth import MeshError

HEADER = 1 << 16  # [bytes] in which a header has to end
REMEDY = "export it again, as OBJ or PLY"


def check_header(path: Path) -> None:
    """Refuse a PLY or OFF file without a whole header, or shorter than it says. Raises MeshError."""
    kind = path.suffix.lower()
    if kind not in (".ply", ".off"):
        return
    with path.open("rb") as file:
        head = file.read(HEADER)
    if kind == ".ply":
        end = re.search(rb"^end_header\s*$", head, re.MULTILINE)
        if end is None:
            raise MeshError(f"{path}: cannot be read (its header does not end): {REMEDY}")
        found = re.findall(rb"^\s*element\s+(\w+)\s+(\d+)", head[: end.start()], re.MULTILINE)
        counts = {name.decode(): int(count) for name, count in found}
    else:
        lines = (line.strip() for line in head.splitlines()[1:])
        first = next((line for line in lines if line and not line.startswith(b"#")), b"")
        words = first.split()
        if len(words) < 2 or not all(word.isdigit() for word in words[:2]):
            raise MeshError(f"{path}: cannot be read (no counts of vertices and faces): {REMEDY}")
        counts = dict(zip(("vertex", "face"), map(int, words)))
    for name, count in counts.items():
        if count > path.stat().st_size:
            raise MeshError(f"{path}: cannot be read (shorter than {count:.4g} of {name}): {REMEDY}")
