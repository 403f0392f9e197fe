"""Finished results of a run's folder: which are reused, which stale.

An entry names the inputs, code, packages and files that its outcome came of: with another one the task is
done again. It is written whole after its files, with their digests: a file that differs is missing.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from benchmarks.plan.cell import TaskId
from benchmarks.provenance import digest, digest_of_file, software
from benchmarks.results.row import ResultsError, read_json
from benchmarks.results.run_folder import FORMAT, RunFolder
from benchmarks.runner.task import Outcome, Task
from reference_sim.files.atomic_files import replacing


class Cache:
    """Entries of a run's folder. retry: whether failed tasks are done again; origin: see Outcome."""

    def __init__(
        self, folder: RunFolder, *, retry: bool = False, origin: dict[str, Any] | None = None
    ) -> None:
        self.folder, self.retry, self.origin = folder, retry, origin or {}

    def find(self, task: Task, others: Mapping[TaskId, Outcome]) -> tuple[str, Outcome | None]:
        """Return why a task has to be run, or how it failed; and its outcome, None if to be run.

        others: outcomes of the tasks that it reads.
        """
        path = self.path(task)
        if not path.is_file():
            return "missing", None
        entry: dict[str, Any] = {}
        with suppress(ResultsError):
            entry = read_json(path)
        if (entry.get("format"), entry.get("task")) != (FORMAT, task.title):
            return "missing: its entry is damaged or of another version", None
        if losses := self.folder.find_changes(entry["files"]):
            return "missing: " + ", ".join(f"{name} is {state}" for name, state in losses.items()), None
        now, before = dependencies(task, others), entry["parts"]
        if changes := [name for name in now | before if now.get(name) != before.get(name)]:
            return "stale: " + ", ".join(changes[:3]) + (", ..." if len(changes) > 3 else ""), None
        files = entry["files"]
        outcome = Outcome(
            **entry["outcome"], files=tuple(files), digests=files, origin=entry["origin"],
            content=_content(entry),
        )  # fmt: skip
        reason = outcome.ending if outcome.failed else ""
        return reason, None if reason and self.retry else outcome

    def keep(self, task: Task, outcome: Outcome, others: Mapping[TaskId, Outcome]) -> Outcome:
        """Write the entry, after the files; return the outcome as it is kept."""
        files = {name: digest_of_file(self.folder.path / name) for name in outcome.files}
        origin = self.origin | outcome.origin
        entry = {
            "format": FORMAT,
            "task": task.title,
            "parts": dependencies(task, others),
            "origin": origin,
            "files": files,
            "outcome": {name: getattr(outcome, name) for name in _KEPT},
        }
        with replacing(self.path(task)) as temporary:
            temporary.write_text(json.dumps(entry, indent=1, ensure_ascii=False), encoding="utf-8")
        return replace(outcome, digests=files, origin=origin, content=_content(entry))

    def forget_all(self) -> None:
        """Remove all entries and checkpoints: everything is missing from now on."""
        shutil.rmtree(self.folder.cache, ignore_errors=True)
        for path in self.folder.models.rglob(".*.checkpoint.safetensors"):
            path.unlink()

    def path(self, task: Task) -> Path:
        """Return cache/<kind>/<name>.json in the run's folder."""
        return self.folder.cache / task.kind / f"{task.name}.json"


_KEPT = ("status", "reason", "failed", "result", "seconds")


def dependencies(task: Task, others: Mapping[TaskId, Outcome]) -> dict[str, str]:
    """Return name -> digest or version of each input, code, package and task that a task reads."""
    inputs = {name: digest(value) for name, value in task.inputs.items()}
    contents = {" ".join(id): others.get(id, Outcome()).content for id in (*task.needs, *task.reads)}
    return inputs | software(*task.code) | contents


def _content(entry: Mapping[str, Any]) -> str:
    """Return a digest of the files and the outcome, whatever time they took."""
    return digest([entry["files"], entry["outcome"] | {"seconds": 0.0}])
