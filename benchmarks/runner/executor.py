"""Executor of tasks: untimed ones side by side on a back end, timed ones alone in processes of this machine.

A task that raises, exceeds a deadline of its own, or whose process dies is an outcome, not an end of the run.
"""

from __future__ import annotations

import dataclasses
import os
import queue
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import suppress
from typing import TYPE_CHECKING

from benchmarks.assets import Assets
from benchmarks.results.run_folder import RunFolder
from benchmarks.runner.isolated_process import IsolatedProcess, WorkerDied, tell, tell_nobody
from benchmarks.runner.task import Context, Needed, Outcome, Task, failure
from benchmarks.timing import give_back

if TYPE_CHECKING:
    from tqdm import tqdm

    from benchmarks.runner.cluster import Cluster

COMPILING = 900.0  # [s] for what a process does before its first task: it may have to compile every kernel
POLL = 0.2  # [s] between looks at what has ended
MOST = 4096  # threads of this process, each of which waits for a worker

Told = Callable[[float], None]  # is told of progress, in seconds that it was expected to take
Batch = tuple[Sequence[Task], Needed]
Done = tuple[Task, Outcome]


# --- in the process ----------------------------------------------------------------------------------------

_context: Context


def begin_tasks(folder: RunFolder, assets: Assets | None) -> None:
    """Keep what a process knows. One bar for all that are side by side is enough."""
    global _context
    os.environ["TQDM_DISABLE"] = "1"
    _context = Context(folder, assets)


def forget() -> None:
    """Empty the memo of this process and give back its memory."""
    if _context.memo:  # else there is no reason to look through all objects for garbage
        _context.memo.clear()
        give_back()


def perform(run: Callable[[Context, Needed], Outcome], needed: Needed, expected: float) -> Outcome:
    """Return the outcome of a task, done in this process. expected: its duration [s], told as progress."""
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


# --- around the process ------------------------------------------------------------------------------------


class TaskProcess(IsolatedProcess):
    """A process that does one task after another, another process after one that was killed."""

    def __init__(self, folder: RunFolder, assets: Assets | None) -> None:
        super().__init__(begin_tasks, folder, assets)
        self._warm: set[str] = set()  # code whose kernels are compiled

    def do(self, task: Task, needed: Needed, told: Told = tell_nobody) -> Outcome:
        """Return the task's outcome. What it leaves in the memo is there for the next one."""
        clock = time.perf_counter()
        try:
            if not self.alive:
                self._warm.clear()
            if task.warm_up is not None and task.code[0] not in self._warm:
                self.call(task.warm_up, seconds=COMPILING)
                self._warm.add(task.code[0])
            work = perform, task.run, needed, task.seconds
            outcome = self.call(*work, seconds=task.deadline, told=told)
        except Exception as error:
            return dataclasses.replace(failure(error), seconds=time.perf_counter() - clock)
        if outcome.status == "timeout":  # of a program, ended by its method: what it has started may run on
            self.close()
        return outcome

    def forget(self) -> None:
        """Empty the memo."""
        if self.alive:
            with suppress(WorkerDied):
                self.call(forget, seconds=None)


class LocalProcesses:
    """The back end of this machine: single-threaded processes, of which `slots` are at work side by side.

    Another back end has the same methods, see benchmarks.runner.cluster.
    """

    def __init__(self, folder: RunFolder, assets: Assets | None, slots: int) -> None:
        self._begin, self.slots = (folder, assets), slots
        self._all: list[TaskProcess] = []
        self._idle: list[TaskProcess] = []

    def do(self, tasks: Sequence[Task], needed: Needed, told: Told) -> Iterator[Outcome]:
        """Yield the outcome of each task of a batch, however it ends; called by several threads.

        One process does them. What a task leaves in the memo is there for its batch alone.
        """
        if self._idle:
            process = self._idle.pop()
        else:
            process = TaskProcess(*self._begin)
            self._all.append(process)
        for task in tasks:
            yield process.do(task, needed, told)
        process.forget()
        self._idle.append(process)

    def stop(self) -> None:
        """Kill all processes, from another thread."""
        for process in self._all:
            process.stop()

    def rest(self) -> None:
        """End all processes, none of which is at work; others begin where they are needed."""
        while self._all:
            self._all.pop().close()
        self._idle.clear()

    close = rest


class Executor:
    """Executes tasks whose needs are there; outcomes come in any order.

    Workers stay for the next batch, which then loads and compiles nothing again; no process of them is there
    beside a timed task.
    """

    def __init__(
        self, folder: RunFolder, assets: Assets | None, workers: int, cluster: Cluster | None = None
    ) -> None:
        self.folder, self.assets = folder, assets
        self.back_end = cluster or LocalProcesses(folder, assets, workers)
        self._named: dict[str, TaskProcess] = {}

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

        def do(tasks: Sequence[Task], needed: Needed) -> None:
            for outcome, task in zip(self.back_end.do(tasks, needed, events.put), tasks):
                if stopped.is_set():  # the process was killed at it
                    return
                events.put((task, outcome))

        at_work: set[Future[None]] = set()
        with ThreadPoolExecutor(MOST) as threads:
            try:
                while True:
                    for future in [future for future in at_work if future.done()]:
                        future.result()
                        at_work.remove(future)
                    while len(at_work) < self.back_end.slots and (batch := ready()):
                        at_work.add(threads.submit(do, *batch))
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

    def alone(self, task: Task, needed: Needed) -> Outcome:
        """Return the outcome of a timed task, done in the process that it names, with nothing beside it."""
        if task.process not in self._named:
            assets = self.assets.only(task.motion) if self.assets and task.motion else None
            self._named[task.process] = TaskProcess(self.folder, assets)
        return self._named[task.process].do(task, needed)

    def release(self, process: str) -> None:
        """End the process of this name, which no other task wants."""
        if process in self._named:
            self._named.pop(process).close()

    def close(self) -> None:
        """End all processes."""
        self.back_end.close()
        for name in list(self._named):
            self.release(name)
