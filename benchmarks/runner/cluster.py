"""Untimed tasks on a cluster of dask.distributed that the user has started.

dask hands tasks to workers, does them again where a worker died, and ships their outcomes. Files lie in
the run's folder, which all machines have to see under one path.
"""

from __future__ import annotations

import logging
import multiprocessing
import pickle
import platform
import sys
import threading
import uuid
from collections.abc import Iterator, Sequence
from concurrent.futures import CancelledError, ThreadPoolExecutor, wait
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from benchmarks import provenance
from benchmarks.assets import Assets
from benchmarks.provenance import digest_of_file, software
from benchmarks.results.run_folder import RunFolder
from benchmarks.runner.isolated_process import TaskProcess
from benchmarks.runner.task import Needed, Outcome, RunRefused, RunStopped, Task, one_line
from benchmarks.timing import one_thread

if TYPE_CHECKING:
    from distributed import Client

FIRST = 5.0  # [s] in which a scheduler answers at first
PATIENCE = 60.0  # [s] for a lost scheduler to be there again
WATCH = 0.5  # [s] between a worker's looks at whether its task is still wanted


def check_scheduler(address: str) -> None:
    """Raise RunRefused unless a scheduler answers."""
    _connect(address, FIRST).close()


def _connect(address: str, seconds: float) -> Client:
    """Return a client, which waits so long for a lost scheduler. Raises RunRefused."""
    try:
        from distributed import Client
    except ImportError:
        raise RunRefused("--scheduler needs dask.distributed: pip install '.[cluster]'") from None
    logging.getLogger("distributed").setLevel(logging.CRITICAL)  # what matters is said in one line
    try:
        return Client(address, timeout=seconds, name="benchmarks.run", set_as_default=False)
    except Exception as error:  # whatever bytes of another server lead to, also MemoryError
        raise RunRefused(
            f"--scheduler {address}: no scheduler of dask answers there ({one_line(error)}); start one by "
            "`dask scheduler` and give the address that it prints, as tcp://HOST:8786"
        ) from None


class Cluster:
    """Back end of a cluster: each thread of its workers does a task at a time. Workers come and go.

    Raises RunRefused where no scheduler answers.
    """

    def __init__(self, folder: RunFolder, assets: Assets | None, address: str) -> None:
        self.client = _connect(address, PATIENCE)
        self.address, self.folder = address, folder.path.resolve()
        self.assets = self.folder / f".assets-{uuid.uuid4().hex}.part"  # see RunFolder.remove_parts
        self.assets.write_bytes(pickle.dumps(assets))
        self.rest()
        if not self.client.nthreads():
            print(f"waiting for workers: dask worker {address} --nthreads 1", file=sys.stderr)

    @property
    def slots(self) -> int:
        """Number of batches done at once. Without a worker the first one waits for it."""
        if self.client.status == "running":
            with suppress(OSError):  # no scheduler: the client is looking for it
                return max(1, sum(self.client.nthreads().values()))
        return 1

    def do(self, tasks: Sequence[Task], outcomes: Needed) -> Iterator[Outcome]:
        """Yield the outcomes of a batch, done by one process where its worker lives.

        Raises RunStopped where the cluster is gone or cannot do it.
        """
        worker = ""
        for task in tasks:
            outcome, worker = self._outcome(task, outcomes, worker)
            yield outcome

    def _outcome(self, task: Task, outcomes: Needed, address: str) -> tuple[Outcome, str]:
        """Return a task's outcome and its worker's address. address: of the preferred one."""
        work = pickle.dumps((task, outcomes, software_of(task)))
        while True:
            try:
                future = self.client.submit(
                    do_task, self.assets, work, key=f"{task.kind}-{uuid.uuid4().hex}", pure=False,
                    workers=[address] if address else None, allow_other_workers=bool(address),
                )  # fmt: skip
                return future.result()
            except RunStopped:
                raise
            except Exception as error:
                if self.client.status == "closed":
                    fault = f"the scheduler {self.address} is gone and was not back in {PATIENCE:g} s"
                    raise RunStopped(fault) from None
                if isinstance(error, CancelledError):  # the scheduler died: another one is asked
                    continue
                if type(error).__name__ != "KilledWorker":
                    raise RunStopped(f"{self.address}: {task.title}: {one_line(error)}") from None
                died = f"workers died while they did it: {one_line(error)}"
                return Outcome("failed", died, failed=True), ""

    def stop(self) -> None:
        """End all processes and cancel all tasks, from another thread."""
        self.rest()
        self.client.close()

    def rest(self) -> None:
        """End the processes of the run's folder on all workers, also of a killed command."""
        if self.client.status == "running":
            with suppress(OSError):  # no scheduler: its workers end by themselves
                self.client.run(end_processes, self.folder, on_error="ignore")

    def close(self) -> None:
        """End all that was begun on the cluster."""
        self.stop()
        self.assets.unlink(missing_ok=True)


def software_of(task: Task) -> dict[str, str]:
    """Return name -> digest or version of all that computes an outcome, also files of a user."""
    method = task.inputs.get("method")
    files = method["files"] if isinstance(method, dict) else ()
    digests = {name: digest_of_file(Path(name)) for name in files if Path(name).is_file()}
    of_python = {"package Python": platform.python_version()}
    return software("benchmarks/runner", *task.code) | digests | of_python


# --- in a worker ---

_processes: dict[int, tuple[Path, TaskProcess]] = {}  # of each thread: path of its assets, and it


def do_task(assets: Path, work: bytes) -> tuple[Outcome, str]:
    """Do a task; return its outcome and the address of the worker. Raises RunStopped.

    Args:
        assets: the pickled assets in the run's folder, which no other run has.
        work: the pickled task, the outcomes that it needs, and the command's software_of it.
    """
    from distributed import get_worker

    worker = get_worker()
    key = worker.get_current_task()
    if not assets.is_file():
        unseen = f"worker {worker.address}: it does not see the run's folder {assets.parent}"
        raise RunStopped(f"{unseen}: by --out give one that all machines see")
    task, outcomes, software = pickle.loads(work)
    if changed := sorted(name for name, _ in software.items() ^ software_of(task).items()):
        other = f"its software is another ({changed[0]}); install the same there as here"
        raise RunStopped(f"worker {worker.address}: {other}")
    process = _process_of(assets)
    with ThreadPoolExecutor(1) as thread:
        future = thread.submit(process.do, task, outcomes)
        while not wait([future], WATCH).done:
            state = worker.state.tasks.get(key)
            if state is None or state.state == "cancelled":  # by the command, or as it died
                process.stop()
    hardware = provenance.hardware_line(provenance.hardware())
    outcome = future.result()
    return replace(outcome, origin={"hardware": hardware, **outcome.origin}), worker.address


def _process_of(assets: Path) -> TaskProcess:
    """Return the process of this thread for tasks of the run that has these assets."""
    # A nanny's worker is a daemon, which may have no processes. Ours end with it by themselves.
    multiprocessing.current_process()._config["daemon"] = False  # type: ignore[attr-defined]
    one_thread()
    thread = threading.get_ident()
    old_assets, process = _processes.get(thread, (None, None))
    if process is None or old_assets != assets:
        if process is not None:
            process.close()
        process = TaskProcess(RunFolder(assets.parent), pickle.loads(assets.read_bytes()))
        _processes[thread] = assets, process
    return process


def end_processes(folder: Path) -> None:
    """Kill all processes of a run's folder."""
    for thread, (assets, process) in list(_processes.items()):
        if assets.parent == folder:
            process.stop()
            _processes.pop(thread, None)
