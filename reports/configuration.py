"""The configuration of a run as groups of names and values, for the last pages of the report."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from datetime import datetime
from typing import Any

import pandas as pd

from reports.numbers import duration, number

_FIRST = (
    "command", "preset", "commit", "started", "finished", "suites", "scenes", "methods", "motions", "seeds",
)  # fmt: skip


# What the rows mean, not how they were made: the tables say it.
_DECLARED = ("metrics", "scenes_declared", "cases")


def configuration(config: Mapping[str, Any], frame: pd.DataFrame) -> list[dict[str, Any]]:
    """Groups {"title", "pairs": [[name, value], ...]}, all of run.json, whatever it holds.

    Of the scenes and methods that are declared in full, the names alone.
    """
    config = {name: value for name, value in config.items() if name not in _DECLARED}
    for name in ("scenes", "methods"):
        if isinstance(config.get(name), dict):
            config[name] = list(config[name])
    said = {name: config[name] for name in _FIRST if config.get(name) not in (None, [], "")}
    run = [[_title(name), _text(value)] for name, value in said.items() if not isinstance(value, dict)]
    wall = _wall_seconds(config)
    run += [["Wall time", duration(wall)]] if wall is not None else []
    for name in ("dtype", "threads", "hardware"):
        values = sorted(set(frame[name].astype(str)) - {""})
        if values and not (name == "hardware" and config.get("hardware")):
            run.append([f"{_title(name)} of the rows", ", ".join(values)])
    groups: list[dict[str, Any]] = [{"title": "Run", "pairs": run}]
    for name, value in config.items():
        if name == "stages":
            groups.append({"title": "Time of each stage", "pairs": _stages(value)})
        elif isinstance(value, dict):
            pairs = [[_title(key), _text(item)] for key, item in value.items()]
            groups.append({"title": _title(name), "pairs": pairs})
        elif name not in _FIRST and value not in (None, "", []):
            run.append([_title(name), _text(value)])
    return [group for group in groups if group["pairs"]]


def _stages(stages: Any) -> list[list[str]]:
    if not isinstance(stages, list):
        return []
    kept = [stage for stage in stages if isinstance(stage, dict)]
    return [[str(stage.get("name", "?")), duration(stage.get("seconds"))] for stage in kept]


def _flat(value: dict[str, Any], above: str = "") -> Iterable[tuple[str, str]]:
    for name, item in value.items():
        if isinstance(item, dict):
            yield from _flat(item, f"{above}{name} ")
        else:
            yield f"{above}{name}", _text(item)


def _text(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, int):
        return str(value)
    if isinstance(value, float):
        return number(value, 4, trim=True)
    if isinstance(value, list | tuple):
        return ", ".join(_text(item) for item in value) or "–"
    if isinstance(value, dict):
        return ", ".join(f"{name} {text}" for name, text in _flat(value)) or "–"
    return "–" if value is None else str(value)


def _title(name: str) -> str:
    """From "memory_gb" to "Memory [GB]"."""
    words = name.replace("_", " ")
    for ending, unit in ((" gb", "GB"), (" mb", "MB"), (" seconds", "s")):
        if words.endswith(ending):
            words = f"{words.removesuffix(ending)} [{unit}]"
    return words[:1].upper() + words[1:]


def moment(text: Any) -> datetime | None:
    """An ISO date and time, or None where it is absent or none."""
    try:
        return datetime.fromisoformat(str(text))
    except ValueError:
        return None


def _wall_seconds(config: Mapping[str, Any]) -> float | None:
    start, end = moment(config.get("started")), moment(config.get("finished"))
    if start is None or end is None or (start.tzinfo is None) != (end.tzinfo is None):
        return None
    return (end - start).total_seconds()
