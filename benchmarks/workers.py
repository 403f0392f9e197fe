"""Single-threaded worker processes for work that is not timed against other work: data and training.

Each worker holds the wardrobe; a job is a module-level function of (wardrobe, tell, *arguments), where
tell(n) reports n units of progress. A job that raises is a value here, not an end of the run. A job that is
a piece of recorded work returns a dataclass with the names of its `files`; its worker writes the record, so
that a run that is killed keeps every job that had ended.
"""

from __future__ import annotations

import dataclasses
import multiprocessing
import queue
import time
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from dataclasses import dataclass
from typing import Any

from .guarded import lead_a_group
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
    """What a job raised, in one line."""

    label: str
    reason: str


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

    context = multiprocessing.get_context("spawn")
    progress = context.Queue()
    with (
        tqdm(total=sum(job.units for job in jobs), desc=title, unit=unit, smoothing=0.05) as bar,
        ProcessPoolExecutor(
            workers or worker_count(), mp_context=context, initializer=_begin, initargs=(wardrobe, progress)
        ) as pool,
    ):
        futures = [pool.submit(_call, job) for job in jobs]
        try:
            _watch(futures, progress, bar)
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            for child in multiprocessing.active_children():
                child.terminate()
            raise
        bar.update(bar.total - bar.n)
    return [_result(job, future) for job, future in zip(jobs, futures)]


def _watch(futures: Sequence[Future[Any]], progress: Any, bar: Any) -> None:
    left = set(futures)
    while left:
        _, left = wait(left, timeout=POLL, return_when=FIRST_COMPLETED)
        try:
            while True:
                bar.update(min(progress.get_nowait(), bar.total - bar.n))
        except queue.Empty:
            pass


def _result(job: Job, future: Future[Any]) -> Any:
    error = future.exception()
    if error is None:
        return future.result()
    return Failure(job.label, " ".join(f"{type(error).__name__}: {error}".split()))


def _begin(wardrobe: Wardrobe | None, progress: Any) -> None:
    """Set up a worker, which ends when its parent does."""
    global _wardrobe, _progress
    lead_a_group()
    _wardrobe, _progress = wardrobe, progress
    # A report that nobody reads any more must not keep a worker alive.
    progress.cancel_join_thread()


def _call(job: Job) -> Any:
    clock = time.perf_counter()
    result = job.function(_wardrobe, _progress.put, *job.arguments)
    if job.work is not None and job.records is not None:
        files = [job.records.folder.path / name for name in result.files]
        seconds = time.perf_counter() - clock
        job.records.keep(job.work, dataclasses.asdict(result), seconds=seconds, files=files)
    return result
