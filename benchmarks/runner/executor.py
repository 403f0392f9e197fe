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
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import suppress
from typing import TYPE_CHECKING, Any, Protocol

from benchmarks.assets import Assets
from benchmarks.provenance import damaged
from benchmarks.results.run_folder import RunFolder
from benchmarks.runner.isolated_process import IsolatedProcess, WorkerDied, tell, tell_nobody
from benchmarks.runner.task import Context, Needed, Outcome, RunStopped, Task, failure
from benchmarks.timing import give_back

if TYPE_CHECKING:
    from tqdm import tqdm

COMPILING = 900.0  # [s] for what a process does before its first task: it may have to compile every kernel
POLL = 0.2  # [s] between looks at what has ended
MOST = 4096  # threads of this process, each of which waits for a worker

Told = Callable[[float], None]  # is told of progress, in seconds that it was expected to take
Batch = tuple[Sequence[Task], Needed]
Done = tuple[Task, Outcome]


# --- in the process ----------------------------------------------------------------------------------------

_context: Context
_verified: set[tuple[str, str]] = set()  # files that this process has compared with their digests


def begin_tasks(folder: RunFolder, assets: Assets | None) -> None:
    """Keep what a process knows. One bar for all that are side by side is enough."""
    global _context
    os.environ["TQDM_DISABLE"] = "1"
    _context = Context(folder, assets)


def forget() -> None:
    """Empty the memo of this process and give back its memory.

    A batch that left nothing there is no reason to look through all objects for garbage.
    """
    if _context.memo:
        _context.memo.clear()
        give_back()


def begin_task(begin: Callable[[Context], None], needed: Needed) -> None:
    """Prepare a timed task before its turn."""
    _verify(needed)
    with suppress(Exception):  # it is raised again, and told, when it is the task's turn
        begin(_context)


def perform(run: Callable[[Context, Needed], Outcome], needed: Needed, expected: float) -> Outcome:
    """Return the outcome of a task, done in this process. expected: its duration [s], told as progress."""
    _verify(needed)
    shares = [0.0]

    def tell_share(share: float) -> None:
        shares.append(share)
        tell(share * expected)

    clock = time.perf_counter()
    try:
        outcome = run(dataclasses.replace(_context, tell=tell_share), needed)
    except Exception as error:
        outcome = failure(error)
    tell_share(1.0 - sum(shares))
    return dataclasses.replace(outcome, seconds=time.perf_counter() - clock)


def _verify(needed: Needed) -> None:
    """Raise RunStopped where a file is not as it was written: the next run makes it anew."""
    for outcome in needed.values():
        if damage := damaged(_context.folder.path, dict(outcome.digests.items() - _verified)):
            raise RunStopped(f"{damage} since this run wrote it")
        _verified.update(outcome.digests.items())


# --- around the process ------------------------------------------------------------------------------------


def call(
    process: IsolatedProcess,
    function: Callable[..., Any],
    *arguments: Any,
    seconds: float | None,
    told: Told = tell_nobody,
) -> Any:
    """Call function(*arguments) in a process, which is ended at the deadline; a failure is an outcome."""
    clock = time.perf_counter()
    try:
        return process.call(function, *arguments, seconds=seconds, told=told)
    except Exception as error:
        return dataclasses.replace(failure(error), seconds=time.perf_counter() - clock)


class TaskProcess:
    """A process that does one untimed task after another, another process after one that was killed."""

    def __init__(self, folder: RunFolder, assets: Assets | None) -> None:
        self.process, self.folder = IsolatedProcess(begin_tasks, folder, assets), folder
        self._batch = ""
        self._warm: set[Any] = set()

    def do(self, task: Task, needed: Needed, batch: str, told: Told) -> Outcome:
        """Return the task's outcome; what it leaves in the memo is there for the next of its batch."""
        if batch != self._batch and self.process.alive:
            with suppress(WorkerDied):
                self.process.call(forget, seconds=None)
        self._batch = batch
        if not self.process.alive:
            self._warm.clear()
        if task.warm_up is not None and task.code[0] not in self._warm:
            if trouble := call(self.process, task.warm_up, seconds=COMPILING):
                return trouble
            self._warm.add(task.code[0])
        outcome = call(
            self.process, perform, task.run, needed, task.seconds, seconds=task.deadline, told=told
        )
        if outcome.status == "timeout":  # of a program, ended by its method: what it has started may run on
            self.process.close()
        return outcome


class BackEnd(Protocol):
    """Where untimed tasks are done: by processes of this machine, or by a cluster."""

    @property
    def slots(self) -> int:
        """Number of tasks that are done at once."""

    def do(self, task: Task, needed: Needed, batch: str, told: Told) -> Outcome:
        """Return the outcome of a task, however it ends; each thread does one after another.

        What a task leaves in the memo is there for its batch alone.
        """

    def stop(self) -> None:
        """End what is at work, from another thread: each `do` comes back."""

    def rest(self) -> None:
        """End all processes, none of which is at work; others begin where they are needed."""

    def close(self) -> None:
        """End everything that was begun."""


class LocalProcesses:
    """Single-threaded processes of this machine, of which `slots` are at work side by side."""

    def __init__(self, folder: RunFolder, assets: Assets | None, slots: int) -> None:
        self._begin, self.slots = (folder, assets), slots
        self._processes: dict[int, TaskProcess] = {}  # of each thread

    def do(self, task: Task, needed: Needed, batch: str, told: Told) -> Outcome:
        """Return the outcome of a task, done by the process of this thread."""
        thread = threading.get_ident()
        if thread not in self._processes:
            self._processes[thread] = TaskProcess(*self._begin)
        return self._processes[thread].do(task, needed, batch, told)

    def stop(self) -> None:
        """Kill all processes."""
        for process in list(self._processes.values()):
            process.process.stop()

    def rest(self) -> None:
        """End all processes."""
        while self._processes:
            self._processes.popitem()[1].process.close()

    close = rest


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
        self._named: dict[str, IsolatedProcess] = {}
        self._troubles: dict[str, Outcome] = {}  # process -> how it died before its task's turn

    @property
    def side_by_side(self) -> int:
        """The number of untimed tasks that are expected to be at work at once."""
        return self.back_end.slots

    def together(self, ready: Callable[[], Batch | None], bar: tqdm) -> Iterator[Done]:
        """Do batches of untimed tasks, some side by side, until none is at work and none is ready.

        ready: the next batch that can begin, None where there is none before further outcomes are known.
        bar: is told of progress.
        """
        events: queue.SimpleQueue[Done | float] = queue.SimpleQueue()
        stopped = threading.Event()

        def do(batch: Batch) -> None:
            tasks, needed = batch
            key = uuid.uuid4().hex
            for task in tasks:
                outcome = self.back_end.do(task, dict(needed), key, events.put)
                if stopped.is_set():  # the process was killed at it
                    return
                events.put((task, outcome))

        at_work: set[Future[None]] = set()
        with ThreadPoolExecutor(MOST) as threads:  # one waits for each worker
            try:
                while True:
                    for future in [future for future in at_work if future.done()]:
                        future.result()
                        at_work.remove(future)
                    while len(at_work) < self.back_end.slots and (batch := ready()):
                        at_work.add(threads.submit(do, batch))
                    try:
                        event = events.get(timeout=POLL if at_work else 0.0)
                    except queue.Empty:
                        if not at_work:
                            break
                        continue
                    if isinstance(event, tuple):
                        yield event
                    else:
                        bar.update(min(event, bar.total - bar.n))
            except BaseException as error:
                stopped.set()
                while at_work := {f for f in at_work if not (f.cancel() or f.done())}:
                    self.back_end.stop()
                    wait(at_work, timeout=POLL)
                while not (events.empty() or isinstance(error, GeneratorExit)):
                    if isinstance(event := events.get(), tuple):  # what was finished by then is kept
                        yield event
                raise
            finally:
                self.back_end.rest()

    def begin(self, tasks: Sequence[tuple[Task, Needed]]) -> None:
        """Prepare timed tasks side by side, each in the process that it names.

        One that dies of it has that outcome at its turn.
        """
        with ThreadPoolExecutor(self.workers) as threads:
            begun = {
                task.process: threads.submit(
                    call, self._process(task), begin_task, task.begin, needed, seconds=task.deadline
                )
                for task, needed in tasks
                if task.begin is not None
            }
            try:
                self._troubles |= {name: died for name, future in begun.items() if (died := future.result())}
            except BaseException:
                while left := {n: f for n, f in begun.items() if not (f.cancel() or f.done())}:
                    for name in left:
                        self._named[name].stop()
                    wait(left.values(), timeout=POLL)
                raise

    def alone(self, task: Task, needed: Needed) -> Outcome:
        """Return the outcome of a timed task, done with nothing at work beside it."""
        if trouble := self._troubles.pop(task.process, None):
            return trouble
        return call(self._process(task), perform, task.run, needed, task.seconds, seconds=task.deadline)

    def _process(self, task: Task) -> IsolatedProcess:
        """Return the process that a timed task names."""
        if task.process not in self._named:
            assets = self.assets.only(task.motion) if self.assets and task.motion else None
            self._named[task.process] = IsolatedProcess(begin_tasks, self.folder, assets)
        return self._named[task.process]

    def release(self, process: str) -> None:
        """End the process of this name, which no other task wants."""
        if process in self._named:
            self._named.pop(process).close()

    def close(self) -> None:
        """End all processes."""
        self.back_end.close()
        for name in list(self._named):
            self.release(name)
