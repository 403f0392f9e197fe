"""Executor of tasks on this machine. cluster_executor extends it.

A task that raises, exceeds a deadline of its own, or whose process dies is an outcome, not an end of the run.
"""

from __future__ import annotations

import multiprocessing
import queue
import threading
from collections.abc import Callable, Collection, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from typing import TYPE_CHECKING, Any

from benchmarks.assets.assets import Assets
from benchmarks.process.isolated_process import IsolatedProcess
from benchmarks.results.run_folder import RunFolder
from benchmarks.runner.task_process import Needed, TaskProcess, begin_task, begin_tasks, call, perform
from benchmarks.tasks.task import Context, Outcome, Task

if TYPE_CHECKING:
    from tqdm import tqdm

POLL = 0.2  # [s] between looks at the progress

Batch = tuple[Sequence[Task], Needed]
Done = tuple[Task, Outcome]
Ready = Callable[[], Batch | None]


class LocalExecutor:
    """Executes tasks whose needs are there, in single-threaded processes of this machine.

    At most `workers` are at work side by side; outcomes come in any order.
    Workers stay for the next batch, which then loads and compiles nothing again; none is there beside a timed
    task.
    """

    def __init__(self, folder: RunFolder, assets: Assets | None, workers: int) -> None:
        self.folder, self.assets, self.workers = folder, assets, workers
        self._named: dict[str, IsolatedProcess] = {}
        self._troubles: dict[str, Outcome] = {}  # process -> how it died before its task's turn
        self._crew: list[TaskProcess] = []

    @property
    def side_by_side(self) -> int:
        """The number of untimed tasks that are expected to be at work at once."""
        return self.workers

    def together(self, ready: Ready, bar: tqdm) -> Iterator[Done]:
        """Do batches of untimed tasks, some side by side, until none is at work and none is ready.

        ready: the next batch that can begin, None where there is none before further outcomes are known.
        bar: is told of progress.
        """
        finished: queue.SimpleQueue[Done] = queue.SimpleQueue()
        stopped = threading.Event()

        def do(worker: TaskProcess, batch: Batch) -> None:
            worker.forget()
            tasks, needed = batch
            for task in tasks:
                outcome = worker.do(task, dict(needed))
                if stopped.is_set():  # the process was killed at it, and would be started for the next
                    return
                finished.put((task, outcome))

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
            except BaseException as error:
                stopped.set()
                _end(set(at_work))
                self._crew.clear()
                if not isinstance(error, GeneratorExit):  # what was finished by then is kept
                    while not finished.empty():
                        yield finished.get()
                raise

    def _idle(self, at_work: Collection[TaskProcess]) -> TaskProcess:
        """Return a worker that does nothing, a new one where all are at work."""
        for worker in self._crew:
            if worker not in at_work:
                return worker
        self._crew.append(TaskProcess(begin_tasks, Context(self.folder, self.assets)))
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
                _end(set(begun.values()))
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
        for name in list(self._named):
            self.release(name)

    def _dismiss(self) -> None:
        while self._crew:
            self._crew.pop().process.close()


def _end(futures: set[Future[Any]]) -> None:
    """Begin no other batch, and end the workers until none is left that a thread waits for."""
    left = {future for future in futures if not future.cancel()}
    while left:
        for child in multiprocessing.active_children():
            child.kill()
        _, left = wait(left, timeout=POLL)
