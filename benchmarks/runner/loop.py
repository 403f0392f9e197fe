"""The loop over tasks: reuse a cached outcome, or run the task in its process and keep its outcome.

Dry run, resume, failures, what an interrupt leaves and exclusive timing are decided here and nowhere else.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping, Sequence, Set
from contextlib import nullcontext
from typing import TYPE_CHECKING

from benchmarks.plan.cell import TaskId
from benchmarks.runner.cache import Cache, Cached
from benchmarks.runner.executor import Batch, Executor
from benchmarks.runner.task import Needed, Outcome, Task, failure

if TYPE_CHECKING:
    from typing import Never

    from tqdm import tqdm

    from benchmarks.runner.run_json import RunLog

BLOCKED = "blocked"  # in the result of a task whose needs had failed
AHEAD = 8  # timed tasks that begin together: each holds its scene in memory until its turn
LEFT_OUT = "not asked for: --only names other states"


class Runner:
    """Runs or reuses tasks, in their order: those that others need come first.

    Attributes:
        outcomes: outcome of every task so far.
        cached: entry of each task that has one.
        reused: titles of those that an earlier run had finished.
    """

    def __init__(self, tasks: Sequence[Task], cache: Cache) -> None:
        self.tasks, self.cache = tuple(tasks), cache
        self.titles = {task.id: task.title for task in self.tasks}
        self.cached: dict[TaskId, Cached] = {}
        self.outcomes: dict[TaskId, Outcome] = {}
        self.reused: list[str] = []

    def refuse(self, kinds: Sequence[str], reason: str) -> None:
        """Let all tasks of these kinds fail, for the same reason; nothing of it is kept."""
        ids = [task.id for task in self.tasks if task.id[0] in kinds]
        self.outcomes |= dict.fromkeys(ids, Outcome("failed", reason, failed=True))

    # --- running -------------------------------------------------------------------------------------------

    def run(self, executor: Executor, log: RunLog | None = None) -> None:
        """Do all tasks: untimed ones side by side until the others wait for timed ones, and these one by one.

        log: follows the stages.
        """
        try:
            while left := [task for task in self.tasks if task.id not in self.outcomes]:
                tasks = _able(left, timed=False) or _able(left, timed=True)
                with log.stage(_titles(tasks)) if log else nullcontext():
                    (self._alone if tasks[0].process else self._side_by_side)(tasks, executor)
        finally:
            executor.close()

    def _side_by_side(self, tasks: Sequence[Task], executor: Executor) -> None:
        """Do tasks, each as soon as its needs have outcomes."""
        for task in tasks:
            if self._is_ready([task]):
                self.decide(task)
        waiting = _batches([task for task in tasks if task.id not in self.outcomes])
        expected = sum(task.seconds for batch in waiting for task in batch)
        with _bar(tasks, expected, executor.side_by_side) as bar:

            def ready() -> Batch | None:
                for batch in list(waiting):
                    if self._is_ready(batch):
                        waiting.remove(batch)
                        if wanted := [task for task in batch if self.decide(task)]:
                            if executor.side_by_side > 1 and len(wanted) > 1 and not waiting:
                                half = (len(wanted) + 1) // 2  # of the last batch: the others would wait
                                waiting.append(wanted[half:])
                                wanted = wanted[:half]
                            for task in wanted:
                                self._clear(task)
                            return wanted, self._needed(*wanted)
                return None

            for task, outcome in executor.together(ready, bar):
                self._keep(task, outcome)
            bar.update(bar.total - bar.n)

    def _is_ready(self, batch: Sequence[Task]) -> bool:
        """Return whether every dependency of the batch has an outcome."""
        ids = (id for task in batch for id in (*task.needs, *task.reads))
        return all(id in self.outcomes or id not in self.titles for id in ids)

    def _alone(self, tasks: Sequence[Task], executor: Executor) -> None:
        """Do timed tasks one by one; the next few begin together, each in its process."""
        begun: set[str] = set()  # processes
        with _bar(tasks, sum(task.seconds for task in tasks), 1) as bar:
            for place, task in enumerate(tasks):
                if self.decide(task):
                    if task.process not in begun:
                        soon = self._soon(tasks[place:], begun)
                        executor.begin([(other, self._needed(other)) for other in soon])
                        begun |= {other.process for other in soon}
                    self._clear(task)
                    self._keep(task, executor.alone(task, self._needed(task)))
                    bar.update(task.seconds)
                else:
                    bar.total -= task.seconds  # no time was spent on it: it says nothing of the rest
                if not any(self._comes(other, task.process) for other in tasks[place + 1 :]):
                    executor.release(task.process)

    def _soon(self, tasks: Sequence[Task], begun: Set[str]) -> list[Task]:
        """Return the next tasks to run whose needs have outcomes, each in another new process."""
        soon: dict[str, Task] = {}
        for task in tasks:
            able = task.process not in begun and all(id in self.outcomes for id in task.needs)
            if len(soon) < AHEAD and task.process not in soon and able and self.decide(task):
                soon[task.process] = task
        return list(soon.values())

    def _comes(self, task: Task, process: str) -> bool:
        """Return whether the task will want that process."""
        if task.process != process:
            return False
        needed = self._needed(task)
        blocked = any(id in self.outcomes and id not in needed for id in task.needs)
        return not blocked and not _skipped(task, needed)

    def _clear(self, task: Task) -> None:
        """Remove the files of an earlier run of a task, so that nobody takes them for this one's."""
        for name in task.files:
            (self.cache.folder.path / name).unlink(missing_ok=True)

    def decide(self, task: Task) -> bool:
        """Return whether the task is to be run now; where not, its outcome is known."""
        if task.id in self.outcomes:
            return False
        outcome, entry = self._verdict(task)
        if outcome is None:
            return True
        self.outcomes[task.id] = outcome
        if outcome is entry.outcome:
            self.cached[task.id] = entry
            self.reused.append(task.title)
        elif outcome.failed:
            self._keep(task, outcome)
        return False

    def _verdict(self, task: Task) -> tuple[Outcome | None, Cached]:
        """Return the outcome of a task without running it, None where it has to run, and its cache entry."""
        needed = self._needed(task)
        if reason := _skipped(task, needed):
            return Outcome("skipped", reason), Cached("missing", wanted=False)
        entry = self.cache.find(task, self.cached)
        missing = next((id for id in task.needs if id not in needed), None)
        if missing is not None and entry.wanted:
            return self._blocked(missing), entry
        freed = missing is None and entry.outcome is not None and BLOCKED in entry.outcome.result
        if entry.wanted or freed:
            return None, entry
        return entry.outcome or Outcome("skipped", LEFT_OUT), entry

    def _blocked(self, missing: TaskId) -> Outcome:
        """Return the outcome of a task that lacks a need. It is done once it has it, whatever --only says."""
        title, other = self.titles.get(missing, " ".join(missing)), self.outcomes.get(missing, Outcome())
        if other.remark:
            return Outcome("skipped", f"not built upon {title}, {other.remark}")
        if other.status == "skipped":
            return Outcome("skipped", f"{title}: {other.reason}")
        reason = f"cannot be run: {title}: {other.ending}"
        return Outcome("failed", reason, failed=True, result={BLOCKED: title})

    def _needed(self, *tasks: Task) -> dict[TaskId, Outcome]:
        """Return the outcomes that the tasks may build upon: successful and up to date."""
        ids = dict.fromkeys(id for task in tasks for id in (*task.needs, *task.reads))
        known = {id: self.outcomes[id] for id in ids if id in self.outcomes}
        return {id: outcome for id, outcome in known.items() if outcome.usable}

    def _keep(self, task: Task, outcome: Outcome) -> None:
        """Write the outcome into the cache; one that cannot be written is a failure."""
        try:
            self.cached[task.id] = self.cache.keep(task, outcome, self.cached)
        except (TypeError, ValueError, OSError) as error:  # a result that is no plain value, a file not there
            outcome = failure(error)
            self.cached[task.id] = self.cache.keep(task, outcome, self.cached)
        self.outcomes[task.id] = self.cached[task.id].outcome or outcome

    # --- without running -----------------------------------------------------------------------------------

    def preview(self) -> Iterator[tuple[Task, Cached, Outcome | None]]:
        """Yield each task, its cache entry, and the outcome that it would have without being run.

        A task that would be run is taken to succeed. Writes nothing.
        """
        for task in self.tasks:
            outcome, entry = self._verdict(task)
            self.outcomes[task.id] = outcome or Outcome()
            self.cached[task.id] = dataclasses.replace(entry, wanted=True) if outcome is None else entry
            yield task, entry, outcome

    def known(self) -> dict[TaskId, Outcome]:
        """Return the outcomes so far, and those up to date in the folder of tasks that were not reached."""
        for task in self.tasks:
            if task.id not in self.outcomes:
                entry = self.cache.find(task, self.cached)
                if entry.state in ("finished", "failed") and entry.outcome is not None:
                    self.cached[task.id], self.outcomes[task.id] = entry, entry.outcome
        return self.outcomes

    def outdated(self) -> dict[str, str]:
        """Return title -> what has changed, of tasks whose outdated outcome is kept."""
        kept = (
            (task.title, self.outcomes[task.id].remark) for task in self.tasks if task.id in self.outcomes
        )
        return {label: remark for label, remark in kept if remark}

    def broken(self) -> Mapping[str, str]:
        """Return title -> how it failed, of tasks that have no row."""
        return {
            task.title: outcome.ending
            for task in self.tasks
            if (outcome := self.outcomes.get(task.id)) and outcome.failed and task.silent
        }


def _able(tasks: Sequence[Task], *, timed: bool) -> list[Task]:
    """Return the tasks that are timed, or are not, and wait for none of the others."""
    others: set[TaskId] = set()
    for task in tasks:
        if bool(task.process) != timed or not others.isdisjoint((*task.needs, *task.reads)):
            others.add(task.id)
    return [task for task in tasks if task.id not in others]


def _skipped(task: Task, needed: Needed) -> str:
    """Return why there is nothing to do for a task, or empty."""
    return task.skip if isinstance(task.skip, str) else task.skip(needed)


def _titles(tasks: Sequence[Task]) -> str:
    return ", ".join(dict.fromkeys(task.stage for task in tasks))


def _batches(tasks: Sequence[Task]) -> list[list[Task]]:
    """Return the tasks handed out together, by stage, the longest first: so workers end at about one time."""
    batches: dict[tuple[str, str], list[Task]] = {}
    for task in tasks:
        batches.setdefault((task.kind, task.batch or task.name), []).append(task)
    stages = list(dict.fromkeys(task.stage for task in tasks))
    return sorted(
        batches.values(),
        key=lambda batch: (stages.index(batch[0].stage), -sum(task.seconds for task in batch)),
    )


def _bar(tasks: Sequence[Task], total: float, workers: int) -> tqdm[Never]:
    from reference_sim.command_line import progress_bar

    shown = "{desc}: {percentage:3.0f}%|{bar}| {elapsed}<{remaining}"
    return progress_bar(total=total, desc=_titles(tasks), bar_format=shown, expected_rate=workers)
