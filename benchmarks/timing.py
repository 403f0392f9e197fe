"""The one clock: monotonic, stopped only when every position is there and nothing works on.

What it counts is `run()` and the touching of every frame. Loading, compiling, warming up, metrics and
writing are outside: a first run in which numba compiled a kernel is no measurement. Short work is done
again until enough time is measured. A method that comes back before its work is done is found out: its
positions still change, its process still computes, it has used more processor than one thread can, or it
gives again what it had kept.
"""

from __future__ import annotations

import gc
import multiprocessing
import os
import sys
import threading
import time
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    import numpy as np

# [s] for which the process is watched once the clock has stopped, and again where it is at work
AFTER = 0.02
# Times in a row; a machine that is busy elsewhere lends its time to one of them, not to all.
WATCHES = 3
BUSY = 0.3  # share of AFTER which the processor may be at work
# Processor seconds per second on the clock, beyond which more than one thread has worked.
CROWDED = 1.3
GRAIN = 0.05  # [s] below which processor time is too coarse to be compared
MOST = 1000  # runs, of what takes no time


@dataclass(frozen=True)
class Reading:
    """Measured time: [s] of each of its `runs`, and a `complaint` where they cannot be believed."""

    runs: tuple[float, ...]
    complaint: str = ""

    @property
    def seconds(self) -> float:
        """The median run."""
        return median(self.runs)


THREADS = ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS")

Made = TypeVar("Made")


def one_thread() -> None:
    """One thread for everything, whatever the shell says; to be called before any library reads it.

    So times are comparable, every row can state it, and two workers do not fight over two cores.
    """
    for name in THREADS:
        os.environ[name] = "1"


def time_run(
    run: Callable[[], Made], *, read: Callable[[Made], np.ndarray], min_time: float = 0.0
) -> tuple[Made, Reading]:
    """Return the result of run(), and the time until all positions `read` from it are there.

    run() is called again, MOST times at most, until `min_time` [s] is measured.
    """
    import numpy as np

    gc.collect()  # what preparing has left is not charged to the run
    before = set(threading.enumerate())
    children = set(multiprocessing.active_children())
    cpu_time, runs, last = 0.0, [], None
    while True:
        with _compilations() as compiled:
            _synchronise()
            busy, clock = time.process_time(), time.perf_counter()
            result = run()
            np.add.reduce(np.asarray(read(result)), axis=None)  # computes what waits to be looked at
            _synchronise()
            seconds, busy = time.perf_counter() - clock, time.process_time() - busy
        if compiled and last is None:  # in the first run, which is not counted
            last = result
            continue
        runs.append(seconds)
        cpu_time += busy
        if last is not None and np.may_share_memory(np.asarray(read(last)), np.asarray(read(result))):
            fault = "run() gave again what it had given before: each call of run() has to do all of the "
            return result, Reading(tuple(runs), fault + "work, and to return an array of its own")
        if sum(runs) >= min_time or len(runs) == MOST:
            break
        last = result  # held beyond the next run, so that what is new lies elsewhere
    seconds = sum(runs)
    if cpu_time > CROWDED * seconds + GRAIN:
        crowd = f"{cpu_time:.2f} s of processor time in {seconds:.2f} s: more than one thread has "
        crowd += "worked: leave the number of threads alone: one is set, see OMP_NUM_THREADS"
        return result, Reading(tuple(runs), crowd)
    late = _watch_process(read(result), before, children)
    late += ": wait in run() for all threads, processes and devices; leave none behind" if late else ""
    return result, Reading(tuple(runs), late)


@contextmanager
def _compilations() -> Iterator[list[object]]:
    """Yield a list of what numba compiles meanwhile; a kernel that it finds on disk is not in it."""
    if "numba" not in sys.modules:
        yield []
        return
    from numba.core.event import install_recorder

    with install_recorder("numba:compile") as recorder:
        yield recorder.buffer


def _watch_process(
    positions: np.ndarray,
    threads: set[threading.Thread],
    children: set[multiprocessing.process.BaseProcess],
) -> str:
    """Watch the process for a moment: what does it do after it said that it was done?"""
    import numpy as np

    crc = zlib.crc32(np.asarray(positions).tobytes())
    for _ in range(WATCHES):
        start, clock = time.process_time(), time.perf_counter()
        time.sleep(AFTER)
        busy = (time.process_time() - start) / (time.perf_counter() - clock)
        if zlib.crc32(np.asarray(positions).tobytes()) != crc:
            return "positions still changed after run() had come back"
        if busy <= BUSY:
            break
    if busy > BUSY:
        return f"the process was still at work ({100 * busy:.0f} %) after run() had come back"
    # The progress bar keeps a thread that sleeps; it moves no vertex.
    names = [t.name for t in set(threading.enumerate()) - threads if type(t).__name__ != "TMonitor"]
    names += [child.name for child in set(multiprocessing.active_children()) - children]
    return f"{names[0]} was still running after run() had come back" if names else ""


def _synchronise() -> None:
    """Wait for the accelerator, where this process has begun to use one."""
    torch = sys.modules.get("torch")
    if torch is not None and torch.cuda.is_initialized():
        torch.cuda.synchronize()


def peak_memory() -> float:
    """Return the most memory that this process has held at once [MB].

    Linux keeps it per memory image; ru_maxrss there would still hold what the parent had before this
    process loaded its own program.
    """
    import resource

    with suppress(OSError):  # not Linux
        for line in Path("/proc/self/status").read_text(encoding="ascii").splitlines():
            if line.startswith("VmHWM:"):
                return float(line.split()[1]) * 1024 / 1e6
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak * (1 if sys.platform == "darwin" else 1024) / 1e6
