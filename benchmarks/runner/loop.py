"""The loop over tasks: reuse a cached outcome, or run the task and keep its outcome.

Dry run, resume, failures, what an interrupt leaves and exclusive timing are decided here alone.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from benchmarks.plan.cell import TaskId
from benchmarks.runner.cache import Cache
from benchmarks.runner.executor import Batch, Executor
from benchmarks.runner.progress import Progress
from benchmarks.runner.task import Outcome, Task, failure


class Runner:
    """Runs or reuses tasks, in their order: those that others need come first.

    Attributes:
        outcomes: outcome of every task so far.
        reused: titles of those that an earlier run had finished.
    """

    def __init__(self, tasks: Sequence[Task], cache: Cache) -> None:
        self.tasks, self.cache = tuple(tasks), cache
        self.titles = {task.id: task.title for task in self.tasks}
        self.outcomes: dict[TaskId, Outcome] = {}
        self.reused: list[str] = []

    def refuse(self, kinds: Sequence[str], reason: str) -> None:
        """Let all tasks of these kinds fail, for the same reason; nothing of it is kept."""
        ids = [task.id for task in self.tasks if task.id[0] in kinds]
        refused = Outcome("failed", reason, failed=True, origin=self.cache.origin)
        self.outcomes |= dict.fromkeys(ids, refused)

    def run(self, executor: Executor) -> None:
        """Do all tasks: untimed ones side by side until others wait for the timed, one by one."""
        unknown = [task for task in self.tasks if task.id not in self.outcomes]
        try:
            with Progress(unknown, executor.workers) as self.progress:
                while rest := [task for task in unknown if task.id not in self.outcomes]:
                    tasks = _able(rest, timed=False) or _able(rest, timed=True)
                    (self._run_alone if tasks[0].process else self._side_by_side)(tasks, executor)
        finally:
            executor.close()

    def _side_by_side(self, tasks: Sequence[Task], executor: Executor) -> None:
        """Do tasks, each as soon as its needs have outcomes."""
        waiting = _batches(tasks)

        def ready() -> Batch | None:
            for batch in filter(self._is_ready, list(waiting)):
                waiting.remove(batch)
                if todo := [task for task in batch if self.decide(task)]:
                    return todo, self._find_needs(*todo)
            return None

        for task, outcome in executor.together(ready):
            self._keep(task, outcome)

    def _is_ready(self, batch: Sequence[Task]) -> bool:
        """Return whether every dependency of the batch has an outcome."""
        ids = (id for task in batch for id in (*task.needs, *task.reads))
        return all(id in self.outcomes or id not in self.titles for id in ids)

    def _run_alone(self, tasks: Sequence[Task], executor: Executor) -> None:
        """Do timed tasks one by one; a process ends when no other task wants it."""
        for place, task in enumerate(tasks):
            if self.decide(task):
                self._keep(task, executor.run_alone(task, self._find_needs(task)))
            others = (other for other in tasks[place + 1 :] if other.process == task.process)
            if all(self._find(other)[1] for other in others):
                executor.release(task.process)

    def decide(self, task: Task) -> bool:
        """Return whether the task is to be run now; where not, its outcome is known.

        Files of an earlier run of it are removed then.
        """
        _, outcome = self._find(task)
        if outcome is None:
            for name in task.files:
                (self.cache.folder.path / name).unlink(missing_ok=True)
            self.progress.begin(task)
            return True
        self.progress.end(task)
        self.outcomes[task.id] = replace(outcome, origin=self.cache.origin | outcome.origin)
        if outcome.content:
            self.reused.append(task.title)
        return False

    def _find(self, task: Task) -> tuple[str, Outcome | None]:
        """Return why a task has to run, or how it failed; and its outcome, if known."""
        outcomes = self._find_needs(task)
        if task.skip:
            return task.skip, Outcome("skipped", task.skip)
        for id in task.needs:
            if id not in outcomes:
                outcome = self._refuse(id)
                return outcome.reason, outcome
        return self.cache.find(task, self.outcomes)

    def _refuse(self, need: TaskId) -> Outcome:
        """Return the outcome of a task that lacks a need; nothing of it is kept."""
        title, other = self.titles.get(need, " ".join(need)), self.outcomes.get(need, Outcome())
        if other.status == "skipped":
            return Outcome("skipped", f"{title}: {other.reason}")
        return Outcome("failed", f"cannot be run: {title}: {other.ending}", failed=True)

    def _find_needs(self, *tasks: Task) -> dict[TaskId, Outcome]:
        """Return the usable outcomes of what the tasks need or read."""
        ids = dict.fromkeys(id for task in tasks for id in (*task.needs, *task.reads))
        return {id: self.outcomes[id] for id in ids if id in self.outcomes and self.outcomes[id].usable}

    def _keep(self, task: Task, outcome: Outcome) -> None:
        """Write the outcome into the cache; one that cannot be written is a failure."""
        try:
            entry = self.cache.keep(task, outcome, self.outcomes)
        except (TypeError, ValueError, OSError) as error:
            # a result that is no plain value, a file not there
            entry = self.cache.keep(task, failure(error), self.outcomes)
        self.outcomes[task.id] = entry
        self.progress.end(task, outcome.seconds)

    def preview(self) -> Iterator[tuple[Task, str, Outcome | None]]:
        """Yield each task and what `_find` says, as if those to be run succeed."""
        for task in self.tasks:
            reason, outcome = self._find(task)
            self.outcomes[task.id] = outcome or Outcome(content="out of date")
            yield task, reason, outcome

    def broken(self) -> list[str]:
        """Return how tasks failed that have no row."""
        failed = (task for task in self.tasks if task.silent and self.outcomes[task.id].failed)
        return [f"{task.title}: {self.outcomes[task.id].ending}" for task in failed]


def _able(tasks: Sequence[Task], *, timed: bool) -> list[Task]:
    """Return the tasks that are timed, or are not, and wait for none of the others."""
    others: set[TaskId] = set()
    for task in tasks:
        if bool(task.process) != timed or not others.isdisjoint((*task.needs, *task.reads)):
            others.add(task.id)
    return [task for task in tasks if task.id not in others]


def _batches(tasks: Sequence[Task]) -> list[list[Task]]:
    """Return the tasks handed out together, by stage, the largest first: workers end together.

    The largest of all comes first: the rest fits in beside it, and no two workers compile one kernel.
    """
    batches: dict[TaskId, list[Task]] = {}
    for task in tasks:
        batches.setdefault(task.batch_id, []).append(task)
    stages = list(dict.fromkeys(task.stage for task in tasks))
    work = {id: sum(task.work for task in batch) for id, batch in batches.items()}
    order = sorted(batches, key=lambda id: (stages.index(batches[id][0].stage), -work[id]))
    largest = max(order, key=work.__getitem__, default=None)
    return [batches[id] for id in sorted(order, key=lambda id: id != largest)]
