"""What a worker of a cluster does for a run: keeps its files, and does its tasks in processes of their own.

Loads little: what computes is in the tasks' processes. Everything here is called by the module cluster, in
the process of a worker of dask.distributed; `dask_worker` is that worker. A run that asks for nothing any
more is forgotten.
"""

from __future__ import annotations

import dataclasses
import multiprocessing
import os
import pickle
import platform
import shutil
import threading
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from benchmarks import provenance
from benchmarks.fingerprint.dependencies import software
from benchmarks.fingerprint.digest import digest_of_file
from benchmarks.process.errors import one_line
from benchmarks.process.timing import one_thread
from benchmarks.results.run_folder import RunFolder
from benchmarks.runner.task_process import TaskProcess, begin_tasks
from benchmarks.tasks.cell_task import CellTask
from benchmarks.tasks.task import Context, Outcome, Task, failure

PIECE = 8 << 20  # bytes of a file at a time
WATCH = 1.0  # [s] between looks at what nobody wants any more
IDLE = 120.0  # [s] after which a run that nobody asks about is forgotten
ASSETS = ".assets.pickle"  # beside the files of the run
SEVERAL = 3  # differences that are named


class Gone(RuntimeError):
    """The worker knows nothing of the run: it is another process than the one that did."""


class Unfit(RuntimeError):
    """The worker can do no task of this run; the message says why."""


class _Run:
    """What is kept for a run. at: the process that is at each task, by the task's key in dask."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.processes: dict[int, TaskProcess] = {}
        self.at: dict[Any, TaskProcess] = {}
        self.asked = time.monotonic()


_runs: dict[str, _Run] = {}


def open_run(run: str, dask_worker: Any) -> str:
    """Begin with a run, with nothing of it; gives the hardware as rows name it. Raises Unfit."""
    if multiprocessing.current_process().daemon:
        raise Unfit(
            "it may start no process: start it with --no-nanny, or with "
            "DASK_DISTRIBUTED__WORKER__DAEMON=False in its environment"
        )
    close_run(run)
    one_thread()
    folder = Path(dask_worker.local_directory) / f"run-{run}"
    folder.mkdir(exist_ok=True)
    there = _runs[run] = _Run(folder)
    threading.Thread(target=_watch, args=(run, there, dask_worker), name="watch", daemon=True).start()
    return provenance.hardware_line(provenance.hardware())


def close_run(run: str) -> None:
    """End its processes and remove its files."""
    if (left := _runs.pop(run, None)) is not None:
        for process in left.processes.values():
            process.process.stop()
        shutil.rmtree(left.folder, ignore_errors=True)


def progress(run: str) -> float:
    """Progress since the last call, in seconds that it was expected to take."""
    there = _runs.get(run)
    if there is None:
        return 0.0
    there.asked = time.monotonic()
    return sum(process.told() for process in list(there.processes.values()))


def put_piece(run: str, name: str, offset: int, piece: bytes, content: str) -> None:
    """Write a piece of a file. content: its digest with the last piece, else empty. Raises Gone, Unfit."""
    path = _found(run).folder / name
    part = path.with_name(f".{path.name}.part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with part.open("r+b" if offset else "wb") as stream:
            stream.seek(offset)
            stream.write(piece)
        if content:
            if digest_of_file(part) != content:
                raise Unfit(f"{name} came damaged")
            os.replace(part, path)
    except OSError as error:
        raise Unfit(one_line(error)) from None


def get_piece(run: str, name: str, offset: int) -> bytes:
    """PIECE bytes of a file, fewer at its end. Raises Gone, Unfit."""
    try:
        with (_found(run).folder / name).open("rb") as stream:
            stream.seek(offset)
            return stream.read(PIECE)
    except OSError as error:
        raise Unfit(one_line(error)) from None


def do_task(run: str, number: int, fresh: bool, work: bytes) -> Outcome:
    """The outcome of a task, with the digests of its files. Raises Gone, Unfit, RunStopped.

    number: of the process that does it; fresh: whether a batch begins with it. work: the pickled task, the
    outcomes that it needs, and the runner's software_of it.
    """
    from distributed import get_worker

    there = _found(run)
    task, needed, expected = pickle.loads(work)
    if line := _differences(software_of(task), expected):
        raise Unfit(line)
    process = there.processes.setdefault(number, TaskProcess(_begin, there.folder))
    key = get_worker().get_current_task()
    there.at[key] = process
    try:
        if fresh:
            process.forget()
        outcome = process.do(task, needed)
        digests = {name: digest_of_file(there.folder / name) for name in outcome.files}
        return dataclasses.replace(outcome, digests=digests)
    except OSError as error:  # a file that the task names is not there
        return failure(error)
    finally:
        del there.at[key]


def software_of(task: Task) -> dict[str, str]:
    """Name -> digest or version of all that computes the outcome, files of a user's method included."""
    files = task.cell.entry.files if isinstance(task, CellTask) else ()
    digests = {name: digest_of_file(Path(name)) for name in files if Path(name).is_file()}
    version = {"package Python": platform.python_version()}
    return software("benchmarks.runner.cluster", *task.modules) | digests | version


def _differences(here: Mapping[str, str], expected: Mapping[str, str]) -> str:
    """What is another than with the runner, in one line; empty where nothing is. Packages come first."""
    names = sorted(here.keys() | expected.keys(), key=lambda name: (not name.startswith("package "), name))
    changed = [name for name in names if here.get(name) != expected.get(name)]
    if not changed:
        return ""
    said = [
        f"{name}: {here.get(name)} there, {expected.get(name)} here" if name.startswith("package ") else name
        for name in changed[:SEVERAL]
    ]
    more = f" and {len(changed) - SEVERAL} more" if len(changed) > SEVERAL else ""
    return f"its software is another ({', '.join(said)}{more}); install the same there as here"


def _found(run: str) -> _Run:
    if run not in _runs:
        raise Gone("the worker was started anew")
    return _runs[run]


def _watch(run: str, there: _Run, dask_worker: Any) -> None:
    """End what the scheduler has cancelled, as when the runner died, and forget a run that is over."""
    while _runs.get(run) is there or there.at:
        time.sleep(WATCH)
        known = dask_worker.state.tasks
        for key, process in list(there.at.items()):
            if _runs.get(run) is not there or key not in known or known[key].state == "cancelled":
                process.process.stop()
        if not there.at and time.monotonic() - there.asked > IDLE and _runs.get(run) is there:
            close_run(run)


def _begin(folder: Path, progress: Any) -> None:
    """In a process that does tasks."""
    begin_tasks(Context(RunFolder(folder), pickle.loads((folder / ASSETS).read_bytes())), progress)
