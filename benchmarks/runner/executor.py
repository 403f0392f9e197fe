"""Executor of tasks: untimed ones side by side, timed ones alone."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait

from benchmarks.assets import Assets
from benchmarks.results.run_folder import RunFolder
from benchmarks.runner.isolated_process import TaskProcess
from benchmarks.runner.task import Needed, Outcome, Task

POLL = 0.2  # [s] between looks at what has ended

Batch = tuple[Sequence[Task], Needed]
Done = tuple[Task, Outcome]


class Executor:
    """Executes tasks whose needs are there; outcomes come in any order.

    Untimed tasks are done by single-threaded processes, of which `workers` are at work side by side; they
    stay for the next batch, which loads and compiles nothing again. Nothing is at work beside a timed task.
    """

    def __init__(self, folder: RunFolder, assets: Assets | None, workers: int) -> None:
        self.folder, self.assets, self.workers = folder, assets, workers
        self._named: dict[str, TaskProcess] = {}
        self._all: list[TaskProcess] = []
        self._idle: list[TaskProcess] = []

    def together(self, ready: Callable[[], Batch | None]) -> Iterator[Done]:
        """Do batches of untimed tasks, some side by side, until none is at work or ready.

        ready: the next batch that can begin, None before further outcomes are known.
        """
        finished: queue.SimpleQueue[Done] = queue.SimpleQueue()
        stopped = threading.Event()

        def do(tasks: Sequence[Task], outcomes: Needed) -> None:
            try:
                process = self._idle.pop()
            except IndexError:  # none is idle, or another thread was first
                process = TaskProcess(self.folder, self.assets)
                self._all.append(process)
            for task in tasks:
                outcome = process.do(task, outcomes)
                if stopped.is_set():  # the process was killed at it
                    return
                finished.put((task, outcome))
            self._idle.append(process)

        at_work: set[Future[None]] = set()
        with ThreadPoolExecutor(self.workers) as threads:
            try:
                while True:
                    for future in [future for future in at_work if future.done()]:
                        future.result()
                        at_work.remove(future)
                    while len(at_work) < self.workers and (batch := ready()):
                        at_work.add(threads.submit(do, *batch))
                    try:
                        result = finished.get(timeout=POLL if at_work else 0.0)
                    except queue.Empty:
                        if not at_work:
                            break
                        continue
                    yield result
            except BaseException as error:
                stopped.set()
                while at_work := {f for f in at_work if not (f.cancel() or f.done())}:
                    for process in self._all:
                        process.stop()
                    wait(at_work, timeout=POLL)
                while not (finished.empty() or isinstance(error, GeneratorExit)):
                    yield finished.get()  # what was finished by then is kept
                raise
            finally:
                while self._all:  # none is at work; others begin where needed
                    self._all.pop().close()
                self._idle.clear()

    def run_alone(self, task: Task, outcomes: Needed) -> Outcome:
        """Return the outcome of a timed task, done alone in the process that it names."""
        if task.process not in self._named:
            assets = self.assets.only(task.motion) if self.assets and task.motion else None
            self._named[task.process] = TaskProcess(self.folder, assets)
        return self._named[task.process].do(task, outcomes)

    def release(self, process: str) -> None:
        """End the process of this name, which no other task wants."""
        if process in self._named:
            self._named.pop(process).close()

    def close(self) -> None:
        """End all processes."""
        for name in list(self._named):
            self.release(name)
