"""A process that does tasks: how it is asked, and what it does inside."""

from __future__ import annotations

import dataclasses
import os
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from multiprocessing.queues import SimpleQueue
from typing import Any

from benchmarks.fingerprint.digest import damaged
from benchmarks.plan.plan import TaskId
from benchmarks.process.isolated_process import IsolatedProcess, WorkerDied, new_processes
from benchmarks.process.memory import give_back
from benchmarks.tasks.task import Context, Outcome, RunStopped, Task, failure, tell_nobody

COMPILING = 900.0  # [s] for what a process does before its first task: it may have to compile every kernel

Needed = Mapping[TaskId, Outcome]


class TaskProcess:
    """A process that does one untimed task after another, another process after one that was killed.

    begin(*arguments, progress) is called first in each of them, see begin_tasks.
    """

    def __init__(self, begin: Callable[..., None], *arguments: Any) -> None:
        self._begin = (begin, *arguments)
        self._batch = ""
        self._renew()

    def _renew(self) -> None:
        # A queue for each process: one that is killed while it reports leaves a lock that nobody opens.
        self.progress = new_processes().SimpleQueue()
        self.process = IsolatedProcess(*self._begin, self.progress)
        self.warm: set[tuple[str, str]] = set()

    def do(self, task: Task, needed: Needed, batch: str) -> Outcome:
        """Return the task's outcome; what it leaves in the memo is there for the next of its batch."""
        if batch != self._batch and self.process.alive:
            try:
                self.process.call(forget, seconds=None)
            except WorkerDied:
                self._renew()
        self._batch = batch
        outcome = self._warm(task) or call(self.process, perform, task, needed, seconds=task.deadline)
        if outcome.status == "timeout":  # of a program, ended by its method: what it has started may run on
            self.process.close()
        if not self.process.alive:
            self._renew()
        return outcome

    def _warm(self, task: Task) -> Outcome | None:
        """Return what went wrong before the first task of this kind and code, None where nothing did."""
        if (task.kind, task.code[0]) in self.warm:
            return None
        trouble = call(self.process, task.warm_up, seconds=COMPILING)
        if trouble is None:
            self.warm.add((task.kind, task.code[0]))
        return trouble

    def stop(self) -> None:
        """End the process from another thread: the task that it is at has died."""
        self.process.stop()

    def told(self) -> float:
        """Return the progress since the last call, in seconds that it was expected to take."""
        progress, seconds = self.progress, 0.0  # the worker may get another meanwhile
        while not progress.empty():
            seconds += progress.get()
        return seconds


def call(
    process: IsolatedProcess, function: Callable[..., Any], *arguments: Any, seconds: float | None
) -> Any:
    """Call function(*arguments) in a process, which is ended at the deadline; a failure is an outcome."""
    clock = time.perf_counter()
    try:
        return process.call(function, *arguments, seconds=seconds)
    except Exception as error:
        return dataclasses.replace(failure(error), seconds=time.perf_counter() - clock)


# --- in the process ----------------------------------------------------------------------------------------

_context: Context
_verified: set[tuple[str, str]] = set()  # files that this process has compared with their digests


def begin_tasks(context: Context, progress: SimpleQueue[float] | None = None) -> None:
    """Keep what a process knows. progress: a queue of expected seconds, None where nobody follows them."""
    global _context
    tell: Callable[[float], None] = tell_nobody if progress is None else progress.put
    if progress is not None:
        os.environ["TQDM_DISABLE"] = "1"  # one bar for all that are side by side is enough
    _context = dataclasses.replace(context, tell=tell, memo={})


def forget() -> None:
    """Empty the memo of this process and give back its memory.

    A batch that left nothing there is no reason to look through all objects for garbage.
    """
    if _context.memo:
        _context.memo.clear()
        give_back()


def begin_task(task: Task, needed: Needed) -> None:
    """Prepare a timed task before its turn."""
    for outcome in needed.values():
        _verify(outcome.digests)
    with suppress(Exception):  # it is raised again, and told, when it is the task's turn
        task.begin(_context)


def perform(task: Task, needed: Needed) -> Outcome:
    """Return the outcome of a task, done in this process."""
    for outcome in needed.values():
        _verify(outcome.digests)
    each = task.expected_seconds / max(task.units, 1)
    context = dataclasses.replace(_context, tell=lambda units: _context.tell(units * each))
    clock = time.perf_counter()
    try:
        outcome = task.run(context, needed)
    except Exception as error:
        outcome = failure(error)
    return dataclasses.replace(outcome, seconds=time.perf_counter() - clock)


def _verify(digests: Mapping[str, str]) -> None:
    """Raise RunStopped where a file is not as it was written: the next run makes it anew."""
    if damage := damaged(_context.folder.path, dict(digests.items() - _verified)):
        raise RunStopped(f"{damage} since this run wrote it")
    _verified.update(digests.items())
