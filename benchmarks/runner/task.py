"""A task: work done once and kept, with its inputs, its needs and its outcome."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from benchmarks.method import WorkerDied
from benchmarks.plan.cell import TaskId

if TYPE_CHECKING:
    from benchmarks.assets import Assets
    from benchmarks.results.run_folder import RunFolder


@dataclass(frozen=True)
class Outcome:
    """Outcome of a task.

    Attributes:
        status: as in a result row.
        reason: why, as in a result row.
        failed: whether there is nothing to build upon.
        result: plain values.
        files: names of the files that it has left in the run's folder.
        digests: name -> digest of these files, once the outcome is kept.
        seconds: wall time [s].
        origin: its commit, preset, protocol and hardware, once known to a run.
        content: digest of what other tasks read of it; empty where nothing was kept.
    """

    status: str = "ok"
    reason: str = ""
    failed: bool = False
    result: Mapping[str, Any] = field(default_factory=dict)
    files: tuple[str, ...] = ()
    digests: Mapping[str, str] = field(default_factory=dict)
    seconds: float = 0.0
    origin: dict[str, Any] = field(default_factory=dict)
    content: str = ""

    @property
    def ending(self) -> str:
        """Status and reason, for messages."""
        return f"{self.status}: {self.reason}"

    @property
    def usable(self) -> bool:
        """True if other tasks may build upon it."""
        return not self.failed and self.status != "skipped"


@dataclass
class Context:
    """State of a process that does tasks.

    Attributes:
        folder: files of the run.
        assets: body, garments and motions; None where no task needs a dressed body.
        memo: kept between the tasks of one batch in this process.
        batch: their `Task.batch_id`.
    """

    folder: RunFolder
    assets: Assets | None = None
    memo: dict[Any, Any] = field(default_factory=dict)
    batch: TaskId = ("", "")


Needed = Mapping[TaskId, Outcome]  # usable outcomes of what a task needs or reads


@dataclass(frozen=True, kw_only=True, eq=False)
class Task:
    """One piece of work.

    Attributes:
        kind: of work, as "cell".
        name: unique among the tasks of its kind; part of file names.
        label: for messages.
        stage: title of the stage of a run that it belongs to.
        run: does it, in a process: a module's function, or a partial. An exception is a failure.
        inputs: plain values that the outcome depends on.
        code: folders and files that the outcome depends on, see benchmarks.provenance.
        needs: tasks that must have succeeded; their outcomes count as inputs.
        reads: tasks whose outcomes it uses where they succeeded; these count too.
        skip: why there is nothing to do, or empty. Such a task leaves no trace.
        files: names of the files that it may leave, removed before it is run again.
        work: how much it is among those of its stage: the largest begin first.
        batch: tasks of one batch are handed out together.
        process: a timed task runs alone on the machine, in the process of this name; others, without a
            name, run side by side in any process.
        motion: all of the assets that the process of a timed task needs; empty: none.
        warm_up: compiles kernels in its process before; the deadline does not count.
        deadline: [s] after which its process is ended.
        silent: whether no row speaks of it: a failure is then said apart.
    """

    kind: str
    name: str
    label: str
    stage: str
    run: Callable[[Context, Needed], Outcome]
    inputs: Mapping[str, Any] = field(default_factory=dict)
    code: tuple[str, ...] = ()
    needs: tuple[TaskId, ...] = ()
    reads: tuple[TaskId, ...] = ()
    skip: str = ""
    files: tuple[str, ...] = ()
    work: float = 1.0
    batch: str = ""
    process: str = ""
    motion: str = ""
    warm_up: Callable[[], None] | None = None
    deadline: float | None = None
    silent: bool = False

    @property
    def id(self) -> TaskId:
        """Kind and name."""
        return self.kind, self.name

    @property
    def batch_id(self) -> TaskId:
        """Id of its batch of tasks, which share a process, and its memo."""
        return self.kind if not self.process else "", self.process or self.batch or self.name

    @property
    def title(self) -> str:
        """Kind and label, for messages."""
        return f"{self.kind} {self.label}"


class RunRefused(ValueError):
    """The run cannot begin, as in another run's folder."""


class RunStopped(RuntimeError):
    """No task can be done any more, as on a full disk: the run ends; what is finished is kept.

    The message says why.
    """


def one_line(error: BaseException) -> str:
    r"""Return class and message of an error in one line.

    >>> one_line(ValueError("too\nlong"))
    'ValueError: too long'
    """
    return " ".join(f"{type(error).__name__}: {error}".split())


def failure(error: BaseException) -> Outcome:
    """Return the outcome of a task that raised, or whose process died.

    torch's allocator on a CPU raises a plain RuntimeError. Raises RunStopped where no task is at fault.
    """
    from reference_sim.files.atomic_files import disk_full

    if isinstance(error, RunStopped):
        raise error
    if line := disk_full(error):
        raise RunStopped(line) from None
    if isinstance(error, WorkerDied):
        return Outcome(error.status, str(error), failed=True)
    memory = isinstance(error, MemoryError) or type(error).__name__ == "OutOfMemoryError"
    memory = memory or "DefaultCPUAllocator" in str(error)
    return Outcome("out-of-memory" if memory else "failed", one_line(error), failed=True)
