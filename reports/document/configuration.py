"""Configuration of a run as names and values, for the report's page on its protocol."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import datetime
from typing import Any

import pandas as pd

from reports.tables.number_texts import DASH, duration, number

# Declarations and files: not how the rows were made. run.json has it all.
NOT_SHOWN = (
    "format", "metrics", "cases", "earlier", "digests", "tasks", "cells", "outdated", "scenes", "methods",
    "motion_sources", "stages", "body", "garment",
)  # fmt: skip
UNITS = {" gb": "GB", " mb": "MB", " seconds": "s"}  # endings of names
MOST_LETTERS = 420  # letters of a value


def configuration(config: Mapping[str, Any], frame: pd.DataFrame) -> list[list[str]]:
    """Return names and values of run.json, whatever it holds, each value a text; motions are the rows'."""
    config = {**config, "motions": sorted(set(frame["motion"]) - {""})}
    pairs = {
        _title(name): _text(value)
        for name, value in config.items()
        if name not in NOT_SHOWN and value not in (None, "", [], {})
    }
    start, end = moment(config.get("started")), moment(config.get("finished"))
    if start and end and (start.tzinfo is None) == (end.tzinfo is None):
        pairs["Wall time"] = duration((end - start).total_seconds())
    for name in ("dtype", "threads", "hardware"):
        pairs[f"{_title(name)} of the rows"] = ", ".join(sorted(set(frame[name].astype(str)) - {""})) or DASH
    return [
        [title, text if len(text) <= MOST_LETTERS else f"{text[:MOST_LETTERS]}…"]
        for title, text in pairs.items()
    ]


def _text(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return number(value, 4, trim=True)
    if isinstance(value, list | tuple):
        return ", ".join(_text(item) for item in value) or DASH
    if isinstance(value, dict):
        return "; ".join(f"{_title(name).lower()} {_text(item)}" for name, item in value.items()) or DASH
    return DASH if value is None else str(value)


def _title(name: str) -> str:
    """Turn "memory_gb" into "Memory [GB]"."""
    title = name.replace("_", " ")
    for ending, unit in UNITS.items():
        if title.endswith(ending):
            title = f"{title.removesuffix(ending)} [{unit}]"
    return title[:1].upper() + title[1:]


def moment(text: object) -> datetime | None:
    """Return an ISO date and time since 1971, or None where it is absent or none."""
    try:
        time = datetime.fromisoformat(str(text))
    except ValueError:
        return None
    return time if time.year > 1970 else None
