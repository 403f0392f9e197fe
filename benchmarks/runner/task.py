"""A task: work that is done once and kept, with its inputs, its needs and its outcome.

Ground truth, trainings, cells and their repeats, metrics, validation and stress cases are all tasks. The
runner alone asks the cache, runs tasks in their processes, keeps outcomes and goes on after a failure.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar

from benchmarks.plan.cell import TaskId
from benchmarks.runner.isolated_process import WorkerDied, one_line

if TYPE_CHECKING:
    from benchmarks.assets import Assets
    from benchmarks.results.row import Row
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
        origin: commit, preset and hardware of it, once the outcome is kept.
        remark: what has changed since, where an outdated outcome is kept all the same.
    """

    status: str = "ok"
    reason: str = ""
    failed: bool = False
    result: Mapping[str, Any] = field(default_factory=dict)
    files: tuple[str, ...] = ()
    digests: Mapping[str, str] = field(default_factory=dict)
    seconds: float = 0.0
    origin: Mapping[str, Any] = field(default_factory=dict)
    remark: str = ""


def tell_nobody(units: float) -> None:
    """Report progress to nobody."""


@dataclass
class Context:
    """State of a process that does tasks.

    Attributes:
        folder: files of the run.
        assets: body, garments and motions; None where no task needs a dressed body.
        tell: reports units of progress.
        memo: kept between the tasks of one batch in this process.
        kept: between all tasks of this process: what every scene asks for again.
    """

    folder: RunFolder
    assets: Assets | None = None
    tell: Callable[[float], None] = tell_nobody
    memo: dict[Any, Any] = field(default_factory=dict)
    kept: dict[Any, Any] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True, eq=False)
class Task:
    """One piece of work.

    Attributes:
        name: unique among the tasks of its kind; part of file names.
        label: for messages.
        inputs: plain values that the outcome depends on.
        code: folders and files whose content the outcome depends on, see benchmarks.provenance.
        needs: tasks without whose success it cannot be run; their outcomes count as inputs.
        reads: tasks whose outcomes it uses where they succeeded; they count as inputs too.
        units: of progress.
        batch: tasks of one batch are handed out together.
        process: a timed task runs alone on the machine, in the process of this name; others, without a
            name, run side by side in any process.
        deadline: [s] after which its process is ended.
    """

    kind: ClassVar[str]
    stage: ClassVar[str]  # title of the stage of a run that it belongs to
    unit_seconds: ClassVar[float] = 1.0  # expected duration of one of its units: for progress and order
    silent: ClassVar[bool] = False  # whether no row of the results speaks of it: a failure is then said apart

    name: str
    label: str
    inputs: Mapping[str, Any]
    code: tuple[str, ...]
    needs: tuple[TaskId, ...] = ()
    reads: tuple[TaskId, ...] = ()
    units: int = 1
    batch: str = ""
    process: str = ""
    deadline: float | None = None

    @property
    def id(self) -> TaskId:
        """Kind and name."""
        return self.kind, self.name

    @property
    def expected_seconds(self) -> float:
        """Expected duration [s], for the progress bar and the order of tasks."""
        return self.units * self.unit_seconds

    @property
    def title(self) -> str:
        """Kind and label, for messages."""
        return f"{self.kind} {self.label}"

    def skip(self, needed: Mapping[TaskId, Outcome]) -> str:
        """Return why there is nothing to do, or empty. Such a task leaves no trace."""
        return ""

    def clear(self, folder: RunFolder) -> None:
        """Remove the files of an earlier run of it, so that nobody takes them for this one's."""

    def assets(self, assets: Assets | None) -> Assets | None:
        """Return the part of the assets that a process of its own needs."""
        return None

    def begin(self, context: Context) -> None:
        """Prepare a timed task before its turn, beside others. run() has to raise again what this raises."""

    def run(self, context: Context, needed: Mapping[TaskId, Outcome]) -> Outcome:
        """Do it and return its outcome; an exception is a failure.

        needed: outcomes of those of `needs` and `reads` that succeeded.
        """
        raise NotImplementedError

    def warm_up(self) -> None:
        """Prepare a process for its first task of this kind and code; the deadline does not count."""

    def rows(self, outcome: Outcome) -> list[Row]:
        """Return the rows of an outcome, skips aside; unit, commit and remark are filled in later."""
        return []


class RunRefused(ValueError):
    """The run cannot begin: its folder is another run's, or there is no such cluster; one line says why."""


class RunStopped(RuntimeError):
    """No task can be done any more, as on a full disk: the run ends, and what is finished is kept.

    The message says why.
    """


def failure(error: BaseException) -> Outcome:
    """Return the outcome of a task that raised, or whose process died.

    torch's allocator on a CPU raises a plain RuntimeError. Raises RunStopped for what no task is at fault of.
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
