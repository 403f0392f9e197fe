"""Untimed tasks on a cluster of dask.distributed that the user has started.

dask hands tasks to workers, does them again where a worker died, and ships their outcomes. Files lie in the
run's folder, which all machines have to see under one path.
"""

from __future__ import annotations

import asyncio
import dataclasses
import logging
import multiprocessing
import pickle
import platform
import sys
import threading
import time
import uuid
from concurrent.futures import CancelledError, ThreadPoolExecutor, wait
from contextlib import suppress
from multiprocessing.queues import SimpleQueue
from pathlib import Path
from typing import TYPE_CHECKING

from benchmarks import provenance
from benchmarks.assets import Assets
from benchmarks.provenance import damaged, digest_of_file, software
from benchmarks.results.run_folder import RunFolder
from benchmarks.runner.cells import CellTask
from benchmarks.runner.executor import Needed, TaskProcess, begin_tasks
from benchmarks.runner.isolated_process import one_line
from benchmarks.runner.task import Context, Outcome, RunRefused, RunStopped, Task, failure
from benchmarks.timing import one_thread

if TYPE_CHECKING:
    from distributed import Future

FIRST = 5.0  # [s] in which a scheduler answers at first


def check_scheduler(address: str) -> None:
    """Raise RunRefused unless a scheduler answers; a client of another server would hang."""
    try:
        import distributed  # noqa: F401
    except ImportError:
        raise RunRefused("--scheduler needs dask.distributed: pip install '.[cluster]'") from None
    logging.getLogger("distributed").setLevel(logging.CRITICAL)  # what matters is said in one line
    try:
        kind = asyncio.run(asyncio.wait_for(_kind_of_server(address), FIRST))
    except Exception as error:  # whatever the bytes of another server lead to, a MemoryError too
        kind = one_line(error)
    if kind != "Scheduler":
        raise RunRefused(
            f"--scheduler {address}: no scheduler of dask answers there ({kind}); start one by `dask "
            "scheduler` and give the address that it prints, as tcp://HOST:8786"
        )


async def _kind_of_server(address: str) -> str:
    """Return what a server of dask calls itself, as "Scheduler"."""
    from distributed import Security
    from distributed.core import rpc

    async with rpc(address, connection_args=Security().get_connection_args("client")) as server:
        return str((await server.identity())["type"])


LOOK = 2.0  # [s] between looks at how many threads there are
PATIENCE = 60.0  # [s] for a scheduler that was lost to be there again
WATCH = 0.5  # [s] between a worker's looks at whether its task is still wanted
SEVERAL = 3  # differences of software that are named


class Cluster:
    """The back end of a cluster: each thread of its workers does a task at a time. Workers come and go.

    Raises RunRefused where no scheduler answers.
    """

    def __init__(self, folder: RunFolder, assets: Assets | None, address: str) -> None:
        check_scheduler(address)
        from distributed import Client

        self.client = Client(address, timeout=PATIENCE, name="benchmarks.run", set_as_default=False)
        self.address, self.folder = address, folder.path.resolve()
        self.assets = self.folder / f".assets-{uuid.uuid4().hex}.part"  # see RunFolder.remove_parts
        self.assets.write_bytes(pickle.dumps(assets))
        self.progress: list[float] = []
        self.client.subscribe_topic(self.assets.name, lambda event: self.progress.append(event[1]))
        self.dismiss()
        self._threads, self._looked = sum(self.client.nthreads().values()), time.monotonic()
        if not self._threads:
            print(f"waiting for workers: dask worker {address} --nthreads 1", file=sys.stderr)

    @property
    def slots(self) -> int:
        """Number of tasks that are done at once. Without a worker the first one waits for it."""
        if time.monotonic() > self._looked + LOOK and self.client.status == "running":
            with suppress(OSError):  # no scheduler: the client is looking for it
                self._threads = sum(self.client.nthreads().values())
            self._looked = time.monotonic()
        return max(1, self._threads)

    def worker(self) -> ClusterThread:
        """Return what does the tasks of a batch."""
        return ClusterThread(self)

    def dismiss(self) -> None:
        """End the processes of the run's folder on all workers, those of a command that was killed too."""
        if self.client.status == "running":
            with suppress(OSError):  # no scheduler: its workers end by themselves
                self.client.run(end_processes, self.folder, on_error="ignore")

    def close(self) -> None:
        """End everything that was begun on the cluster."""
        self.dismiss()
        self.client.close()
        self.assets.unlink(missing_ok=True)


class ClusterThread:
    """One task after another on the cluster, those of a batch by one process where its worker lives."""

    def __init__(self, cluster: Cluster) -> None:
        self._cluster, self._stopped = cluster, False
        self._future: Future | None = None
        self._worker = ""  # address of the one that did the last task

    def do(self, task: Task, needed: Needed, batch: str) -> Outcome:
        """Return the task's outcome. Raises RunStopped where the cluster is gone or cannot do it."""
        cluster, work = self._cluster, pickle.dumps((task, needed, software_of(task)))
        while not self._stopped:
            try:
                self._future = cluster.client.submit(
                    do_task, cluster.assets, batch, work, key=f"{task.kind}-{uuid.uuid4().hex}", pure=False,
                    workers=[self._worker] if self._worker else None, allow_other_workers=bool(self._worker),
                )  # fmt: skip
                outcome, self._worker = self._future.result()
            except RunStopped:
                raise
            except Exception as error:
                if cluster.client.status == "closed":
                    lost = f"the scheduler {cluster.address} is gone and was not back in {PATIENCE:g} s"
                    raise RunStopped(lost) from None
                if isinstance(error, CancelledError):  # the scheduler died: another one is asked
                    continue
                if type(error).__name__ == "KilledWorker":
                    return Outcome("failed", _died(error), failed=True)
                raise RunStopped(f"{cluster.address}: {task.title}: {one_line(error)}") from None
            if damage := damaged(cluster.folder, outcome.digests):
                raise RunStopped(f"{damage}, seen from here, since worker {self._worker} wrote it")
            return outcome
        return Outcome("failed", "stopped", failed=True)

    def told(self) -> float:
        """Return the progress of all threads since the last call, in seconds that it was expected to take."""
        progress, seconds = self._cluster.progress, 0.0
        while progress:
            seconds += progress.pop()
        return seconds

    def stop(self) -> None:
        """Cancel the task, from another thread."""
        self._stopped = True
        if self._future is not None:
            self._future.cancel()


def _died(error: BaseException) -> str:
    deaths, last = getattr(error, "allowed_failures", 0) + 1, getattr(error, "last_worker", None)
    return f"{deaths} workers died while they did it: the last was {getattr(last, 'address', 'unknown')}"


def software_of(task: Task) -> dict[str, str]:
    """Return name -> digest or version of all that computes an outcome, files of a user's method included."""
    files = task.cell.entry.files if isinstance(task, CellTask) else ()
    digests = {name: digest_of_file(Path(name)) for name in files if Path(name).is_file()}
    return software("benchmarks/runner", *task.code) | digests | {"package Python": platform.python_version()}


# --- in a worker -------------------------------------------------------------------------------------------


class _Process(TaskProcess):
    """The process of one thread of a worker, for tasks of one run."""

    def __init__(self, assets: Path) -> None:
        super().__init__(_begin, assets)
        self.assets = assets


_processes: dict[int, _Process] = {}  # of each thread


def do_task(assets: Path, batch: str, work: bytes) -> tuple[Outcome, str]:
    """Do a task; return its outcome and the address of the worker. Raises RunStopped.

    Args:
        assets: the pickled assets in the run's folder, which no other run has.
        batch: key of the batch; its tasks share what a process has in its memo.
        work: the pickled task, the outcomes that it needs, and the command's software_of it.
    """
    from distributed import get_worker

    worker = get_worker()
    key = worker.get_current_task()
    try:
        task, needed, expected = pickle.loads(work)
        problem = _unfit(assets, software_of(task), expected)
    except Exception as error:
        problem = one_line(error)
    if problem:
        raise RunStopped(f"worker {worker.address}: {problem}")
    # A nanny makes its worker a daemon, which may have no processes. Ours end with it by themselves.
    multiprocessing.current_process()._config["daemon"] = False  # type: ignore[attr-defined]
    one_thread()
    process = _processes.get(threading.get_ident())
    if process is None or process.assets != assets:
        if process is not None:
            process.process.close()
        process = _processes[threading.get_ident()] = _Process(assets)
    with ThreadPoolExecutor(1) as thread:
        future, done = thread.submit(process.do, task, needed, batch), False
        while not done:
            done = bool(wait([future], WATCH).done)
            if seconds := process.told():
                worker.log_event(assets.name, seconds)
            state = worker.state.tasks.get(key)
            if state is None or state.state == "cancelled":  # by the command, or as it died
                process.stop()
    try:
        outcome = future.result()
        digests = {name: digest_of_file(assets.parent / name) for name in outcome.files}
    except OSError as error:  # a file that the task names is not there
        outcome, digests = failure(error), {}
    hardware = provenance.hardware_line(provenance.hardware())
    return dataclasses.replace(outcome, digests=digests, origin={"hardware": hardware}), worker.address


def _unfit(assets: Path, here: dict[str, str], expected: dict[str, str]) -> str:
    """Return in one line why this worker can do no task, empty where it can. Packages are named first."""
    if not assets.is_file():
        return (
            f"it does not see the folder {assets.parent} of the run: by --out give one that all machines see"
        )
    changed = [name for name in here | expected if here.get(name) != expected.get(name)]
    changed.sort(key=lambda name: (not name.startswith("package "), name))
    named = [f"{name}: {here.get(name)} there, {expected.get(name)} here" for name in changed[:SEVERAL]]
    more = f" and {len(changed) - SEVERAL} more" if len(changed) > SEVERAL else ""
    what = f"its software is another ({', '.join(named)}{more}); install the same there as here"
    return what if changed else ""


def end_processes(folder: Path) -> None:
    """Kill all processes of a run's folder."""
    for thread, process in list(_processes.items()):
        if process.assets.parent == folder:
            process.stop()
            _processes.pop(thread, None)


def _begin(assets: Path, progress: SimpleQueue[float]) -> None:
    """Begin a process that does tasks."""
    begin_tasks(Context(RunFolder(assets.parent), pickle.loads(assets.read_bytes())), progress)
