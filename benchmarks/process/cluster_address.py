"""The scheduler of a cluster of dask.distributed that a user has started."""

from __future__ import annotations

import asyncio
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
    check_scheduler(address)
    from distributed import Client

    return Client(address, timeout=seconds, name="benchmarks.run", set_as_default=False)


def check_scheduler(address: str) -> None:
    """Raise ClusterError unless a scheduler answers; a client of another server would hang."""
    try:
        import distributed  # noqa: F401
    except ImportError:
        raise ClusterError("--scheduler needs dask.distributed: pip install '.[cluster]'") from None
    logging.getLogger("distributed").setLevel(logging.CRITICAL)  # what matters is said in one line
    try:
        kind = asyncio.run(asyncio.wait_for(_kind_of_server(address), FIRST))
    except TimeoutError:
        problem = f"no answer of a scheduler within {FIRST:g} s"
    except MemoryError:  # the first bytes of another protocol, taken for the length of a message
        problem = "what answers there is no scheduler"
    except Exception as error:  # whatever the bytes of another server lead to
        problem = one_line(error)
    else:
        if kind == "Scheduler":
            return
        problem = f"is a {kind.lower()} of dask"
    remedy = "start a scheduler by `dask scheduler` and give the address that it prints, as tcp://HOST:8786"
    raise ClusterError(f"--scheduler {address}: {problem}; {remedy}")


async def _kind_of_server(address: str) -> str:
    """Return what a server of dask calls itself, as "Scheduler"."""
    from distributed import Security
    from distributed.core import rpc

    async with rpc(address, connection_args=Security().get_connection_args("client")) as server:
        return str((await server.identity())["type"])
