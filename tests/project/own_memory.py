"""The memory of a process, as Linux counts it."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

needs_proc = pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="memory is read from /proc")


def own_memory(pid: int | str = "self") -> int:
    """Its own memory [kB], files that are mapped left out; 0 of a process that has ended."""
    try:
        lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    except OSError:
        return 0
    return next((int(line.split()[1]) for line in lines if line.startswith("RssAnon")), 0)


def children(pid: int) -> list[int]:
    """Processes that its threads have started."""
    pids: list[int] = []
    for thread in Path(f"/proc/{pid}/task").glob("*/children"):
        with suppress(OSError):  # it has just ended
            pids += map(int, thread.read_text().split())
    return pids


def slope(samples: Sequence[tuple[float, float]]) -> tuple[float, float]:
    """Return the slope of the least-squares line and its standard error, taking samples as independent."""
    x, y = np.array(samples, float).T
    (growth, _), covariance = np.polyfit(x, y, 1, cov=True)
    return float(growth), float(np.sqrt(covariance[0, 0]))
