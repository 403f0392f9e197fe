"""The scheduler of a cluster of dask.distributed that a user has started."""

from __future__ import annotations

import logging
from typing import TYPE_CHECKING

from benchmarks.process.errors import one_line

if TYPE_CHECKING:
    from distributed import Client

FIRST = 5.0  # [s] in which a scheduler answers at first


class ClusterError(ValueError):
    """There is no such cluster; the message names it and the remedy."""


def connect(address: str, *, seconds: float) -> Client:
    """Return a client of the scheduler, which looks for a lost one for so long. Raises ClusterError."""
    try:
        from distributed import Client
    except ImportError:
        raise ClusterError("--scheduler needs dask.distributed: pip install '.[cluster]'") from None
    logging.getLogger("distributed").setLevel(logging.CRITICAL)  # what matters is said in one line
    try:
        return Client(address, timeout=seconds, name="benchmarks.run", set_as_default=False)
    except (OSError, ValueError) as error:
        remedy = "start one by `dask scheduler` and give the address that it prints, as tcp://HOST:8786"
        raise ClusterError(f"--scheduler {address}: {one_line(error)}; {remedy}") from None


def check_scheduler(address: str) -> None:
    """Raise ClusterError unless a scheduler answers."""
    connect(address, seconds=FIRST).close()
