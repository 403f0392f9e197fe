"""Work that may hang or crash: done in a process of its own, which is ended at a deadline.

A solver's own timeout is looked at between its iterations; a loop that never ends, or compiled code that
takes the interpreter down with it, has to be stopped from outside. The process leads a group of its own, so
that what it has started ends with it; and it ends by itself when the parent does, however that went.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from multiprocessing import forkserver
from multiprocessing.connection import Connection, wait
from typing import TYPE_CHECKING, Any

from benchmarks.method import WorkerDied

if TYPE_CHECKING:
    from multiprocessing.context import BaseContext


def one_line(error: BaseException) -> str:
    r"""Return class and message of an error in one line.

    >>> one_line(ValueError("too\nlong"))
    'ValueError: too long'
    """
    return " ".join(f"{type(error).__name__}: {error}".split())


def tell_nobody(progress: float) -> None:
    """Report progress to nobody."""


PATIENCE = 2.0  # [s] for an idle worker to clean up behind itself
# What every worker loads. Nothing that a scene may do without: not torch, not what a body is asked with.
LOADED_BY_ALL = ("h5py", "numba", "scipy.sparse.linalg", "reference_sim", "benchmarks.runner.cells")
# What every task of a scene with a body loads: torch skins the garment.
LOADED_BY_DRESSED = ("benchmarks.scenes.dressed_body", "snug.networks.dressed_body")


def start_loading(*also: str) -> BaseContext:
    """Return the context that worker processes come from: none of them has anything of this one.

    On Linux a server forks them. It loads LOADED_BY_ALL and these modules once, while this process does
    something else. Elsewhere libraries may not outlive a fork, and each process loads its own.
    """
    if sys.platform != "linux":
        return multiprocessing.get_context("spawn")
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload([*LOADED_BY_ALL, *also])
    forkserver.ensure_running()
    return context


class IsolatedProcess:
    """One worker process, started when first needed, and again after it had to be ended.

    begin(*arguments) is called first in each new process. Call `close` at the end.
    """

    def __init__(self, begin: Callable[..., None] | None = None, *arguments: Any) -> None:
        self._begin = (begin, arguments)
        self._context: Any = start_loading()
        self._process: Any = None

    @property
    def alive(self) -> bool:
        """True if the process that was last called is still there."""
        return self._process is not None

    def call(
        self,
        function: Callable[..., Any],
        *arguments: Any,
        seconds: float | None,
        told: Callable[[float], None] = tell_nobody,
    ) -> Any:
        """function(*arguments) in the worker; both sides must be picklable.

        `told` is called here with what the function passes to `tell` there. Raises what the function raises,
        and WorkerDied after `seconds` (None: no deadline) or where the process ended.
        """
        if self._process is None:
            self._start()
        end = None if seconds is None else time.monotonic() + seconds
        try:
            self._pipe.send((function, arguments))
            fine = None
            while fine is None:
                if not self._pipe.poll(None if end is None else max(0.0, end - time.monotonic())):
                    raise WorkerDied(f"no answer within {seconds:g} s", "timeout")
                fine, answer = self._pipe.recv()
                if fine is None:
                    told(answer)
        except (EOFError, ConnectionError):
            self._process.join()
            code = self._process.exitcode
            self._kill()
            raise WorkerDied(*how_it_ended(code)) from None
        except BaseException:
            self._kill()
            raise
        if fine:
            return answer
        raise answer

    def _start(self) -> None:
        self._pipe, far = self._context.Pipe()
        process = self._context.Process(target=_serve, args=(far, *self._begin), daemon=True)
        with far:
            process.start()
        self._process = process

    def close(self) -> None:
        """Let the worker end by itself, for it has nothing to do; then end all that it has started."""
        if self._process is not None:
            self._pipe.close()
            self._process.join(PATIENCE)
            self._kill()

    def stop(self) -> None:
        """Kill it and what it has started, from another thread: a call under way raises WorkerDied."""
        if (process := self._process) is not None:
            end_group(process.pid)
            process.kill()

    def _kill(self) -> None:
        if self._process is not None:
            self.stop()
            self._process.join()
            self._pipe.close()
            self._process = None


def how_it_ended(code: int) -> tuple[str, str]:
    """Reason and status of a process that ended by itself with this exit code.

    Nobody here kills a process that answers in time: a SIGKILL comes from a system that is out of memory.
    """
    if code >= 0:
        return f"the process ended with status {code}", "failed"
    name = signal.Signals(-code).name
    if name == "SIGKILL":
        return "the process was killed by SIGKILL: the system was out of memory", "out-of-memory"
    return f"the process was ended by {name}", "failed"


def end_group(pid: int) -> None:
    """Kill the process group that `pid` led or leads, where the system has groups and this one exists."""
    if hasattr(os, "killpg"):
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(pid, signal.SIGKILL)


def lead_a_group() -> None:
    """Make this process the leader of its group, and end both when the parent is gone.

    The parent alone answers an interrupt; it ends its workers.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if hasattr(os, "setpgrp"):
        os.setpgrp()

    def follow() -> None:
        if (parent := multiprocessing.parent_process()) is not None:
            wait([parent.sentinel])
            end_group(os.getpid())
            os._exit(1)

    threading.Thread(target=follow, name="follow-parent", daemon=True).start()


_pipe: Connection | None = None  # to the one who called this process


def tell(seconds: float) -> None:
    """Report, from a worker, progress in seconds that it was expected to take."""
    if _pipe is not None:
        _pipe.send((None, seconds))


def _serve(pipe: Connection, begin: Callable[..., None] | None, arguments: tuple[Any, ...]) -> None:
    global _pipe
    _pipe = pipe
    lead_a_group()
    if begin is not None:
        begin(*arguments)
    while True:
        try:
            function, arguments = pipe.recv()
        except EOFError:
            return
        try:
            answer = (True, function(*arguments))
        except SystemExit:
            raise
        except Exception as error:
            answer = (False, error)
        except BaseException as error:  # a user's code raised it: interrupts are ignored here
            answer = (False, WorkerDied(one_line(error)))
        sys.stderr.flush()
        pipe.send(answer)
