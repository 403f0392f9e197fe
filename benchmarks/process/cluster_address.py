"""The scheduler of a cluster of dask.distributed that a user has started."""

from __future__ import annotations

import asyncio
import logging

from benchmarks.process.errors import one_line

FIRST = 5.0  # [s] in which a scheduler answers at first


class ClusterError(ValueError):
    """There is no such cluster; the message names it and the remedy."""


def check_scheduler(address: str) -> None:
    """Raise ClusterError unless a scheduler answers; a client of another server would hang."""
    try:
        import distributed  # noqa: F401
    except ImportError:
        raise ClusterError("--scheduler needs dask.distributed: pip install '.[cluster]'") from None
    logging.getLogger("distributed").setLevel(logging.CRITICAL)  # what matters is said in one line
    try:
        kind = asyncio.run(asyncio.wait_for(_kind_of_server(address), FIRST))
    except Exception as error:  # whatever the bytes of another server lead to, a MemoryError too
        kind = one_line(error)
    if kind != "Scheduler":
        raise ClusterError(
            f"--scheduler {address}: no scheduler of dask answers there ({kind}); start one by `dask "
            "scheduler` and give the address that it prints, as tcp://HOST:8786"
        )


async def _kind_of_server(address: str) -> str:
    """Return what a server of dask calls itself, as "Scheduler"."""
    from distributed import Security
    from distributed.core import rpc

    async with rpc(address, connection_args=Security().get_connection_args("client")) as server:
        return str((await server.identity())["type"])
