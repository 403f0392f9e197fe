"""Tasks that write files or go wrong, and processes that do them."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks.method import WorkerDied
from benchmarks.results.run_folder import RunFolder
from benchmarks.runner.cache import Cache
from benchmarks.runner.executor import Executor
from benchmarks.runner.loop import Runner
from benchmarks.runner.task import Context, Outcome, Task

# --- tasks ---


def fail(how: str) -> None:
    """Let the process that does a task go wrong."""
    if how == "raise":
        raise ValueError("broken on\npurpose")
    if how == "die":
        os.kill(os.getpid(), signal.SIGKILL)
    if how == "hang":
        signal.pause()
    if how == "torch":
        raise RuntimeError("DefaultCPUAllocator: can't allocate memory")
    if how == "leave":
        child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"])
        raise WorkerDied(str(child.pid), "timeout")
    if how == "interrupt":
        raise KeyboardInterrupt


def write(name: str, how: str, sleep: float, context: Context, needed) -> Outcome:
    """Write a file of what is needed and of the task's name, unless `how` says what to do instead.

    With a time to sleep [s], "begun" beside the run's folder says which processes began.
    """
    if sleep:
        with (context.folder.path.parent / "begun").open("a") as file:
            file.write(f"{os.getpid()}\n")
    fail(how)
    time.sleep(sleep)
    context.memo.setdefault("done", []).append(name)
    path = context.folder.path / f"{name}.txt"
    earlier = (context.folder.path / outcome.files[0] for outcome in needed.values())
    path.write_text("".join(file.read_text() for file in earlier) + name)
    files = ("nowhere.txt",) if how == "nowhere" else (path.name,)
    result = {"memo": list(context.memo["done"])} | ({"x": np.float32(1)} if how == "float32" else {})
    return Outcome(result=result, files=files)


def no_room() -> None:
    raise MemoryError("no room to compile")


def task(name: str, how: str = "", sleep: float = 0.0, **ties) -> Task:
    """A task, by default without a row; how: what goes wrong, which is no part of what it is known by."""
    return Task(
        kind="network", name=name, label=name, stage="writing", run=partial(write, name, how, sleep),
        silent=True, inputs={"value": 0}, code=("benchmarks/results",),
        warm_up=no_room if how == "cold" else None, deadline=0.5 if how == "hang" else None, **ties,
    )  # fmt: skip


def ids(*names: str) -> tuple[tuple[str, str], ...]:
    return tuple(("network", name) for name in names)


def chain(sleep: float = 0.0) -> list[Task]:
    """Twelve tasks in three rounds, the later ones made from the earlier ones, the last two one batch."""
    return [
        *(task(str(n), sleep=sleep) for n in range(6)),
        *(task(str(n), sleep=sleep, needs=ids(str(n - 6), "0")) for n in range(6, 10)),
        *(task(str(n), sleep=sleep, needs=ids("6"), batch="b") for n in (10, 11)),
    ]


# --- what does them ---


def executor(folder: Path, workers: int = 1) -> Executor:
    folder.mkdir(exist_ok=True)
    return Executor(RunFolder(folder), None, workers)


def finish(folder: Path, *tasks: Task, workers: int = 1, **options) -> Runner:
    """The tasks, run or reused."""
    RunFolder(folder).remove_parts()
    runner = Runner(tasks, Cache(RunFolder(folder), **options))
    runner.run(executor(folder, workers))
    return runner


def together(folder: Path, *batches: list[Task]) -> dict[str, Outcome]:
    left, doing = [(batch, {}) for batch in reversed(batches)], executor(folder)
    try:
        return {
            task.name: outcome for task, outcome in doing.together(lambda: left.pop() if left else None)
        }
    finally:
        doing.close()


def until(true, seconds: float = 60.0) -> None:
    deadline = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < deadline
        time.sleep(0.02)


def alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False
