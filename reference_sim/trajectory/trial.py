"""Trial of a trajectory file in a process of its own, under a cap of memory and time.

HDF5 follows what a file says: a tree of links or of chunks that comes back to itself crashes it, or keeps it
going for ever. So a file that somebody else made, or that a disk has damaged, is first read where that harms
nobody.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress
from importlib import import_module
from pathlib import Path

MEMORY = 2 << 30  # [bytes] of the trial, and FILES times the file
FILES = 20
SECONDS = 20.0  # of the trial, and those of reading at SPEED
SPEED = 5e6  # [bytes/s] of the file
NO_TRIAL = (1, 2)  # exit statuses of Python where it finds no such module: nothing is known then
REFUSED = 3  # exit status of a trial that has said why


def try_out(path: Path, read: Callable[[Path], object]) -> str:
    """Return why a function cannot read the file, in one line; empty where it can.

    Args:
        path: a file that exists.
        read: a function of a module, which the process imports by its name.
    """
    size = path.stat().st_size
    memory, seconds = MEMORY + FILES * size, SECONDS + size / SPEED
    # Each thread of a linear algebra library takes addresses for itself: on many cores more than the cap.
    alone = {name: "1" for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")}
    words = [read.__module__, read.__name__, str(path.absolute()), str(memory)]
    try:
        done = subprocess.run(
            [sys.executable, "-m", __name__, *words],
            env=os.environ | alone, stdin=subprocess.DEVNULL, capture_output=True, timeout=seconds,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return f"reading it does not end within {seconds:.0f} s"
    if done.returncode == REFUSED:
        return " ".join(done.stdout.decode(errors="replace").split())[:300]
    if done.returncode in (0, *NO_TRIAL):
        return ""
    return f"reading it crashes HDF5, or takes more than {memory / 1e9:.0f} GB"


def main(module: str, name: str, path: str, memory: int) -> int:
    """Read the file by that function under a cap of memory [bytes]; return the exit status."""
    read = getattr(import_module(module), name)
    _cap(memory)
    try:
        read(Path(path))
    except Exception as error:  # whatever it is, the file is to blame
        print(error or type(error).__name__)
        return REFUSED
    return 0


def _cap(memory: int) -> None:
    with suppress(ImportError):  # on Windows, where time alone is capped
        import resource

        _, hard = resource.getrlimit(resource.RLIMIT_AS)
        soft = memory if hard == resource.RLIM_INFINITY else min(memory, hard)
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], sys.argv[2], sys.argv[3], int(sys.argv[4])))
