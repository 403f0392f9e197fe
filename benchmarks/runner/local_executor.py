"""What executes tasks: processes of this machine. A cluster stands behind the same four calls: cluster.py.

A task that raises, hangs, or whose process dies is an outcome, not an end of the run.
"""

from __future__ import annotations

import dataclasses
import multiprocessing
import os
import queue
import time
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import suppress
from typing import Any, Protocol

from benchmarks.assets.assets import Assets
from benchmarks.cell import TaskId
from benchmarks.process.isolated_process import IsolatedProcess, WorkerDied, new_processes
from benchmarks.process.memory import give_back
from benchmarks.results.run_folder import RunFolder
from benchmarks.runner.cache import damaged
from benchmarks.tasks.task import Context, Outcome, RunStopped, Task, failure, tell_nobody

POLL = 0.2  # [s] between looks at the progress
COMPILING = 900.0  # [s] for what a process does before its first task: it may have to compile every kernel

Needed = Mapping[TaskId, Outcome]
Batch = tuple[Sequence[Task], Needed]
Done = tuple[Task, Outcome]
Ready = Callable[[], Batch | None]


class Executor(Protocol):
    """Executes tasks whose needs are there; gives outcomes, in any order."""

    def together(self, ready: Ready, bar: Any) -> Iterator[Done]:
        """Batches of untimed tasks, some side by side, until none is at work and none is ready.

        ready: the next batch that can begin, None where there is none before further outcomes are known.
        bar: is told of progress.
        """

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

    Workers stay for the next batch, which then loads and compiles nothing again; none is there beside a timed
    task.
    """

    def __init__(self, folder: RunFolder, assets: Assets | None, workers: int) -> None:
        self.folder, self.assets, self.workers = folder, assets, workers
        self._named: dict[str, IsolatedProcess] = {}
        self._troubles: dict[str, Outcome] = {}  # process -> how it died before its task's turn
        self._crew: list[TaskProcess] = []

    def together(self, ready: Ready, bar: Any) -> Iterator[Done]:
        finished: queue.SimpleQueue[Done] = queue.SimpleQueue()

        def do(worker: TaskProcess, batch: Batch) -> None:
            worker.forget()
            tasks, needed = batch
            for task in tasks:
                finished.put((task, worker.do(task, dict(needed))))

        at_work: dict[Future[None], TaskProcess] = {}
        with ThreadPoolExecutor(self.workers) as threads:  # one waits for each worker
            try:
                while True:
                    while len(at_work) < self.workers and (batch := ready()):
                        worker = self._idle(at_work.values())
                        at_work[threads.submit(do, worker, batch)] = worker
                    if not at_work:
                        break
                    ended, _ = wait(at_work, timeout=POLL, return_when=FIRST_COMPLETED)
                    for worker in at_work.values():
                        bar.update(min(worker.told(), bar.total - bar.n))
                    for future in ended:
                        del at_work[future]
                        future.result()
                    while not finished.empty():
                        yield finished.get()
            except BaseException:
                _end(set(at_work))
                self._crew.clear()
                raise

    def _idle(self, at_work: Collection[TaskProcess]) -> TaskProcess:
        """A worker that does nothing, a new one where all are at work."""
        for worker in self._crew:
            if worker not in at_work:
                return worker
        self._crew.append(TaskProcess(begin_tasks, Context(self.folder, self.assets)))
        return self._crew[-1]

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
        if outcome.status == "timeout":  # of a program, ended by its method: what it has started may run on
            self.process.close()
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

    def told(self) -> float:
        """Progress since the last call, in seconds that it was expected to take."""
        progress, seconds = self.progress, 0.0  # the worker may get another meanwhile
        while not progress.empty():
            seconds += progress.get()
        return seconds


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
    """Keep what a process knows. progress: a queue of expected seconds, None where nobody follows them."""
    global _context
    tell: Callable[[float], None] = tell_nobody if progress is None else progress.put
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
    context = dataclasses.replace(_context, tell=lambda units: _context.tell(units * task.unit_seconds))
    clock = time.perf_counter()
    try:
        outcome = task.run(context, needed)
    except Exception as error:
        outcome = failure(error)
    return dataclasses.replace(outcome, seconds=time.perf_counter() - clock)


def _verify(digests: Mapping[str, str]) -> None:
    """Raises RunStopped where a file is not as it was written: the next run makes it anew."""
    if damage := damaged(_context.folder, dict(digests.items() - _verified)):
        raise RunStopped(f"{damage} since this run wrote it")
    _verified.update(digests.items())
