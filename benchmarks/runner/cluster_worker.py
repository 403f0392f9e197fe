"""A worker of a cluster: it does each task in a process, in the folder of the run.

Everything here is called by cluster_executor, in the process of a worker of dask.distributed. A process stays
for the next task of its run, and ends when nobody wants it any more.
"""

from __future__ import annotations

import dataclasses
import multiprocessing
import pickle
import platform
import threading
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor, wait
from dataclasses import dataclass, field
from multiprocessing.queues import SimpleQueue
from pathlib import Path
from typing import TYPE_CHECKING

from benchmarks import provenance
from benchmarks.fingerprint.dependencies import software
from benchmarks.fingerprint.digest import digest_of_file
from benchmarks.process.errors import one_line
from benchmarks.process.timing import one_thread
from benchmarks.results.run_folder import RunFolder
from benchmarks.runner.task_process import Needed, TaskProcess, begin_tasks
from benchmarks.tasks.cell_task import CellTask
from benchmarks.tasks.task import Context, Outcome, RunStopped, Task, failure

if TYPE_CHECKING:
    from dask.typing import Key
    from distributed import Worker

WATCH = 0.5  # [s] between looks at whether the scheduler still wants a task
IDLE = 120.0  # [s] after which a process without a task ends
SEVERAL = 3  # differences that are named


@dataclass(frozen=True)
class Answer:
    """The outcome of a task, or why the worker can do no task of this run, with its address and hardware."""

    worker: str
    outcome: Outcome = field(default_factory=Outcome)
    hardware: str = ""
    unfit: str = ""


class _Process(TaskProcess):
    """A process for tasks of one run; `batch` is the one that it was last at."""

    def __init__(self, folder: str, assets: str) -> None:
        super().__init__(_begin, folder, assets)
        self.assets, self.batch, self.busy, self.timer = assets, "", True, threading.Timer(IDLE, self.end)

    def end(self) -> None:
        """Kill it unless it has a task."""
        with _lock:
            if not self.busy:
                for processes in _processes.values():
                    if self in processes:
                        processes.remove(self)
                self.process.stop()


_lock = threading.Lock()
_processes: dict[str, list[_Process]] = {}  # of each folder


def do_task(folder: str, assets: str, batch: str, work: bytes) -> Answer:
    """Do a task; a worker that cannot says so. Raises RunStopped.

    Args:
        folder: the run's folder, as all machines see it.
        assets: name of the pickled assets in it, which no other run has.
        batch: key of the batch; its tasks share what a process has in its memo.
        work: the pickled task, the outcomes that it needs, and the command's software_of it.
    """
    from distributed import get_worker

    worker = get_worker()
    try:
        task, needed, expected = pickle.loads(work)
        if unfit := _why_unfit(Path(folder) / assets, software_of(task), expected):
            return Answer(worker.address, unfit=unfit)
        one_thread()
        process = _take(folder, assets, batch)
        try:
            outcome = _do(process, task, needed, worker, worker.get_current_task())
            digests = {name: digest_of_file(Path(folder) / name) for name in outcome.files}
            outcome = dataclasses.replace(outcome, digests=digests)
        except OSError as error:  # a file that the task names is not there
            outcome = failure(error)
        finally:
            _give_back(process)
    except RunStopped:
        raise
    except Exception as error:
        return Answer(worker.address, unfit=one_line(error))
    return Answer(worker.address, outcome, provenance.hardware_line(provenance.hardware()))


def progress(folder: str) -> float:
    """Return the progress since the last call, in seconds that it was expected to take."""
    return sum(process.told() for process in list(_processes.get(folder, ())))


def end_processes(folder: str) -> None:
    """Kill all processes of a run."""
    with _lock:
        for process in _processes.pop(folder, ()):
            process.timer.cancel()
            process.process.stop()


def software_of(task: Task) -> dict[str, str]:
    """Return name -> digest or version of all that computes an outcome, files of a user's method included."""
    files = task.cell.entry.files if isinstance(task, CellTask) else ()
    digests = {name: digest_of_file(Path(name)) for name in files if Path(name).is_file()}
    version = {"package Python": platform.python_version()}
    return software("benchmarks.runner.cluster_executor", *task.modules) | digests | version


def _why_unfit(assets: Path, here: Mapping[str, str], expected: Mapping[str, str]) -> str:
    """Return in one line why this worker can do no task, empty where it can. Packages are named first."""
    if multiprocessing.current_process().daemon:
        remedy = "start it with --no-nanny, or with DASK_DISTRIBUTED__WORKER__DAEMON=False in its environment"
        return f"it may start no process: {remedy}"
    if not assets.is_file():
        remedy = "give one that all machines see by --out"
        return f"it does not see the folder {assets.parent} of the run: {remedy}"
    names = sorted(here.keys() | expected.keys(), key=lambda name: (not name.startswith("package "), name))
    changed = [name for name in names if here.get(name) != expected.get(name)]
    if not changed:
        return ""
    listed = [
        f"{name}: {here.get(name)} there, {expected.get(name)} here" if name.startswith("package ") else name
        for name in changed[:SEVERAL]
    ]
    more = f" and {len(changed) - SEVERAL} more" if len(changed) > SEVERAL else ""
    return f"its software is another ({', '.join(listed)}{more}); install the same there as here"


def _take(folder: str, assets: str, batch: str) -> _Process:
    """Return a process without a task, the batch's own if there is one; a new one where all have a task."""
    with _lock:
        processes = _processes.setdefault(folder, [])
        idle = [process for process in processes if not process.busy and process.assets == assets]
        process = min(idle, key=lambda process: process.batch != batch, default=None)
        if process is None:
            process = _Process(folder, assets)
            processes.append(process)
        process.timer.cancel()
        process.busy, other = True, process.batch != batch
        process.batch = batch
    if other:
        process.forget()
    return process


def _give_back(process: _Process) -> None:
    process.busy, process.timer = False, threading.Timer(IDLE, process.end)
    process.timer.daemon = True
    process.timer.start()


def _do(process: _Process, task: Task, needed: Needed, worker: Worker, key: Key) -> Outcome:
    """Return the outcome; end the process where the scheduler has cancelled the task: the command died."""
    with ThreadPoolExecutor(1) as thread:
        future = thread.submit(process.do, task, needed)
        while not wait([future], WATCH).done:
            state = worker.state.tasks.get(key)
            if state is None or state.state == "cancelled":
                process.process.stop()
        return future.result()


def _begin(folder: str, assets: str, progress: SimpleQueue[float]) -> None:
    """Begin a process that does tasks."""
    begin_tasks(Context(RunFolder(folder), pickle.loads((Path(folder) / assets).read_bytes())), progress)
