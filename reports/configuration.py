"""The configuration of a run as groups of names and values, for the last pages of the report."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import datetime
from typing import Any

import pandas as pd

from reports.numbers import DASH, duration, number

# What the rows mean, not how they were made: the tables say it. Nor is what earlier runs in the folder did.
DECLARED = ("format", "metrics", "cases", "earlier", "digests")
UNITS = {" gb": "GB", " mb": "MB", " seconds": "s"}  # endings of names


def configuration(config: Mapping[str, Any], frame: pd.DataFrame) -> list[dict[str, Any]]:
    """Groups {"title", "pairs": [[name, value], ...]} of run.json, whatever it holds, three floors deep.

    Of the scenes and methods that are declared in full, the names alone.
    """
    run: dict[str, str] = {}
    groups: dict[str, dict[str, str]] = {"Run": run}
    for name, value in config.items():
        if name in DECLARED or value in (None, "", [], {}):
            continue
        if name == "stages":
            groups["Time of each stage"] = {s["name"]: duration(s["seconds"]) for s in value}
        elif isinstance(value, dict) and name not in ("scenes", "methods"):
            groups[_title(name)] = {_title(key): _text(item) for key, item in value.items()}
        else:
            run[_title(name)] = _text(list(value) if isinstance(value, dict) else value)
    start, end = moment(config.get("started")), moment(config.get("finished"))
    if start and end and (start.tzinfo is None) == (end.tzinfo is None):
        run["Wall time"] = duration((end - start).total_seconds())
    for name in ("dtype", "threads", "hardware"):
        run[f"{_title(name)} of the rows"] = ", ".join(sorted(set(frame[name].astype(str)) - {""})) or DASH
    return [
        {"title": title, "pairs": [list(pair) for pair in pairs.items()]}
        for title, pairs in groups.items()
        if pairs
    ]


def _text(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return number(value, 4, trim=True)
    if isinstance(value, list | tuple):
        return ", ".join(_text(item) for item in value) or DASH
    if isinstance(value, dict):
        plain = {name: item for name, item in value.items() if not isinstance(item, dict)}
        return ", ".join(f"{name} {_text(item)}" for name, item in plain.items()) or DASH
    return DASH if value is None else str(value)


def _title(name: str) -> str:
    """From "memory_gb" to "Memory [GB]"."""
    words = name.replace("_", " ")
    for ending, unit in UNITS.items():
        if words.endswith(ending):
            words = f"{words.removesuffix(ending)} [{unit}]"
    return words[:1].upper() + words[1:]


def moment(text: Any) -> datetime | None:
    """An ISO date and time since 1971, or None where it is absent or none."""
    try:
        found = datetime.fromisoformat(str(text))
    except ValueError:
        return None
    return found if found.year > 1970 else None
