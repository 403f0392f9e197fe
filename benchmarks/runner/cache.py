"""Finished results of a run's folder: which are reused, and which are stale.

An entry names the inputs, code, packages and files that its outcome came of; where one of them is another
now, the result is stale, and the task is done again.
An entry is written whole after the files that it speaks of. A run that is killed therefore loses what it was
at, and nothing else. It holds the digest of each of its files, and of itself: what is not as it was written
is missing, and done again.
"""

from __future__ import annotations

import dataclasses
import json
import shutil
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from benchmarks.plan.cell import TaskId
from benchmarks.plan.plan import DEFAULT_ONLY
from benchmarks.provenance import damaged, digest, digest_of_file, software
from benchmarks.results.row import ResultsError, read_json
from benchmarks.results.run_folder import FORMAT, RunFolder
from benchmarks.runner.task import Outcome, Task
from reference_sim.files.atomic_files import replacing

NOWHERE: Mapping[str, Any] = {}


@dataclasses.dataclass(frozen=True)
class Cached:
    """The cache entry of a task.

    Attributes:
        state: one of benchmarks.plan.plan.STATES.
        why: name of the changed dependency, or of the failure.
        outcome: that of the entry, also of a stale one; None without one, or where its files are gone.
        content: digest of all that other tasks read of it.
        wanted: whether the task is to be done now.
    """

    state: str
    why: str = ""
    outcome: Outcome | None = None
    content: str = ""
    wanted: bool = True


def dependencies(task: Task) -> dict[str, str]:
    """Return name -> digest or version of each input, folder of code and package of a task."""
    return digests_of(task.inputs) | software(*task.code)


def digests_of(inputs: Mapping[str, Any]) -> dict[str, str]:
    """Return name -> digest of each input."""
    return {name: digest(value) for name, value in inputs.items()}


class Cache:
    """Entries of one run's folder. only: states whose tasks are done again; origin: see Outcome."""

    def __init__(
        self, folder: RunFolder, *, only: Iterable[str] = DEFAULT_ONLY, origin: Mapping[str, Any] = NOWHERE
    ) -> None:
        self.folder, self.only, self.origin = folder, frozenset(only), dict(origin)

    def find(self, task: Task, others: Mapping[TaskId, Cached]) -> Cached:
        """Return the entry of a task. others: entries of the tasks that it reads."""
        state, why, entry = self._state(task, others)
        outcome = None
        if state != "missing":
            files = entry["files"]
            outcome = Outcome(**entry["outcome"], files=tuple(files), digests=files, origin=entry["origin"])
            if state == "stale":
                outcome = dataclasses.replace(outcome, remark=f"kept though {why} changed")
        content = "" if outcome is None else _content(entry)
        return Cached(state, why, outcome, content, wanted=state in self.only)

    def keep(self, task: Task, outcome: Outcome, others: Mapping[TaskId, Cached]) -> Cached:
        """Write the entry, after the files, and return it."""
        files = {name: digest_of_file(self.folder.path / name) for name in outcome.files}
        outcome = dataclasses.replace(outcome, digests=files, origin={**self.origin, **outcome.origin})
        entry = {
            "format": FORMAT,
            "task": task.title,
            "inputs": sorted(task.inputs),
            "parts": dependencies(task),
            "needs": _needs(task, others),
            "origin": outcome.origin,
            "files": files,
            "outcome": {name: getattr(outcome, name) for name in _KEPT},
        }
        text = _text(entry | {"digest": digest(_text(entry).encode())})
        with replacing(self.path(task)) as temporary:
            temporary.write_text(text, encoding="utf-8")
        state, why = ("failed", outcome.ending) if outcome.failed else ("finished", "")
        return Cached(state, why, outcome, _content(entry), wanted=False)

    def forget_all(self) -> None:
        """Remove all entries and checkpoints: everything is missing from now on."""
        shutil.rmtree(self.folder.cache, ignore_errors=True)
        for path in self.folder.models.rglob(".*.checkpoint.safetensors"):
            path.unlink()

    def path(self, task: Task) -> Path:
        """Return cache/<kind>/<name>.json in the run's folder."""
        return self.folder.cache / task.kind / f"{task.name}.json"

    def _state(self, task: Task, others: Mapping[TaskId, Cached]) -> tuple[str, str, dict[str, Any]]:
        path = self.path(task)
        if not path.is_file():
            return "missing", "", {}
        entry = read_entry(path)
        if entry is None or entry["task"] != task.title:
            return "missing", "its entry is damaged or of another version", {}
        outcome, parts, needs = Outcome(**entry["outcome"]), entry["parts"], entry["needs"]
        if damage := damaged(self.folder.path, entry["files"]):
            return "missing", damage, {}
        now = dependencies(task)
        changed = [name for name in now if parts.get(name) != now[name]]
        changed += [name for name in parts if name not in now]
        read = _needs(task, others)
        changed += [name for name in read | needs if needs.get(name) != read.get(name)]
        if changed:
            return "stale", ", ".join(changed[:3]) + (", ..." if len(changed) > 3 else ""), entry
        return ("failed", outcome.ending, entry) if outcome.failed else ("finished", "", entry)


def read_entry(path: Path) -> dict[str, Any] | None:
    """Return an entry as it was written, or None where it is damaged or of another format."""
    try:
        entry = read_json(path)
    except ResultsError:
        return None
    whole = entry.pop("digest", "") == digest(_text(entry).encode())
    return entry if whole and entry.get("format") == FORMAT else None


_KEPT = ("status", "reason", "failed", "result", "seconds")


def _needs(task: Task, others: Mapping[TaskId, Cached]) -> dict[str, str]:
    """Return the content of each task that a task reads.

    Of one that is out of date, or about to be done, it is a text that no entry has; empty without an entry.
    """
    contents = {}
    for id in (*task.needs, *task.reads):
        other = others.get(id, Cached("missing", wanted=False))
        outdated = other.wanted or other.state == "stale"
        contents[" ".join(id)] = "out of date" if outdated else other.content
    return contents


def _content(entry: Mapping[str, Any]) -> str:
    """Return a digest of the files and the outcome, whatever time they took."""
    return digest([entry["files"], entry["outcome"] | {"seconds": 0.0}])


def _text(entry: Mapping[str, Any]) -> str:
    return json.dumps(entry, indent=1, ensure_ascii=False) + "\n"
