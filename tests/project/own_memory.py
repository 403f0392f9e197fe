"""The memory of a process, as Linux counts it."""

from __future__ import annotations

from pathlib import Path

import pytest

STATUS = Path("/proc/self/status")
needs_proc = pytest.mark.skipif(not STATUS.exists(), reason="memory is read from /proc")


def own_memory() -> int:
    """Its own memory [kB], files that are mapped left out."""
    (line,) = (line for line in STATUS.read_text().splitlines() if line.startswith("RssAnon"))
    return int(line.split()[1])
