"""A task: what is done once and kept. Its inputs, what it needs, how it runs, and what comes of it.

Ground truth, trainings, cells and their repeats, metrics, validation and stress cases are all tasks. The
runner alone asks the cache, runs tasks in their processes, keeps outcomes and goes on after a failure.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar

from benchmarks.cell import TaskId
from benchmarks.process.errors import one_line
from benchmarks.process.isolated_process import WorkerDied

if TYPE_CHECKING:
    from benchmarks.assets.assets import Assets
    from benchmarks.results.row import Row
    from benchmarks.results.run_folder import RunFolder


@dataclass(frozen=True)
class Outcome:
    """What came of a task.

    status and reason: in the words of a result row. failed: whether there is nothing to build upon. result:
    plain values. files: what it has left, by their names in the run's folder; digests: of these, by name,
    once it is kept. seconds: wall time. origin: commit, preset and hardware of it, once it is kept.
    remark: what has changed since, where it is kept all the same.
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
    """Where no one follows the progress."""


@dataclass
class Context:
    """What a process knows. memo: kept between tasks of this process. tell: reports units of progress."""

    folder: RunFolder
    assets: Assets | None = None
    tell: Callable[[float], None] = tell_nobody
    memo: dict[Any, Any] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True, eq=False)
class Task:
    """One piece of work.

    inputs: plain values that the outcome depends on. modules: those whose source, with all that they import,
    it depends on. needs: tasks without whose success it cannot be run; reads: those that it uses where they
    succeeded. Their outcomes count as inputs. units: of progress. batch: tasks of one batch are handed out
    together. process: a timed task runs alone on the machine, in the process of this name; others run side by
    side in any. deadline: [s] after which its process is ended.
    """

    kind: ClassVar[str]
    stage: ClassVar[str]  # title of what it belongs to
    unit_seconds: ClassVar[float] = 1.0  # that one of its units takes, roughly: for progress and order
    silent: ClassVar[bool] = False  # whether no row of the results speaks of it: a failure is then said apart

    name: str
    label: str
    inputs: Mapping[str, Any]
    modules: tuple[str, ...]
    needs: tuple[TaskId, ...] = ()
    reads: tuple[TaskId, ...] = ()
    units: int = 1
    batch: str = ""
    process: str = ""
    deadline: float | None = None

    @property
    def id(self) -> TaskId:
        return self.kind, self.name

    @property
    def expected_seconds(self) -> float:
        """That it takes, roughly."""
        return self.units * self.unit_seconds

    @property
    def title(self) -> str:
        return f"{self.kind} {self.label}"

    def skip(self, needed: Mapping[TaskId, Outcome]) -> str:
        """Why there is nothing to do, or empty. Such a task leaves no trace."""
        return ""

    def clear(self, folder: RunFolder) -> None:
        """Remove what an earlier run of it has left, so that nobody takes it for this one's."""

    def assets(self, assets: Assets | None) -> Assets | None:
        """What of the assets its own process needs."""
        return None

    def begin(self, context: Context) -> None:
        """What a timed task does before its turn, beside others. What it raises, run() has to raise again."""

    def run(self, context: Context, needed: Mapping[TaskId, Outcome]) -> Outcome:
        """Do it. needed: the outcomes of `needs` and `reads` that are there. What is raised is a failure."""
        raise NotImplementedError

    def warm_up(self) -> None:
        """What a process does before its first task of this kind and module, without the deadline."""

    def rows(self, outcome: Outcome) -> list[Row]:
        """The rows of what came of it, skips aside; unit, commit and remark are filled in later."""
        return []


class RunStopped(RuntimeError):
    """No task can be done any more, as on a full disk: the run ends, and what is finished is kept.

    The message says why.
    """


def failure(error: BaseException) -> Outcome:
    """The outcome of a task that raised, or whose process died. torch's allocator on a CPU raises a plain
    RuntimeError. Raises RunStopped for what is no fault of the task.
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
