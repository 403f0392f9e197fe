"""The rooms of a package, each with the first line of its docstring, as a table for docs/rooms.md."""

from __future__ import annotations

import ast
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
HEAD = ("Room", "Content")


def room_rows(package: str) -> list[tuple[str, str]]:
    """Return a heading and a row of each folder, then of each module that lies in no folder.

    Args:
        package: name of a package at the top of the repository.

    Raises:
        ValueError: where there is no such package.

    >>> room_rows("reports")[1][0]
    '`blocks/`'
    """
    top = ROOT / package
    if not (top / "__init__.py").is_file():
        raise ValueError(f"no package '{package}' at the top of the repository")
    folders = [(f"`{face.parent.name}/`", face) for face in sorted(top.glob("*/__init__.py"))]
    modules = [(f"`{path.name}`", path) for path in sorted(top.glob("*.py")) if path.name != "__init__.py"]
    return [HEAD, *((name, _first_line(path)) for name, path in folders + modules)]


def _first_line(path: Path) -> str:
    docstring = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
    return docstring.partition("\n")[0]
