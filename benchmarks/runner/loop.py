"""The one loop: is a task cached? run it in its process, keep what came of it, go on.

Dry run, resume, failures, what an interrupt leaves and exclusive timing are decided here and nowhere else.
"""

from __future__ import annotations

import dataclasses
from collections import deque
from collections.abc import Iterator, Mapping, Sequence, Set
from contextlib import AbstractContextManager, nullcontext
from itertools import groupby
from typing import Any, Protocol

from benchmarks.cell import TaskId
from benchmarks.runner.cache import Cache, Found
from benchmarks.runner.local_executor import Batch, Executor
from benchmarks.tasks.task import Outcome, Task, failure

BLOCKED = "blocked"  # in the result of a task whose needs had failed
AHEAD = 8  # timed tasks that begin together: each holds its scene in memory until its turn
LEFT_OUT = "not asked for: --only names other states"


class Log(Protocol):
    """What is told of stages."""

    def stage(self, name: str) -> AbstractContextManager[None]:
        """Around all tasks of a stage."""


class NoLog:
    """Where nobody follows the stages."""

    def stage(self, name: str) -> AbstractContextManager[None]:
        return nullcontext()


class Runner:
    """Runs or reuses tasks, in their order: those that others need come first.

    outcomes: of every task so far. reused: titles of those that an earlier run had finished.
    """

    def __init__(self, tasks: Sequence[Task], cache: Cache) -> None:
        self.tasks, self.cache = tuple(tasks), cache
        self.titles = {task.id: task.title for task in self.tasks}
        self.found: dict[TaskId, Found] = {}
        self.outcomes: dict[TaskId, Outcome] = {}
        self.reused: list[str] = []

    def refuse(self, kinds: Sequence[str], reason: str) -> None:
        """Let all tasks of these kinds fail, for the same reason; nothing of it is kept."""
        ids = [task.id for task in self.tasks if task.id[0] in kinds]
        self.outcomes |= dict.fromkeys(ids, Outcome("failed", reason, failed=True))

    # --- running -------------------------------------------------------------------------------------------

    def run(self, executor: Executor, log: Log) -> None:
        """All tasks: the timed ones one by one, the others side by side before, between and after them."""
        left = self.tasks
        try:
            while left:
                _, group = next(groupby(left, key=lambda task: task.stage if task.process else ""))
                due = tuple(group)
                with log.stage(_titles(due)):
                    if due[0].process:
                        self._alone(due, executor)
                    else:
                        later = [task for task in left[len(due) :] if not task.process]
                        self._side_by_side(due, later, executor)
                left = tuple(task for task in left if task.id not in self.outcomes)
        finally:
            executor.close()

    def _side_by_side(self, due: Sequence[Task], later: Sequence[Task], executor: Executor) -> None:
        """Those due, each as soon as what it needs is there; a worker that would wait begins later ones."""
        for task in due:
            if self._is_ready([task]):
                self.decide(task)
        with _bar(due, sum(task.expected_seconds for task in due if task.id not in self.outcomes)) as bar:
            waiting, left = [*_batches(due), *_batches(later)], deque(due)

            def ready() -> Batch | None:
                while left and left[0].id in self.outcomes:
                    left.popleft()
                if not left:
                    return None
                for batch in list(waiting):
                    if self._is_ready(batch):
                        waiting.remove(batch)
                        if wanted := [task for task in batch if self.decide(task)]:
                            if wanted[0] not in due:
                                bar.total += sum(task.expected_seconds for task in wanted)
                            for task in wanted:
                                task.clear(self.cache.folder)
                            return wanted, self._needed(*wanted)
                return None

            for task, outcome in executor.together(ready, bar):
                self._keep(task, outcome)
            bar.update(bar.total - bar.n)

    def _is_ready(self, batch: Sequence[Task]) -> bool:
        """Whether what became of all that the tasks build upon is known."""
        ids = (id for task in batch for id in (*task.needs, *task.reads))
        return all(id in self.outcomes or id not in self.titles for id in ids)

    def _alone(self, tasks: Sequence[Task], executor: Executor) -> None:
        begun: set[str] = set()  # processes
        with _bar(tasks, len(tasks)) as bar:
            for place, task in enumerate(tasks):
                if self.decide(task):
                    if task.process not in begun:
                        soon = self._soon(tasks[place:], begun)
                        executor.begin([(other, self._needed(other)) for other in soon])
                        begun |= {other.process for other in soon}
                    task.clear(self.cache.folder)
                    self._keep(task, executor.alone(task, self._needed(task)))
                if not any(self._comes(other, task.process) for other in tasks[place + 1 :]):
                    executor.release(task.process)
                bar.update()

    def _soon(self, tasks: Sequence[Task], begun: Set[str]) -> list[Task]:
        """The next that are to be run and need nothing that is not there, each in another new process."""
        soon: dict[str, Task] = {}
        for task in tasks:
            there = task.process not in begun and all(id in self.outcomes for id in task.needs)
            if len(soon) < AHEAD and task.process not in soon and there and self.decide(task):
                soon[task.process] = task
        return list(soon.values())

    def _comes(self, task: Task, process: str) -> bool:
        """Whether the task will want that process."""
        if task.process != process:
            return False
        blocked = any(id in self.outcomes and id not in self._needed(task) for id in task.needs)
        return not blocked and not task.skip(self._needed(task))

    def decide(self, task: Task) -> bool:
        """Whether the task is to be run now; where not, its outcome is known."""
        if task.id in self.outcomes:
            return False
        outcome, found = self._verdict(task)
        if outcome is None:
            return True
        self.outcomes[task.id] = outcome
        if outcome is found.outcome:
            self.found[task.id] = found
            self.reused.append(task.title)
        elif outcome.failed:
            self._keep(task, outcome)
        return False

    def _verdict(self, task: Task) -> tuple[Outcome | None, Found]:
        """The outcome that it has without being run, None where it is to be run; what the folder holds."""
        needed = self._needed(task)
        if reason := task.skip(needed):
            return Outcome("skipped", reason), Found("missing", wanted=False)
        found = self.cache.find(task, self.found)
        lacking = next((id for id in task.needs if id not in needed), None)
        if lacking is not None and found.wanted:
            return self._blocked(lacking), found
        freed = lacking is None and found.outcome is not None and BLOCKED in found.outcome.result
        if found.wanted or freed:
            return None, found
        return found.outcome or Outcome("skipped", LEFT_OUT), found

    def _blocked(self, lacking: TaskId) -> Outcome:
        """Of a task that cannot be run. It is done as soon as nothing blocks it, whatever --only says."""
        title, other = self.titles.get(lacking, " ".join(lacking)), self.outcomes.get(lacking, Outcome())
        if other.remark:
            return Outcome("skipped", f"not built upon {title}, {other.remark}")
        if other.status == "skipped":
            return Outcome("skipped", f"{title}: {other.reason}")
        reason = f"cannot be run: {title}: {other.status}: {other.reason}"
        return Outcome("failed", reason, failed=True, result={BLOCKED: title})

    def _needed(self, *tasks: Task) -> dict[TaskId, Outcome]:
        """What the tasks may build upon: it is there, and up to date."""
        ids = dict.fromkeys(id for task in tasks for id in (*task.needs, *task.reads))
        known = {id: self.outcomes[id] for id in ids if id in self.outcomes}
        return {id: o for id, o in known.items() if not (o.failed or o.remark or o.status == "skipped")}

    def _keep(self, task: Task, outcome: Outcome) -> None:
        try:
            self.found[task.id] = self.cache.keep(task, outcome, self.found)
        except (TypeError, ValueError, OSError) as error:  # a result that is no plain value, a file not there
            outcome = failure(error)
            self.found[task.id] = self.cache.keep(task, outcome, self.found)
        self.outcomes[task.id] = self.found[task.id].outcome or outcome

    # --- without running -----------------------------------------------------------------------------------

    def preview(self) -> Iterator[tuple[Task, Found, Outcome | None]]:
        """Of each task what the folder holds of it, and the outcome that it would have without being run.

        What would be run is taken to succeed. Writes nothing.
        """
        for task in self.tasks:
            outcome, found = self._verdict(task)
            self.outcomes[task.id] = outcome or Outcome()
            self.found[task.id] = dataclasses.replace(found, wanted=True) if outcome is None else found
            yield task, found, outcome

    def known(self) -> dict[TaskId, Outcome]:
        """The outcomes so far, and of tasks that were not reached those that the folder holds up to date."""
        for task in self.tasks:
            if task.id not in self.outcomes:
                found = self.cache.find(task, self.found)
                if found.state in ("finished", "failed") and found.outcome is not None:
                    self.found[task.id], self.outcomes[task.id] = found, found.outcome
        return self.outcomes

    def outdated(self) -> dict[str, str]:
        """Title -> what has changed, of tasks whose outcome is kept though it is out of date."""
        kept = (
            (task.title, self.outcomes[task.id].remark) for task in self.tasks if task.id in self.outcomes
        )
        return {label: remark for label, remark in kept if remark}

    def broken(self) -> Mapping[str, str]:
        """Title -> how it failed, of tasks of which no row speaks."""
        return {
            task.title: f"{outcome.status}: {outcome.reason}"
            for task in self.tasks
            if (outcome := self.outcomes.get(task.id)) and outcome.failed and task.silent
        }


def _titles(tasks: Sequence[Task]) -> str:
    return ", ".join(dict.fromkeys(task.stage for task in tasks))


def _batches(tasks: Sequence[Task]) -> list[list[Task]]:
    """What is handed out together: stage by stage, the longest first, so that workers end at about the same
    time.
    """
    found: dict[tuple[str, str], list[Task]] = {}
    for task in tasks:
        found.setdefault((task.kind, task.batch or task.name), []).append(task)
    stages = list(dict.fromkeys(task.stage for task in tasks))
    return sorted(
        found.values(),
        key=lambda batch: (stages.index(batch[0].stage), -sum(task.expected_seconds for task in batch)),
    )


def _bar(tasks: Sequence[Task], total: float) -> Any:
    from reference_sim.progress import progress_bar

    shown = "{desc}: {percentage:3.0f}%|{bar}| {elapsed}<{remaining}"
    return progress_bar(total=total, desc=_titles(tasks), bar_format=shown, smoothing=0.05)
