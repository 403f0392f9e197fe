"""JSON that a run has written, and that a stranger may have changed: read without believing its types."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

DEEPEST = 30  # levels of lists and objects in one another
LARGEST = 1e12  # of a number of seconds


class ResultsError(ValueError):
    """A run folder or one of its files is absent or not what it should be; the message names it."""


def read_json(path: Path) -> dict[str, Any]:
    """The JSON object in a file. Raises ResultsError."""
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


def check_config(path: Path, config: Mapping[str, Any]) -> None:
    """Raises ResultsError for an entry of run.json that is not of the type that its readers take it for."""
    for name, (fits, due) in _DUE.items():
        if config.get(name) is not None and not fits(config[name]):
            raise ResultsError(f"{path}: '{name}' should be {due}")


def _is_text(value: Any) -> bool:
    return value is None or isinstance(value, str)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and abs(value) < LARGEST


def _declares(*texts: str, point: str = "") -> Callable[[Any], bool]:
    """Whether a value is name -> what is said of it, some of which are texts, and one two numbers."""

    def fits(value: Any) -> bool:
        said = value.values() if isinstance(value, dict) else [None]
        return all(
            isinstance(parts, dict)
            and all(_is_text(parts.get(name)) for name in texts)
            and (not parts.get(point) or _is_point(parts[point]))
            for parts in said
        )

    return fits


def _is_point(value: Any) -> bool:
    return isinstance(value, list) and len(value) == 2 and all(map(_is_number, value))


def _is_stages(value: Any) -> bool:
    return isinstance(value, list) and all(
        isinstance(stage, dict) and isinstance(stage.get("name"), str) and _is_number(stage.get("seconds"))
        for stage in value
    )


def _is_looks(value: Any) -> bool:
    return isinstance(value, list) and all(isinstance(v, dict) and _is_text(v.get("rows")) for v in value)


_DUE: dict[str, tuple[Callable[[Any], bool], str]] = {
    "metrics": (_declares("title", "definition", "table", "unit"), "metric -> what it declares"),
    "methods": (_declares("label"), "method -> what it declares"),
    "scenes": (_declares(), "scene -> what it declares"),
    "cases": (_declares("scene", "metric", point="map_point"), "case -> what it declares"),
    "digests": (lambda v: isinstance(v, dict) and all(map(_is_text, v.values())), "file -> digest"),
    "stages": (_is_stages, "a list of names and seconds"),
    "earlier": (lambda v: isinstance(v, list), "a list of earlier runs"),
    "test_looks": (_is_looks, "a list of looks at the test motions"),
}
