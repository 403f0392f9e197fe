"""What executes tasks: processes of this machine. A cluster stands behind the same four calls: cluster.py.

A task that raises, hangs, or whose process dies is an outcome, not an end of the run.
"""

from __future__ import annotations

import dataclasses
import multiprocessing
import os
import queue
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import suppress
from typing import Any, Protocol

from ..assets import Assets
from ..results import RunFolder
from ..tasks.task import Context, Outcome, RunStopped, Task, TaskId, failure, tell_nobody
from .cache import damaged
from .memory import give_back
from .process import IsolatedProcess, WorkerDied, new_processes

POLL = 0.2  # [s] between looks at the progress
COMPILING = 900.0  # [s] for what a process does before its first task: it may have to compile every kernel

Needed = Mapping[TaskId, Outcome]
Done = tuple[Task, Outcome]


class Executor(Protocol):
    """Executes tasks whose needs are there; gives outcomes, in any order."""

    def together(self, batches: Sequence[tuple[Sequence[Task], Needed]], bar: Any) -> Iterator[Done]:
        """Batches of untimed tasks, some side by side. bar: is told of units of progress."""

    def begin(self, tasks: Sequence[tuple[Task, Needed]]) -> None:
        """Timed tasks begin, some side by side, each in the process that it names."""

    def alone(self, task: Task, needed: Needed) -> Outcome:
        """A timed task, nothing at work beside it, in the process that it names."""

    def release(self, process: str) -> None:
        """No other task wants that process."""

    def close(self) -> None:
        """End everything."""


class LocalExecutor:
    """Single-threaded processes of this machine, at most `workers` side by side.

    Workers stay for the next stage, which then loads and compiles nothing again; none is there beside a timed
    task.
    """

    def __init__(self, folder: RunFolder, assets: Assets | None, workers: int) -> None:
        self.folder, self.assets, self.workers = folder, assets, workers
        self._named: dict[str, IsolatedProcess] = {}
        self._troubles: dict[str, Outcome] = {}  # process -> how it died before its task's turn
        self._crew: list[TaskProcess] = []

    def together(self, batches: Sequence[tuple[Sequence[Task], Needed]], bar: Any) -> Iterator[Done]:
        count = min(self.workers, len(batches))
        context = Context(self.folder, self.assets)
        self._crew += [TaskProcess(begin_tasks, context) for _ in range(count - len(self._crew))]
        crew = self._crew[:count]
        idle: queue.SimpleQueue[TaskProcess] = queue.SimpleQueue()
        for worker in crew:
            idle.put(worker)

        finished: queue.SimpleQueue[Done] = queue.SimpleQueue()

        def do(batch: Sequence[Task], needed: Needed) -> None:
            worker = idle.get()
            try:
                worker.forget()
                for task in batch:
                    finished.put((task, worker.do(task, dict(needed))))
            finally:
                idle.put(worker)

        with ThreadPoolExecutor(max(count, 1)) as threads:  # one waits for each worker
            left = {threads.submit(do, *batch) for batch in batches}
            try:
                while left:
                    ended, left = wait(left, timeout=POLL, return_when=FIRST_COMPLETED)
                    for worker in crew:
                        bar.update(min(worker.told(), bar.total - bar.n))
                    for future in ended:
                        future.result()
                    while not finished.empty():
                        yield finished.get()
            except BaseException:
                _end(left)
                self._crew.clear()
                raise

    def begin(self, tasks: Sequence[tuple[Task, Needed]]) -> None:
        self._dismiss()
        with ThreadPoolExecutor(self.workers) as threads:
            begun = {
                task.process: threads.submit(
                    _called, self._process(task), _begin, task, needed, seconds=task.deadline
                )
                for task, needed in tasks
            }
            try:
                self._troubles |= {name: died for name, own in begun.items() if (died := own.result())}
            except BaseException:
                _end(set(begun.values()))
                raise

    def alone(self, task: Task, needed: Needed) -> Outcome:
        self._dismiss()
        if trouble := self._troubles.pop(task.process, None):
            return trouble
        return _called(self._process(task), _perform, task, needed, seconds=task.deadline)

    def _process(self, task: Task) -> IsolatedProcess:
        """The one that a timed task names."""
        if task.process not in self._named:
            context = Context(self.folder, task.assets(self.assets))
            self._named[task.process] = IsolatedProcess(begin_tasks, context)
        return self._named[task.process]

    def release(self, process: str) -> None:
        if process in self._named:
            self._named.pop(process).close()

    def close(self) -> None:
        self._dismiss()
        for name in list(self._named):
            self.release(name)

    def _dismiss(self) -> None:
        while self._crew:
            self._crew.pop().process.close()


class TaskProcess:
    """A process that does one untimed task after another, another process after one that was killed.

    begin(*arguments, progress) is called first in each of them, see begin_tasks.
    """

    def __init__(self, begin: Callable[..., None], *arguments: Any) -> None:
        self._begin = (begin, *arguments)
        self._renew()

    def _renew(self) -> None:
        # A queue for each process: one that is killed while it reports leaves a lock that nobody opens.
        self.progress = new_processes().SimpleQueue()
        self.process = IsolatedProcess(*self._begin, self.progress)
        self.warm: set[tuple[str, str]] = set()

    def forget(self) -> None:
        """Let nothing of the batch before be there for the next."""
        try:
            if self.process.alive:
                self.process.call(_forget, seconds=None)
        except WorkerDied:
            self._renew()

    def do(self, task: Task, needed: Needed) -> Outcome:
        """The task's outcome; what it leaves in the memo is there for the next."""
        outcome = self._warm(task) or _called(self.process, _perform, task, needed, seconds=task.deadline)
        if not self.process.alive:
            self._renew()
        return outcome

    def _warm(self, task: Task) -> Outcome | None:
        """What went wrong before the process could do its first task of this kind and module."""
        if (task.kind, task.modules[0]) in self.warm:
            return None
        trouble = _called(self.process, task.warm_up, seconds=COMPILING)
        if trouble is None:
            self.warm.add((task.kind, task.modules[0]))
        return trouble

    def told(self) -> int:
        """Units of progress since the last call."""
        progress, units = self.progress, 0  # the worker may get another meanwhile
        while not progress.empty():
            units += progress.get()
        return units


def _called(process: IsolatedProcess, function: Callable[..., Any], *arguments: Any, seconds: Any) -> Any:
    """function(*arguments) in that process, which is ended at the deadline; what goes wrong is an outcome."""
    clock = time.perf_counter()
    try:
        return process.call(function, *arguments, seconds=seconds)
    except Exception as error:
        return dataclasses.replace(failure(error), seconds=time.perf_counter() - clock)


def _end(futures: set[Future[Any]]) -> None:
    """Begin no other batch, and end the workers until none is left that a thread waits for."""
    left = {future for future in futures if not future.cancel()}
    while left:
        for child in multiprocessing.active_children():
            child.kill()
        _, left = wait(left, timeout=POLL)


# --- in the process ----------------------------------------------------------------------------------------

_context: Context
_verified: set[tuple[str, str]] = set()  # files that this process has compared with their digests


def begin_tasks(context: Context, progress: Any = None) -> None:
    """Keep what a process knows. progress: a queue of units, None where nobody follows them."""
    global _context
    tell: Callable[[int], None] = tell_nobody if progress is None else progress.put
    if progress is not None:
        os.environ["TQDM_DISABLE"] = "1"  # one bar for all that are side by side is enough
    _context = dataclasses.replace(context, tell=tell, memo={})


def _forget() -> None:
    _context.memo.clear()
    give_back()


def _begin(task: Task, needed: Needed) -> None:
    for outcome in needed.values():
        _verify(outcome.digests)
    with suppress(Exception):  # it is raised again, and told, when it is the task's turn
        task.begin(_context)


def _perform(task: Task, needed: Needed) -> Outcome:
    for outcome in needed.values():
        _verify(outcome.digests)
    clock = time.perf_counter()
    try:
        outcome = task.run(_context, needed)
    except Exception as error:
        outcome = failure(error)
    return dataclasses.replace(outcome, seconds=time.perf_counter() - clock)


def _verify(digests: Mapping[str, str]) -> None:
    """Raises RunStopped where a file is not as it was written: the next run makes it anew."""
    if damage := damaged(_context.folder, dict(digests.items() - _verified)):
        raise RunStopped(f"{damage} since this run wrote it")
    _verified.update(digests.items())
