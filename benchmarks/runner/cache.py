"""What is finished in a run's folder, and for what inputs, code, packages and files: so that it is not done
twice.

An entry is written whole after the files that it speaks of. A run that is killed therefore loses what it was
at, and nothing else. It holds the digest of each of its files, and of itself: what is not as it was written
is missing, and done again.
"""

from __future__ import annotations

import dataclasses
import json
import shutil
from collections.abc import Iterable, Mapping
from datetime import datetime
from pathlib import Path
from typing import Any

from benchmarks.cell import TaskId
from benchmarks.fingerprint.dependencies import software
from benchmarks.fingerprint.digest import damaged, digest, digest_of_file
from benchmarks.plan.plan import DEFAULT_ONLY
from benchmarks.results.json_file import ResultsError, read_json
from benchmarks.results.run_config import FORMAT
from benchmarks.results.run_folder import RunFolder
from benchmarks.tasks.task import Outcome, Task
from reference_sim.files.atomic_files import replacing

NOWHERE: Mapping[str, Any] = {}


@dataclasses.dataclass(frozen=True)
class Found:
    """What the folder says of a task. state: one of STATES; why: what has changed, or what failed.

    outcome: that of the entry, also of a stale one; None without one, or where its files are gone or damaged.
    content: equal where what others read of it is. wanted: to be done now.
    """

    state: str
    why: str = ""
    outcome: Outcome | None = None
    content: str = ""
    wanted: bool = True


def dependencies(task: Task) -> dict[str, str]:
    """Name -> digest or version of each input, file of source, package and data file, to say what changed."""
    return {name: digest(value) for name, value in task.inputs.items()} | software(*task.modules)


class Cache:
    """The entries of one run's folder. only: the states whose tasks are done again; origin: see Outcome."""

    def __init__(
        self, folder: RunFolder, *, only: Iterable[str] = DEFAULT_ONLY, origin: Mapping[str, Any] = NOWHERE
    ) -> None:
        self.folder, self.only, self.origin = folder, frozenset(only), dict(origin)

    def find(self, task: Task, others: Mapping[TaskId, Found]) -> Found:
        """Whether the task is done, and what came of it. others: what is known of those that it reads."""
        state, why, entry = self._state(task, others)
        outcome = None
        if state != "missing":
            files = entry["files"]
            outcome = Outcome(**entry["outcome"], files=tuple(files), digests=files, origin=entry["origin"])
            if state == "stale":
                outcome = dataclasses.replace(outcome, remark=f"kept though {why} changed")
        content = "" if outcome is None else _content(entry)
        return Found(state, why, outcome, content, wanted=state in self.only)

    def keep(self, task: Task, outcome: Outcome, others: Mapping[TaskId, Found]) -> Found:
        """Write the entry, after the files; gives what find() would."""
        files = {name: digest_of_file(self.folder.path / name) for name in outcome.files}
        outcome = dataclasses.replace(outcome, digests=files, origin={**self.origin, **outcome.origin})
        entry = {
            "format": FORMAT,
            "task": task.title,
            "stage": task.stage,
            "alone": bool(task.process),
            "inputs": sorted(task.inputs),
            "parts": dependencies(task),
            "needs": _needs(task, others),
            "written": datetime.now().astimezone().isoformat(timespec="seconds"),
            "origin": outcome.origin,
            "files": files,
            "outcome": {name: getattr(outcome, name) for name in _KEPT},
        }
        text = _text(entry | {"digest": digest(_text(entry).encode())})
        with replacing(self.path(task)) as temporary:
            temporary.write_text(text, encoding="utf-8")
        state = "failed" if outcome.failed else "finished"
        return Found(state, _why(outcome), outcome, _content(entry), wanted=False)

    def forget_all(self) -> None:
        """Everything is missing from now on, and no training goes on from where an earlier one stopped."""
        shutil.rmtree(self.folder.cache, ignore_errors=True)
        for path in self.folder.models.rglob(".*.checkpoint.safetensors"):
            path.unlink()

    def path(self, task: Task) -> Path:
        """cache/<kind>/<name>.json"""
        return self.folder.cache / task.kind / f"{task.name}.json"

    def _state(self, task: Task, others: Mapping[TaskId, Found]) -> tuple[str, str, dict[str, Any]]:
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
        return ("failed", _why(outcome), entry) if outcome.failed else ("finished", "", entry)


def read_entry(path: Path) -> dict[str, Any] | None:
    """An entry as it was written, or None where it is damaged or of another format."""
    try:
        entry = read_json(path)
    except ResultsError:
        return None
    whole = entry.pop("digest", "") == digest(_text(entry).encode())
    return entry if whole and entry.get("format") == FORMAT else None


_KEPT = ("status", "reason", "failed", "result", "seconds")


def _needs(task: Task, others: Mapping[TaskId, Found]) -> dict[str, str]:
    """Content of each task that it reads; of one that is out of date, or about to be done, a text that no
    entry has; empty for one of which there is nothing.
    """
    found = {}
    for id in (*task.needs, *task.reads):
        other = others.get(id, Found("missing", wanted=False))
        outdated = other.wanted or other.state == "stale"
        found[" ".join(id)] = "out of date" if outdated else other.content
    return found


def _why(outcome: Outcome) -> str:
    return f"{outcome.status}: {outcome.reason}" if outcome.failed else ""


def _content(entry: Mapping[str, Any]) -> str:
    """Equal where the files are, and what the task says of them, whatever time it took."""
    return digest([entry["files"], entry["outcome"] | {"seconds": 0.0}])


def _text(entry: Mapping[str, Any]) -> str:
    return json.dumps(entry, indent=1, ensure_ascii=False) + "\n"
