"""Digests of values and of files: 16 hexadecimal digits of SHA-256."""

from __future__ import annotations

import dataclasses
import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any


def digest(value: Any) -> str:
    """Return 16 hexadecimal digits of a value: JSON, bytes, arrays, sets and dataclasses of these.

    >>> digest({"b": 1, "a": [2]}) == digest({"a": [2], "b": 1})
    True
    """
    if not isinstance(value, bytes):
        value = json.dumps(value, sort_keys=True, default=_plain).encode()
    return hashlib.sha256(value).hexdigest()[:16]


def _plain(value: Any) -> Any:
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {f.name: getattr(value, f.name) for f in dataclasses.fields(value)}
    if hasattr(value, "tobytes"):  # an array
        return [str(value.dtype), list(value.shape), digest(value.tobytes())]
    if isinstance(value, set | frozenset):
        return sorted(value)
    if hasattr(value, "items"):
        return dict(value)
    raise TypeError(f"cannot tell apart by content: {type(value).__name__}")


def digest_of_file(path: Path) -> str:
    """Return 16 hexadecimal digits of a file's bytes. Raises OSError."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()[:16]


def damaged(folder: Path, digests: Mapping[str, str]) -> str:
    """Return which file of a folder, name -> digest, is gone or altered; empty where none is."""
    for name, content in digests.items():
        path = folder / name
        if not path.is_file():
            return f"{name} is gone"
        if digest_of_file(path) != content:
            return f"{name} is damaged"
    return ""
