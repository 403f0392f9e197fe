"""Trial of a file in a process of its own, under a cap of memory and time.

HDF5 and VTK follow what a file says: a tree of links or of chunks that comes back to itself crashes HDF5, or
keeps it going for ever, and a wrong count crashes VTK. So a file that somebody else made, or that a disk has
damaged, is first read where that harms nobody.
"""

from __future__ import annotations

import math
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress
from importlib import import_module
from pathlib import Path

MEMORY = 2 << 30  # [bytes] of the trial, and FILES times the file
FILES = 20
SECONDS = 20.0  # of CPU time of the trial, and those of reading at SPEED
PATIENCE = 6.0  # times as many by the clock: on a busy machine a file is as good as on an idle one
SPEED = 5e6  # [bytes/s] of the file
NO_TRIAL = (1, 2)  # exit statuses of Python where it finds no such module: nothing is known then
ENDLESS = -getattr(signal, "SIGXCPU", 256)  # exit status where CPU time was at its end; none on Windows
REFUSED = 3  # exit status of a trial that has said why


def try_out(read: Callable[[Path], object], *paths: Path) -> str:
    """Return why a function cannot read one of the files, in one line; empty where it can read all.

    Args:
        read: a function of a module, which the process imports by its name.
        paths: files that exist.
    """
    size = sum(path.stat().st_size for path in paths)
    memory, seconds = MEMORY + FILES * size, math.ceil(SECONDS + size / SPEED)
    # Each thread of a linear algebra library takes addresses for itself: on many cores more than the cap.
    alone = {name: "1" for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")}
    caps, names = (str(memory), str(seconds)), (str(path.absolute()) for path in paths)
    arguments = [read.__module__, read.__name__, *caps, *names]
    try:
        done = subprocess.run(
            [sys.executable, "-m", __name__, *arguments],
            env=os.environ | alone, stdin=subprocess.DEVNULL, capture_output=True, timeout=PATIENCE * seconds,
        )  # fmt: skip
        endless = done.returncode == ENDLESS
    except subprocess.TimeoutExpired:
        endless = True
    if endless:
        return f"reading it does not end within {seconds} s"
    if done.returncode == REFUSED:
        return " ".join(done.stdout.decode(errors="replace").split())[:300]
    if done.returncode in (0, *NO_TRIAL):
        return ""
    return f"reading it crashes the reader, or takes more than {memory / 1e9:.0f} GB"


def main(module: str, name: str, memory: str, seconds: str, *paths: str) -> int:
    """Read the files by that function under caps of memory [bytes] and CPU time [s]; return a status."""
    read = getattr(import_module(module), name)
    _cap(int(memory), int(seconds))
    try:
        for path in paths:
            read(Path(path))
    except Exception as error:  # whatever it is, the file is to blame
        print(error or type(error).__name__)
        return REFUSED
    return 0


def _cap(memory: int, seconds: int) -> None:
    with suppress(ImportError):  # on Windows, where time by the clock alone is capped
        import resource

        for what, most in ((resource.RLIMIT_AS, memory), (resource.RLIMIT_CPU, seconds)):
            _, hard = resource.getrlimit(what)
            soft = most if hard == resource.RLIM_INFINITY else min(most, hard)
            resource.setrlimit(what, (soft, hard))


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
