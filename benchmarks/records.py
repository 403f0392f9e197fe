"""What is finished in a run's folder, and for what inputs and code: so that it is not done twice.

A record is written whole after the files that it speaks of. A run that is killed therefore loses what it was
at, and nothing else.
"""

from __future__ import annotations

import dataclasses
import json
import shutil
from collections.abc import Iterable, Mapping
from datetime import datetime
from functools import cached_property
from pathlib import Path
from typing import Any

from .fingerprint import digest, digest_of_file
from .results import RunFolder, replacing

STATES = ("finished", "failed", "stale", "missing")
MODELS = "models/"
DEFAULT_ONLY = ("stale", "missing")


@dataclasses.dataclass(frozen=True, eq=False)
class Work:
    """A piece of work: its kind and name, and what its outcome depends on.

    inputs: plain values by name. code: source file -> digest.
    """

    kind: str
    name: str
    inputs: Mapping[str, Any]
    code: Mapping[str, str]

    @cached_property
    def key(self) -> str:
        """Equal where the outcome is."""
        return digest([self.kind, self.name, self.inputs, self.code])

    @cached_property
    def parts(self) -> dict[str, str]:
        """Digest of each input and of each file, to say later what has changed."""
        return {name: digest(value) for name, value in self.inputs.items()} | dict(self.code)


@dataclasses.dataclass(frozen=True)
class Found:
    """What the folder says of a piece of work. state: one of STATES; why: what has changed, or what failed.

    result, seconds and commit: of the record, also of a stale one; None or empty without one. A record whose
    files are gone has no result. wanted: to be done now.
    """

    state: str
    why: str = ""
    result: dict[str, Any] | None = None
    seconds: float | None = None
    commit: str = ""
    wanted: bool = True

    @property
    def remark(self) -> str:
        """What rows say that are kept though they are out of date; empty of all others."""
        return f"kept though {self.why} changed" if self.state == "stale" else ""


class Records:
    """The records of one run's folder. only: the states whose work is done again."""

    def __init__(self, folder: RunFolder, *, only: Iterable[str] = DEFAULT_ONLY, commit: str = "") -> None:
        self.folder, self.only, self.commit = folder, frozenset(only), commit

    def find(self, work: Work) -> Found:
        """Whether the work is done, and what came of it."""
        state, why, record = self._state(work)
        result, seconds = record.get("result"), record.get("seconds")
        commit = record.get("commit", "")
        return Found(state, why, result, seconds, commit, wanted=state in self.only)

    def keep(
        self, work: Work, result: Mapping[str, Any], *, seconds: float, files: Iterable[Path] = (),
        failed: str = "",
    ) -> None:  # fmt: skip
        """Write the record. files: what the work has left; the content of a model counts too."""
        names = [self.folder.relative(path) for path in files]
        record = {
            "key": work.key,
            "parts": work.parts,
            "written": datetime.now().astimezone().isoformat(timespec="seconds"),
            "commit": self.commit,
            "seconds": round(seconds, 4),
            "files": {name: self._content(name) for name in names},
            "failed": failed,
            "result": dict(result),
        }
        with replacing(self.path(work)) as temporary:
            temporary.write_text(json.dumps(record, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")

    def _content(self, name: str) -> str:
        """Trajectories are written again with their metrics; a network stays as it was trained."""
        return digest_of_file(self.folder.path / name) if name.startswith(MODELS) else ""

    def forget_all(self) -> None:
        """Everything is missing from now on, and no training goes on from where an earlier one stopped."""
        shutil.rmtree(self.folder.records, ignore_errors=True)
        for path in self.folder.models.rglob(".*.checkpoint.safetensors"):
            path.unlink()

    def forget(self, kind: str, names: str) -> None:
        """Remove the records of that kind whose names fit a pattern of pathlib's."""
        for path in list((self.folder.records / kind).glob(f"{names}.json")):
            path.unlink(missing_ok=True)

    def path(self, work: Work) -> Path:
        """records/<kind>/<name>.json"""
        return self.folder.records / work.kind / f"{work.name}.json"

    def _state(self, work: Work) -> tuple[str, str, dict[str, Any]]:
        try:
            record = json.loads(self.path(work).read_text(encoding="utf-8"))
            parts, files = dict(record["parts"]), dict(record["files"])
        except FileNotFoundError:
            return "missing", "", {}
        except (ValueError, KeyError, TypeError):
            return "missing", "its record cannot be read", {}
        for name, content in files.items():
            path = self.folder.path / name
            if not path.is_file():
                return "missing", f"{name} is gone", record | {"result": None}
            if content and digest_of_file(path) != content:
                return "stale", name, record
        if record["key"] != work.key:
            changed = [name for name in work.parts if parts.get(name) != work.parts[name]]
            changed += [name for name in parts if name not in work.parts]
            return "stale", ", ".join(changed[:3]) + (", ..." if len(changed) > 3 else ""), record
        return ("failed", record["failed"], record) if record["failed"] else ("finished", "", record)
