"""Single-threaded worker processes for work that is not timed against other work: data and training.

Each worker holds the wardrobe; a job is a module-level function of (wardrobe, tell, *arguments), where
tell(n) reports n units of progress. A job that raises, or whose worker is killed, is a value here, not an
end of the run. A job that is a piece of recorded work returns a dataclass with the names of its `files`; its
worker writes the record, so that a run that is killed keeps every job that had ended.
"""

from __future__ import annotations

import dataclasses
import multiprocessing
import queue
import time
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass
from typing import Any

from .guarded import Broken, Guarded
from .provenance import usable_cores
from .records import Records, Work
from .wardrobe import Wardrobe

WORKERS = 2  # the same everywhere, so that seconds of two runs can be compared; fewer cores, fewer workers
Tell = Callable[[int], None]
POLL = 0.2  # [s] between looks at the progress

_wardrobe: Wardrobe | None = None
_progress: Any = None


@dataclass(frozen=True)
class Job:
    """What to do: a label, the function, its arguments, and how many units of progress it is.

    work and records: where the outcome is kept; None for what keeps its own.
    """

    label: str
    function: Callable[..., Any]
    arguments: tuple[Any, ...]
    units: int
    work: Work | None = None
    records: Records | None = None


@dataclass(frozen=True)
class Failure:
    """What a job raised, or how its worker ended, in one line."""

    label: str
    reason: str


def one_line(error: Exception) -> str:
    """What was raised, in one line."""
    return " ".join(f"{type(error).__name__}: {error}".split())


def worker_count() -> int:
    """Worker processes used on this machine unless the request names another number."""
    return min(WORKERS, usable_cores())


def run_jobs(
    jobs: Sequence[Job], wardrobe: Wardrobe | None, *, title: str, unit: str, workers: int | None = None
) -> list[Any]:
    """Results in the order of the jobs, a Failure where one raised. A bar shows the time left.

    workers: processes side by side; None for worker_count().

    An interrupt ends the workers at once and is raised again; files are written whole or not at all by
    the jobs themselves.
    """
    if not jobs:
        return []
    from tqdm import tqdm

    count = min(workers or worker_count(), len(jobs))
    crew = [Worker(wardrobe) for _ in range(count)]
    idle: queue.SimpleQueue[Worker] = queue.SimpleQueue()
    for worker in crew:
        idle.put(worker)

    def done(job: Job) -> Any:
        worker = idle.get()
        try:
            return worker.do(job)
        finally:
            idle.put(worker)

    with (
        tqdm(total=sum(job.units for job in jobs), desc=title, unit=unit, smoothing=0.05) as bar,
        ThreadPoolExecutor(count) as threads,  # one waits for each worker
    ):
        futures = [threads.submit(done, job) for job in jobs]
        try:
            _watch(futures, crew, bar)
        except BaseException:
            _end(futures)
            raise
        bar.update(bar.total - bar.n)
        for worker in crew:
            worker.process.close()
    return [future.result() for future in futures]


class Worker:
    """A process that does one job after another, another process after one that was killed."""

    def __init__(self, wardrobe: Wardrobe | None) -> None:
        self.wardrobe = wardrobe
        self._renew()

    def _renew(self) -> None:
        # A queue for each process: one that is killed while it reports leaves a lock that nobody opens.
        self.progress = multiprocessing.get_context("spawn").SimpleQueue()
        self.process = Guarded(_begin, self.wardrobe, self.progress)

    def do(self, job: Job) -> Any:
        """The result of a job, or a Failure."""
        try:
            return self.process.call(_call, job, seconds=None)
        except Broken as broken:
            self._renew()
            return Failure(job.label, f"{broken.status}: {broken}")
        except Exception as error:
            return Failure(job.label, one_line(error))


def _watch(futures: Sequence[Future[Any]], crew: Sequence[Worker], bar: Any) -> None:
    left = set(futures)
    while left:
        _, left = wait(left, timeout=POLL, return_when=FIRST_COMPLETED)
        for progress in [worker.progress for worker in crew]:  # a worker may get another meanwhile
            while not progress.empty():
                bar.update(min(progress.get(), bar.total - bar.n))


def _end(futures: Sequence[Future[Any]]) -> None:
    """Begin no other job, and end the workers until none is left that a thread waits for."""
    left = {future for future in futures if not future.cancel()}
    while left:
        for child in multiprocessing.active_children():
            child.kill()
        _, left = wait(left, timeout=POLL)


def _begin(wardrobe: Wardrobe | None, progress: Any) -> None:
    global _wardrobe, _progress
    _wardrobe, _progress = wardrobe, progress


def _call(job: Job) -> Any:
    clock = time.perf_counter()
    result = job.function(_wardrobe, _progress.put, *job.arguments)
    if job.work is not None and job.records is not None:
        files = [job.records.folder.path / name for name in result.files]
        seconds = time.perf_counter() - clock
        job.records.keep(job.work, dataclasses.asdict(result), seconds=seconds, files=files)
    return result
