"""JSON that a run has written, and that a stranger may have changed: read without believing its types."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

DEEPEST = 30  # levels of lists and objects in one another


class ResultsError(ValueError):
    """A run folder or one of its files is absent or not what it should be; the message names it."""


def read_json(path: Path) -> dict[str, Any]:
    """Read the JSON object in a file. Raises ResultsError."""
    try:
        value = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise ResultsError(f"{path}: no such file; is this the folder of a run?") from None
    except (ValueError, RecursionError, OSError) as error:  # also for a number of 5000 digits
        raise ResultsError(f"{path}: not readable as JSON ({' '.join(str(error).split())})") from None
    if not isinstance(value, dict):
        raise ResultsError(f"{path}: holds no JSON object")
    level: list[Any] = [value]
    for _ in range(DEEPEST):
        level = [inner for outer in level for inner in _inside(outer)]
    if level:
        raise ResultsError(f"{path}: is nested more than {DEEPEST} deep")
    return value


def _inside(value: Any) -> list[Any]:
    return list(value.values()) if isinstance(value, dict) else value if isinstance(value, list) else []
