"""Executor of tasks: untimed ones side by side on a back end, timed ones alone in processes of this machine.

A task that raises, exceeds a deadline of its own, or whose process dies is an outcome, not an end of the run.
"""

from __future__ import annotations

import dataclasses
import os
import queue
import threading
import time
import uuid
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import suppress
from multiprocessing.queues import SimpleQueue
from typing import TYPE_CHECKING, Any, Protocol

from benchmarks.assets import Assets
from benchmarks.plan.cell import TaskId
from benchmarks.provenance import damaged
from benchmarks.results.run_folder import RunFolder
from benchmarks.runner.isolated_process import IsolatedProcess, WorkerDied, new_processes
from benchmarks.runner.task import Context, Outcome, RunStopped, Task, failure, tell_nobody
from benchmarks.timing import give_back

if TYPE_CHECKING:
    from tqdm import tqdm

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


POLL = 0.2  # [s] between looks at the progress
MOST = 4096  # threads of this process, each of which waits for a worker

Batch = tuple[Sequence[Task], Needed]
Done = tuple[Task, Outcome]
Ready = Callable[[], Batch | None]


class Worker(Protocol):
    """Does one untimed task after another; what a task leaves in the memo is there for its batch alone."""

    def do(self, task: Task, needed: Needed, batch: str) -> Outcome:
        """Return the outcome of a task, however it ends."""

    def told(self) -> float:
        """Return the progress since the last call, in seconds that it was expected to take."""

    def stop(self) -> None:
        """End the task from another thread: `do` comes back."""


class BackEnd(Protocol):
    """Where untimed tasks are done: by processes of this machine, or by a cluster."""

    @property
    def slots(self) -> int:
        """Number of tasks that are done at once."""

    def worker(self) -> Worker:
        """Return a further worker."""

    def dismiss(self) -> None:
        """End all processes; others begin where they are needed."""

    def close(self) -> None:
        """End everything that was begun."""


class LocalProcesses:
    """Single-threaded processes of this machine, of which `slots` are at work side by side."""

    def __init__(self, folder: RunFolder, assets: Assets | None, slots: int) -> None:
        self._context, self.slots = Context(folder, assets), slots
        self._processes: list[TaskProcess] = []

    def worker(self) -> TaskProcess:
        """Return a further process."""
        self._processes.append(TaskProcess(begin_tasks, self._context))
        return self._processes[-1]

    def dismiss(self) -> None:
        """End all processes."""
        while self._processes:
            self._processes.pop().process.close()

    close = dismiss


class Executor:
    """Executes tasks whose needs are there; outcomes come in any order.

    Workers stay for the next batch, which then loads and compiles nothing again; no process of them is there
    beside a timed task.
    """

    def __init__(
        self, folder: RunFolder, assets: Assets | None, workers: int, back_end: BackEnd | None = None
    ) -> None:
        self.folder, self.assets, self.workers = folder, assets, workers
        self.back_end = back_end or LocalProcesses(folder, assets, workers)
        self._crew: list[Worker] = []
        self._named: dict[str, IsolatedProcess] = {}
        self._troubles: dict[str, Outcome] = {}  # process -> how it died before its task's turn

    @property
    def side_by_side(self) -> int:
        """The number of untimed tasks that are expected to be at work at once."""
        return self.back_end.slots

    def together(self, ready: Ready, bar: tqdm) -> Iterator[Done]:
        """Do batches of untimed tasks, some side by side, until none is at work and none is ready.

        ready: the next batch that can begin, None where there is none before further outcomes are known.
        bar: is told of progress.
        """
        finished: queue.SimpleQueue[Done] = queue.SimpleQueue()
        stopped = threading.Event()

        def do(worker: Worker, batch: Batch) -> None:
            tasks, needed = batch
            key = uuid.uuid4().hex
            for task in tasks:
                outcome = worker.do(task, dict(needed), key)
                if stopped.is_set():  # the process was killed at it, and would be started for the next
                    return
                finished.put((task, outcome))

        at_work: dict[Future[None], Worker] = {}
        with ThreadPoolExecutor(MOST) as threads:  # one waits for each worker
            try:
                while True:
                    ended = [future for future in at_work if future.done()]
                    for worker in at_work.values():
                        bar.update(min(worker.told(), bar.total - bar.n))
                    for future in ended:
                        future.result()
                        del at_work[future]
                    while len(at_work) < self.back_end.slots and (batch := ready()):
                        worker = self._idle(at_work.values())
                        at_work[threads.submit(do, worker, batch)] = worker
                    if not finished.empty():
                        yield finished.get()
                    elif at_work:
                        wait(at_work, timeout=POLL, return_when=FIRST_COMPLETED)
                    else:
                        break
            except BaseException as error:
                stopped.set()
                _end(at_work)
                self._dismiss()
                if not isinstance(error, GeneratorExit):  # what was finished by then is kept
                    while not finished.empty():
                        yield finished.get()
                raise

    def _idle(self, at_work: Collection[Worker]) -> Worker:
        """Return a worker that does nothing, a new one where all are at work."""
        for worker in self._crew:
            if worker not in at_work:
                return worker
        self._crew.append(self.back_end.worker())
        return self._crew[-1]

    def begin(self, tasks: Sequence[tuple[Task, Needed]]) -> None:
        """Prepare timed tasks side by side, each in the process that it names.

        One that dies of it has that outcome at its turn.
        """
        self._dismiss()
        with ThreadPoolExecutor(self.workers) as threads:
            begun = {
                task.process: threads.submit(
                    call, self._process(task), begin_task, task, needed, seconds=task.deadline
                )
                for task, needed in tasks
            }
            try:
                self._troubles |= {name: died for name, future in begun.items() if (died := future.result())}
            except BaseException:
                _end({future: self._named[name] for name, future in begun.items()})
                raise

    def alone(self, task: Task, needed: Needed) -> Outcome:
        """Return the outcome of a timed task, done with nothing at work beside it."""
        self._dismiss()
        if trouble := self._troubles.pop(task.process, None):
            return trouble
        return call(self._process(task), perform, task, needed, seconds=task.deadline)

    def _process(self, task: Task) -> IsolatedProcess:
        """Return the process that a timed task names."""
        if task.process not in self._named:
            context = Context(self.folder, task.assets(self.assets))
            self._named[task.process] = IsolatedProcess(begin_tasks, context)
        return self._named[task.process]

    def release(self, process: str) -> None:
        """End the process of this name, which no other task wants."""
        if process in self._named:
            self._named.pop(process).close()

    def close(self) -> None:
        """End all processes."""
        self._dismiss()
        self.back_end.close()
        for name in list(self._named):
            self.release(name)

    def _dismiss(self) -> None:
        self._crew.clear()
        self.back_end.dismiss()


def _end(at_work: Mapping[Future[Any], Worker | IsolatedProcess]) -> None:
    """Begin no other batch, and end the workers until none is left that a thread waits for."""
    left = {future for future in at_work if not future.cancel()}
    while left:
        for future in left:
            at_work[future].stop()
        _, left = wait(left, timeout=POLL)
