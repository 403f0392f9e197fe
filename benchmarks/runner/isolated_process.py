"""Work that may hang or crash: in a process of its own, ended at the deadline of a task, if it has one.

A solver looks at its own timeout between iterations; a loop that never ends, or compiled code that takes
the interpreter down, has to be stopped from outside. The process leads a group of its own, so that what
it has started ends with it; it also ends when the parent does.
"""

from __future__ import annotations

import gc
import multiprocessing
import os
import signal
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from multiprocessing import forkserver
from multiprocessing.connection import Connection, wait
from typing import TYPE_CHECKING, Any

from benchmarks.method import WorkerDied
from benchmarks.plan.cell import TaskId
from benchmarks.results.run_folder import RunFolder
from benchmarks.runner.task import Context, Needed, Outcome, RunStopped, Task, failure

if TYPE_CHECKING:
    from multiprocessing.context import BaseContext

    from benchmarks.assets import Assets

# Time for an idle process to clean up behind itself: semaphores, as of progress bars.
PATIENCE = 2.0  # [s]
# [s] for what a process does before its first task: it may compile every kernel
COMPILING = 900.0
# What every process loads: nothing that a scene may do without, as torch.
LOADED_BY_ALL = (
    "h5py", "scipy.sparse.linalg", "reference_sim.kernels.kernel_cache", "benchmarks.runner.cells",
)  # fmt: skip
# What tasks of a scene with a body load: torch skins the garment.
LOADED_BY_DRESSED = ("benchmarks.scenes.dressed_body", "snug.networks.dressed_body")


def start_loading(*also: str) -> BaseContext:
    """Return the context of processes that have nothing of this one.

    On Linux a server forks them. It loads LOADED_BY_ALL and these modules once, while this process does
    something else. Elsewhere libraries may not outlive a fork, and each process loads its own.
    """
    os.environ["TQDM_DISABLE"] = "1"  # read when tqdm is imported: one line for all is enough
    if sys.platform != "linux":
        return multiprocessing.get_context("spawn")
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload([*LOADED_BY_ALL, *also])
    forkserver.ensure_running()
    return context


class TaskProcess:
    """A process that does task after task, started when needed and after one that was ended.

    Call `close` at the end.
    """

    def __init__(self, folder: RunFolder, assets: Assets | None) -> None:
        self._known = folder, assets
        self._context: Any = start_loading()
        self._process: Any = None

    def do(self, task: Task, outcomes: Needed) -> Outcome:
        """Return the task's outcome, however it ends; its memo stays for its batch.

        Raises RunStopped.
        """
        clock = time.perf_counter()
        try:
            outcome = self._call(warm_up, task.warm_up, seconds=COMPILING) if task.warm_up else Outcome()
            if not outcome.failed:
                outcome = self._call(perform, task.batch_id, task.run, outcomes, seconds=task.deadline)
        except Exception as error:
            outcome = failure(error)
        # of a program, ended by its method: what it has started may run on
        if outcome.status == "timeout":
            self.close()
        return outcome if outcome.seconds else replace(outcome, seconds=time.perf_counter() - clock)

    def _call(self, function: Callable[..., Outcome], *arguments: Any, seconds: float | None) -> Outcome:
        """function(context, *arguments) in the process; both sides must be picklable.

        Raises WorkerDied after `seconds` (None: no deadline) or where the process ended, and RunStopped.
        """
        if self._process is None:
            self._start()
        try:
            self._pipe.send((function, arguments))
            if not self._pipe.poll(seconds):
                raise WorkerDied(f"no answer within {seconds:g} s", "timeout")
            answer = self._pipe.recv()
        except (EOFError, ConnectionError):
            self._process.join()
            code = self._process.exitcode
            self._kill()
            raise WorkerDied(*explain_exit(code)) from None
        except BaseException:
            self._kill()
            raise
        if isinstance(answer, RunStopped):
            raise answer
        return answer

    def _start(self) -> None:
        self._pipe, peer = self._context.Pipe()
        process = self._context.Process(target=_serve, args=(peer, *self._known), daemon=True)
        with peer:
            process.start()
        self._process = process

    def stop(self) -> None:
        """Kill it and what it has started, from another thread: its task has failed."""
        if (process := self._process) is not None:
            end_group(process.pid)
            process.kill()

    def close(self) -> None:
        """Let it end by itself, idle as it is; then end all that it has started."""
        if self._process is not None:
            self._pipe.close()
            self._process.join(PATIENCE)
            self._kill()

    def _kill(self) -> None:
        if self._process is not None:
            self.stop()
            self._process.join()
            self._pipe.close()
            self._process = None


def explain_exit(code: int) -> tuple[str, str]:
    """Reason and status of a process that ended by itself with this exit code.

    Nobody here kills a process that answers in time: a SIGKILL is of a system without memory.
    """
    if code == -signal.SIGKILL:
        return "the process was killed by SIGKILL: the system was out of memory", "out-of-memory"
    cause = f"status {code}" if code >= 0 else signal.Signals(-code).name
    return f"the process ended with {cause}", "failed"


def end_group(pid: int) -> None:
    """Kill the process group that `pid` led or leads, where it exists."""
    with suppress(ProcessLookupError, PermissionError):
        os.killpg(pid, signal.SIGKILL)


# --- in the process ---


def _serve(pipe: Connection, folder: RunFolder, assets: Assets | None) -> None:
    lead_a_group()
    gc.freeze()  # to look through all that is loaded takes each collection 0.1 s
    context = Context(folder, assets)
    while True:
        try:
            function, arguments = pipe.recv()
        except EOFError:
            return
        try:
            answer = function(context, *arguments)
        except BaseException as error:  # a user's code may raise any: interrupts are ignored here
            try:
                answer = failure(error)
            except RunStopped as stop:
                answer = stop
        sys.stderr.flush()
        pipe.send(answer)


def lead_a_group() -> None:
    """Make this process the leader of its group, and end both when the parent is gone.

    The parent alone answers an interrupt; it ends its processes.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.setpgrp()

    def follow() -> None:
        if (parent := multiprocessing.parent_process()) is not None:
            wait([parent.sentinel])
            end_group(os.getpid())
            os._exit(1)

    threading.Thread(target=follow, name="follow-parent", daemon=True).start()


def perform(
    context: Context, batch: TaskId, run: Callable[[Context, Needed], Outcome], outcomes: Needed
) -> Outcome:
    """Return the outcome of a task of a batch, with its time."""
    if context.memo and context.batch != batch:
        context.memo.clear()
        gc.collect()  # a simulation refers to itself
    context.batch, clock = batch, time.perf_counter()
    outcome = run(context, outcomes)
    return replace(outcome, seconds=time.perf_counter() - clock)


def warm_up(context: Context, compile_kernels: Callable[[], None]) -> Outcome:
    """Compile what the first task would otherwise compile within its deadline."""
    compile_kernels()
    return Outcome()
