"""A scheduler and workers of dask.distributed on this machine, tasks for them, runs on them."""

from __future__ import annotations

import json
import multiprocessing
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks.provenance import digest_of_file
from benchmarks.results.run_folder import RunFolder
from benchmarks.runner.cache import Cache
from benchmarks.runner.cluster import Cluster
from benchmarks.runner.executor import Executor
from benchmarks.runner.loop import Runner
from benchmarks.runner.task import Context, Outcome, Task

ROOT = Path(__file__).resolve().parents[3]
PATH = str(ROOT)


class Dask:
    """Processes of a scheduler and its workers. Each leads a session of its own."""

    def __init__(self, folder: Path, *, port: int = 0) -> None:
        self.folder = folder
        self.workers: list[subprocess.Popen] = []
        self.start_scheduler(port)

    def start_scheduler(self, port: int) -> None:
        file = self.folder / "scheduler.json"
        file.unlink(missing_ok=True)
        self.scheduler = self._start(
            "scheduler", "--port", str(port), "--scheduler-file", str(file),
            DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES="2",
        )  # fmt: skip
        deadline = time.monotonic() + 60
        while not (file.is_file() and file.read_text().endswith("}")):
            assert self.scheduler.poll() is None and time.monotonic() < deadline
            time.sleep(0.05)
        self.address = json.loads(file.read_text())["address"]

    def restart_scheduler(self) -> None:
        """Kill it and start another at its address; the workers end by themselves."""
        self.scheduler.kill()
        self.scheduler.wait()
        for worker in self.workers:
            with suppress(subprocess.TimeoutExpired):  # one that had not found it yet goes on looking
                worker.wait(5)
            worker.kill()
            worker.wait()
        self.workers.clear()
        self.start_scheduler(int(self.address.rpartition(":")[2]))

    def add(self, *options: str) -> subprocess.Popen:
        """Start a worker of one thread, without a nanny that starts another in its place."""
        options = options or ("--no-nanny",)
        options = (self.address, "--nthreads", "1", "--local-directory", str(self.folder), *options)
        self.workers.append(self._start("worker", *options))
        return self.workers[-1]

    def _start(self, what: str, *arguments: str, **environment: str) -> subprocess.Popen:
        with (self.folder / f"{what}.log").open("ab") as log:
            return subprocess.Popen(
                [sys.executable, "-m", f"distributed.cli.dask_{what}", *arguments, "--no-dashboard"],
                env=os.environ | {"PYTHONPATH": PATH} | environment, cwd=self.folder,
                stdout=subprocess.DEVNULL, stderr=log, start_new_session=True,
            )  # fmt: skip

    def close(self) -> None:
        for process in (*self.workers, self.scheduler):
            process.kill()
            process.wait()


@contextmanager
def cluster(folder: Path, workers: int) -> Iterator[Dask]:
    """So many workers of one thread."""
    started = Dask(folder)
    try:
        for _ in range(workers):
            started.add()
        yield started
    finally:
        started.close()


def worker() -> int:
    """Return the id of the process that asked for this one, not of the server that forked it."""
    asking = multiprocessing.parent_process()
    assert asking is not None and asking.pid is not None
    return asking.pid


def work(name: str, seed: int, how: str, mark: str, sleep: float, context: Context, needed) -> Outcome:
    """Write a file of random numbers, plus those of what is needed.

    how: what is done besides; mark: a file that says that it is begun.
    """
    if mark:
        with open(mark, "a") as file:
            file.write(f"{worker()} {os.getpid()}\n")
    if how == "raise":
        raise ValueError("broken on purpose")
    if how == "die with the worker":
        os.kill(worker(), signal.SIGKILL)
        time.sleep(60)
    time.sleep(sleep)
    numbers = np.random.default_rng(seed).random(1000)
    for outcome in needed.values():
        numbers += np.load(context.folder.path / outcome.files[0])
    path = context.folder.path / "numbers" / f"{name}.npy"
    path.parent.mkdir(exist_ok=True)
    np.save(path, numbers)
    context.memo.setdefault("done", []).append(name)
    return Outcome(result={"memo": list(context.memo["done"])}, files=(context.folder.relative(path),))


def write(name: str, *needs: int, seed=0, how="", mark="", sleep=0.0, batch: str = "") -> Task:
    return Task(
        kind="numbers", name=name, label=name, stage="writing", silent=True, batch=batch,
        needs=tuple(("numbers", str(need)) for need in needs), code=("benchmarks/results",),
        run=partial(work, name, seed, how, mark, sleep),
    )  # fmt: skip


def chain(**fields) -> list[Task]:
    """Twelve tasks in three rounds, the later ones made from the earlier ones, the last two one batch."""
    return [
        *(write(str(n), seed=n, **fields) for n in range(6)),
        *(write(str(n), n - 6, 0, seed=n, **fields) for n in range(6, 10)),
        *(write(str(n), 6, seed=n, batch="b", **fields) for n in (10, 11)),
    ]


def executor(folder: RunFolder, address: str = "") -> Executor:
    """Return the executor of a cluster, or without an address of two processes here."""
    return Executor(folder, None, 2, Cluster(folder, None, address) if address else None)


def finish(folder: Path, address: str = "", **fields) -> Runner:
    """The chain, run or reused; what has failed is tried again."""
    RunFolder(folder).remove_parts()
    cache = Cache(RunFolder(folder), retry=True, origin={"commit": "c", "hardware": "h"})
    runner = Runner(chain(**fields), cache)
    runner.run(executor(RunFolder(folder), address))
    return runner


def together(folder: RunFolder, address: str, *batches) -> dict[str, Outcome]:
    left, cluster = [(batch, {}) for batch in reversed(batches)], executor(folder, address)
    try:
        outcomes = cluster.together(lambda: left.pop() if left else None)
        return {task.name: outcome for task, outcome in outcomes}
    finally:
        cluster.close()


def files(folder: Path) -> dict[str, str]:
    """Name -> digest, of what is whole and of what is not."""
    return {path.name: digest_of_file(path) for path in sorted(folder.rglob("*.npy"))}


def until(true, seconds: float = 60.0) -> None:
    deadline = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < deadline
        time.sleep(0.02)


def lines(mark: Path) -> list[list[int]]:
    """Process ids of worker and task, of each beginning of a task that has this mark."""
    return (
        [[int(word) for word in line.split()] for line in mark.read_text().splitlines()]
        if mark.is_file()
        else []
    )


def alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False


def start_runner(folder: Path, address: str, *, seconds: float, mark: Path) -> subprocess.Popen:
    program = (
        "import sys; from pathlib import Path; from tests.benchmarks.runner.cluster_by_hand import finish\n"
        "folder, address, seconds, mark = sys.argv[1:]\n"
        "finish(Path(folder), address, sleep=float(seconds), mark=mark)"
    )
    return subprocess.Popen(
        [sys.executable, "-c", program, str(folder), address, str(seconds), str(mark)],
        env=os.environ | {"PYTHONPATH": PATH}, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
