"""Memory of a process: its peak, and giving back what is free."""

from __future__ import annotations

import ctypes
import gc
import sys
from pathlib import Path


def peak_memory() -> float:
    """Return the most memory that this process has held at once [MB].

    Linux keeps it per memory image; ru_maxrss there would still hold what the parent had before this process
    loaded its own program.
    """
    import resource

    try:
        for line in Path("/proc/self/status").read_text(encoding="ascii").splitlines():
            if line.startswith("VmHWM:"):
                return float(line.split()[1]) * 1024 / 1e6
    except OSError:
        pass  # not Linux
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak * (1 if sys.platform == "darwin" else 1024) / 1e6


def give_back() -> None:
    """Free unused memory, and let the C library return it to the system, where it keeps it (glibc).

    A simulation refers to itself: it stays until Python looks for such circles.
    """
    gc.collect()
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None) if sys.platform == "linux" else None
    if trim is not None:
        trim(0)
