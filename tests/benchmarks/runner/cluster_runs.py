"""Runs on a cluster by hand, what they leave, and which of their processes live."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

from benchmarks.fingerprint.digest import digest_of_file
from benchmarks.results.run_folder import RunFolder
from benchmarks.runner.cluster_executor import ClusterExecutor
from benchmarks.tasks.task import Outcome
from tests.benchmarks.runner.cluster_by_hand import PATH
from tests.benchmarks.runner.tasks_by_hand import Bar


def together(folder: RunFolder, address: str, *batches, needed=None) -> dict[str, Outcome]:
    executor = ClusterExecutor(folder, None, 1, address)
    left = [(batch, needed or {}) for batch in reversed(batches)]
    try:
        outcomes = executor.together(lambda: left.pop() if left else None, Bar())
        return {task.name: outcome for task, outcome in outcomes}
    finally:
        executor.close()


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
        "import sys; from tests.benchmarks.runner import cluster_by_hand; cluster_by_hand.main(*sys.argv[1:])"
    )
    return subprocess.Popen(
        [sys.executable, "-c", program, str(folder), address, str(seconds), str(mark)],
        env=os.environ | {"PYTHONPATH": PATH}, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
