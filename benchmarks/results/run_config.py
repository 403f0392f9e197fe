"""run.json of a run: its format, and the types of the entries that readers take for granted."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from benchmarks.results.json_file import ResultsError, read_json
from reference_sim.files.atomic_files import replacing

FORMAT = 4  # of run.json, results.csv and the cache; written into run.json
OLD = "written by an earlier version of this project; run the benchmark again in a new folder"
MOST_SECONDS = 1e12  # that a stage may say it took


def write_run_config(path: Path, config: Mapping[str, Any]) -> None:
    """Write run.json, with its format, whole or not at all."""
    text = json.dumps({"format": FORMAT, **config}, indent=2, ensure_ascii=False)
    with replacing(path) as temporary:
        temporary.write_text(text + "\n", encoding="utf-8")


def read_run_config(path: Path) -> dict[str, Any]:
    """Read run.json.

    Raises:
        ResultsError: one line where the file is absent, broken, or of another format.
    """
    config = read_json(path)
    if config.get("format") != FORMAT:
        raise ResultsError(f"{path}: {OLD}")
    _check(path, config)
    return config


def _check(path: Path, config: Mapping[str, Any]) -> None:
    """Raise ResultsError for an entry of run.json that is not of the type that its readers take it for."""
    for name, (fits, expected) in _EXPECTED.items():
        if config.get(name) is not None and not fits(config[name]):
            raise ResultsError(f"{path}: '{name}' should be {expected}")


def _is_text(value: Any) -> bool:
    return value is None or isinstance(value, str)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and abs(value) < MOST_SECONDS


def _declares(*texts: str, point: str = "") -> Callable[[Any], bool]:
    """Return a test: is a value name -> declaration, with these entries texts, and one a point?"""

    def fits(value: Any) -> bool:
        declarations = value.values() if isinstance(value, dict) else [None]
        return all(
            isinstance(parts, dict)
            and all(_is_text(parts.get(name)) for name in texts)
            and (not parts.get(point) or _is_point(parts[point]))
            for parts in declarations
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


_EXPECTED: dict[str, tuple[Callable[[Any], bool], str]] = {
    "metrics": (_declares("title", "definition", "table", "unit"), "metric -> what it declares"),
    "methods": (_declares("label"), "method -> what it declares"),
    "scenes": (_declares(), "scene -> what it declares"),
    "cases": (_declares("scene", "metric", point="map_point"), "case -> what it declares"),
    "digests": (lambda v: isinstance(v, dict) and all(map(_is_text, v.values())), "file -> digest"),
    "stages": (_is_stages, "a list of names and seconds"),
    "earlier": (lambda v: isinstance(v, list), "a list of earlier runs"),
    "test_looks": (_is_looks, "a list of looks at the test motions"),
}
