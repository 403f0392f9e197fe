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
from pathlib import Path
from typing import TYPE_CHECKING

from benchmarks import provenance
from benchmarks.assets import Assets
from benchmarks.provenance import damaged, digest_of_file, software
from benchmarks.results.run_folder import RunFolder
from benchmarks.runner.executor import TaskProcess, Told
from benchmarks.runner.isolated_process import one_line, tell_nobody
from benchmarks.runner.task import Needed, Outcome, RunRefused, RunStopped, Task, failure
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
        self._workers: dict[str, str] = {}  # batch -> address of the one that did its last task
        self._futures: set[Future] = set()
        self._stopped = False
        self.rest()
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

    def do(self, task: Task, needed: Needed, batch: str, told: Told) -> Outcome:
        """Return the task's outcome, those of a batch by one process where its worker lives.

        Raises RunStopped where the cluster is gone or cannot do it. Progress is told at the end.
        """
        work = dataclasses.replace(task, skip="", begin=None)
        arguments = self.assets, batch, pickle.dumps((work, needed, software_of(task)))
        while not self._stopped:
            near = self._workers.get(batch)
            future = self.client.submit(
                do_task, *arguments, key=f"{task.kind}-{uuid.uuid4().hex}", pure=False,
                workers=[near] if near else None, allow_other_workers=bool(near),
            )  # fmt: skip
            self._futures.add(future)
            try:
                outcome, self._workers[batch] = future.result()
            except RunStopped:
                raise
            except Exception as error:
                if self.client.status == "closed":
                    lost = f"the scheduler {self.address} is gone and was not back in {PATIENCE:g} s"
                    raise RunStopped(lost) from None
                if isinstance(error, CancelledError):  # the scheduler died: another one is asked
                    continue
                if type(error).__name__ == "KilledWorker":
                    return Outcome("failed", _died(error), failed=True)
                raise RunStopped(f"{self.address}: {task.title}: {one_line(error)}") from None
            finally:
                self._futures.discard(future)
            if damage := damaged(self.folder, outcome.digests):
                raise RunStopped(f"{damage}, seen from here, since worker {self._workers[batch]} wrote it")
            told(task.seconds)
            return outcome
        return Outcome("failed", "stopped", failed=True)

    def stop(self) -> None:
        """Cancel all tasks, from another thread."""
        self._stopped = True
        for future in list(self._futures):
            future.cancel()

    def rest(self) -> None:
        """End the processes of the run's folder on all workers, those of a command that was killed too."""
        if self.client.status == "running":
            with suppress(OSError):  # no scheduler: its workers end by themselves
                self.client.run(end_processes, self.folder, on_error="ignore")

    def close(self) -> None:
        """End everything that was begun on the cluster."""
        self.rest()
        self.client.close()
        self.assets.unlink(missing_ok=True)


def _died(error: BaseException) -> str:
    deaths, last = getattr(error, "allowed_failures", 0) + 1, getattr(error, "last_worker", None)
    return f"{deaths} workers died while they did it: the last was {getattr(last, 'address', 'unknown')}"


def software_of(task: Task) -> dict[str, str]:
    """Return name -> digest or version of all that computes an outcome, files of a user's method included."""
    method = task.inputs.get("method")
    files = method["files"] if isinstance(method, dict) else ()
    digests = {name: digest_of_file(Path(name)) for name in files if Path(name).is_file()}
    return software("benchmarks/runner", *task.code) | digests | {"package Python": platform.python_version()}


# --- in a worker -------------------------------------------------------------------------------------------

_processes: dict[int, tuple[Path, TaskProcess]] = {}  # of each thread: the assets that it has, and it


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
    process = _process_of(assets)
    with ThreadPoolExecutor(1) as thread:
        future = thread.submit(process.do, task, needed, batch, tell_nobody)
        while not wait([future], WATCH).done:
            state = worker.state.tasks.get(key)
            if state is None or state.state == "cancelled":  # by the command, or as it died
                process.process.stop()
    try:
        outcome = future.result()
        digests = {name: digest_of_file(assets.parent / name) for name in outcome.files}
    except OSError as error:  # a file that the task names is not there
        outcome, digests = failure(error), {}
    hardware = provenance.hardware_line(provenance.hardware())
    return dataclasses.replace(outcome, digests=digests, origin={"hardware": hardware}), worker.address


def _process_of(assets: Path) -> TaskProcess:
    """Return the process of this thread for tasks of the run that has these assets."""
    # A nanny makes its worker a daemon, which may have no processes. Ours end with it by themselves.
    multiprocessing.current_process()._config["daemon"] = False  # type: ignore[attr-defined]
    one_thread()
    thread = threading.get_ident()
    known, process = _processes.get(thread, (None, None))
    if process is None or known != assets:
        if process is not None:
            process.process.close()
        process = TaskProcess(RunFolder(assets.parent), pickle.loads(assets.read_bytes()))
        _processes[thread] = assets, process
    return process


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
    for thread, (assets, process) in list(_processes.items()):
        if assets.parent == folder:
            process.process.stop()
            _processes.pop(thread, None)
