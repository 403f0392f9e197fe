"""run.json of a run: its format, and the types of the entries that readers take for granted."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from benchmarks.results.json_file import ResultsError

FORMAT = 4  # of run.json, results.csv and the cache; written into run.json
OLD = "written by an earlier version of this project; run the benchmark again in a new folder"
# Entries of run.json that make the scenes what they are: with others, two runs have no number in common.
OF_SCENES = ("preset", "preset_values", "body", "garment")
MOST_SECONDS = 1e12  # that a stage may say it took


def check_types(path: Path, config: Mapping[str, Any]) -> None:
    """Raise ResultsError for an entry of run.json that is not of the type that its readers take it for."""
    for name, (shape, expected) in _EXPECTED.items():
        if config.get(name) is not None and not _fits(config[name], shape):
            raise ResultsError(f"{path}: '{name}' should be {expected}")


def _fits(value: Any, shape: Any) -> bool:
    """Return whether a value fits a test, [shape of each], {...: shape of each} or name -> shape."""
    if callable(shape):
        return shape(value)
    if not isinstance(value, type(shape)):
        return False
    if isinstance(shape, list):
        return all(_fits(each, shape[0]) for each in value)
    shapes = dict.fromkeys(value, shape[...]) if ... in shape else shape
    return all(_fits(value.get(name), inner) for name, inner in shapes.items())


def _is_name(value: Any) -> bool:
    return isinstance(value, str)


def _is_text(value: Any) -> bool:
    return value is None or isinstance(value, str)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and abs(value) < MOST_SECONDS


_EXPECTED: dict[str, tuple[Any, str]] = {
    "metrics": (
        {...: dict.fromkeys(("title", "definition", "table", "unit"), _is_text)},
        "metric -> what it declares",
    ),
    "methods": ({...: {"label": _is_text}}, "method -> what it declares"),
    "scenes": ({...: {}}, "scene -> what it declares"),
    "cases": ({...: {"scene": _is_text, "metric": _is_text}}, "case -> what it declares"),
    "digests": ({...: _is_text}, "file -> digest"),
    "stages": ([{"name": _is_name, "seconds": _is_number}], "a list of names and seconds"),
    "earlier": ([lambda value: True], "a list of earlier runs"),
    "test_looks": ([{"rows": _is_text}], "a list of looks at the test motions"),
}
