"""Files that anyone may have given: regular ones alone, and TOML of the size that people write."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

LARGEST = 1 << 20  # bytes of a TOML file
DEEPEST = 32  # tables and lists within each other, and parts of a dotted name
# One dotted name of too many parts, in text whose quotes are empty. tomllib's time and memory grow with
# the square of the parts.
LONG_NAME = re.compile(rf"(?<![\w-])(?:[\w-]++[ \t]*+\.[ \t]*+){{{DEEPEST}}}")
QUOTED = re.compile(r'"(?:\\.|[^"\\\n])*+"|\'[^\'\n]*+\'')


def demand_file(path: str | Path) -> Path:
    """Return the path. Raises OSError for a folder, pipe or device, which could be read without end."""
    path = Path(path)
    if path.exists() and not path.is_file():
        raise OSError(f"{path} is no regular file")
    return path


def read_toml(path: str | Path) -> dict[str, Any]:
    """Read a TOML file. Raises OSError, and ValueError as `parse_toml` or for no field, without its name."""
    path = demand_file(path)
    if (size := path.stat().st_size) > LARGEST:
        raise ValueError(f"{size} bytes: at most {LARGEST} are read")
    table = parse_toml(path.read_text(encoding="utf-8-sig"))
    if not table:
        raise ValueError("holds no field")
    return table


def parse_toml(text: str) -> dict[str, Any]:
    """Return the tables of TOML.

    Raises ValueError: no TOML (tomllib.TOMLDecodeError), deeper than DEEPEST, or a whole number beyond
    the 64 bits of the format.
    """
    if LONG_NAME.search(QUOTED.sub("q", text)):
        raise ValueError(f"a name of more than {DEEPEST} parts")
    try:
        table = tomllib.loads(text)
    except RecursionError:
        raise ValueError(f"tables or lists more than {DEEPEST} deep") from None
    check_values(table)
    return table


def check_values(table: Mapping[str, Any]) -> None:
    """Raise ValueError for a table deeper than DEEPEST, or with a whole number beyond 64 bits."""
    level: list[Any] = [table]
    for _ in range(DEEPEST + 1):
        if any(isinstance(value, int) and not -(1 << 63) <= value < 1 << 63 for value in level):
            raise ValueError("a whole number beyond 64 bits")
        lists = (
            value.values() if isinstance(value, dict) else value
            for value in level
            if isinstance(value, dict | list)
        )
        level = [item for values in lists for item in values]
    if level:
        raise ValueError(f"tables or lists more than {DEEPEST} deep")
