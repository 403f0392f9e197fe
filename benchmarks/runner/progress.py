"""Progress of a run: a line as a stage begins, and the time left, which never grows."""

from __future__ import annotations

import math
import sys
import threading
import time
from collections import Counter, defaultdict
from collections.abc import Sequence

from benchmarks.plan.cell import TaskId
from benchmarks.runner.task import Task
from reference_sim.command_line import SECONDS_OF_A_LOG, must_compile

# [s] on an idle core: of a step of SNUG's training, else of a task of 60 frames at 1000 vertices.
EXPECTED = {
    "start": 2.5, "data": 6.0, "clips": 150.0, "network": 0.04, "cell": 2.5, "repeat": 0.5, "batch": 1.0,
    "quasi-static": 7.0, "metrics": 2.5, "case": 0.3,
}  # fmt: skip
COMPILING, REPORT = 20.0, 20.0  # [s]


def expected_of(task: Task) -> float:
    """Return how long a task may take [s] before any of its kind is done."""
    return EXPECTED.get(task.kind, 1.0) * task.work


class Progress:
    """The tasks that are left, and how long they may take where so many `workers` are at work.

    Seconds of tasks that have ended correct what is expected of others of their kind. Use it in a `with`:
    on a terminal a line is drawn anew each second, a file gets one each half minute.
    """

    def __init__(self, tasks: Sequence[Task], workers: int) -> None:
        self.left = {task.id: task for task in tasks}
        self.of_stage, self.ended = Counter(task.stage for task in tasks), Counter[str]()
        self.workers = workers
        self.since: dict[TaskId, float] = {}  # batch -> when that of its tasks began which is at work
        # Of a kind, of its tasks that have ended [s].
        self.seconds, self.expected = defaultdict[str, float](float), defaultdict[str, float](float)
        self.compiling = COMPILING if must_compile() else 0.0
        self.shown, self.stage = math.inf, ""
        self._stopped = threading.Event()

    def begin(self, task: Task) -> None:
        """Note that a task begins, and say so of the first of its stage."""
        self.since.setdefault(task.batch_id, time.monotonic())
        if task.stage not in self.ended:
            self.ended[task.stage], self.stage = 0, task.stage
            self._print(f"{task.stage}: {self.of_stage[task.stage]} tasks; {self.time_left()}")

    def end(self, task: Task, seconds: float = 0.0) -> None:
        """Note that a task has ended; `seconds` that it took, 0 where it was not run."""
        del self.left[task.id]
        self.ended[task.stage] += 1
        if seconds:
            self.since[task.batch_id], self.stage = time.monotonic(), task.stage
            self.seconds[task.kind] += seconds
            self.expected[task.kind] += expected_of(task)

    def time_left(self) -> str:
        """Return how long the rest may take, in words: no more than it said before."""
        pace = {kind: self.seconds[kind] / self.expected[kind] for kind in list(self.expected)}
        usual = sum(self.seconds.values()) / sum(self.expected.values()) if pace else 1.0
        now, since, total = time.monotonic(), dict(self.since), REPORT + self.compiling * (not pace)
        for task in list(self.left.values()):
            seconds = expected_of(task) * pace.get(task.kind, usual)
            seconds = max(seconds - (now - since.pop(task.batch_id, now)), 0.0)
            total += seconds if task.process else seconds / self.workers
        self.shown = min(self.shown, total)
        minutes = self.shown / 60.0
        return f"about {math.ceil(minutes)} min left" if minutes > 1.0 else "less than a minute left"

    def __enter__(self) -> Progress:
        """Begin to draw."""
        if self.left:
            self._print(f"{len(self.left)} tasks; {self.time_left()}")
        self._thread = threading.Thread(target=self._draw, name="progress", daemon=True)
        self._thread.start()
        return self

    def __exit__(self, *ended: object) -> None:
        """Draw no more."""
        self._stopped.set()
        self._thread.join()

    def _draw(self) -> None:
        terminal = sys.stderr.isatty()
        while not self._stopped.wait(1.0 if terminal else SECONDS_OF_A_LOG):
            if self.stage:
                count = f"{self.ended[self.stage]} of {self.of_stage[self.stage]}"
                line = f"{self.stage}: {count} tasks; {self.time_left()}"
                self._print(f"{line}\r" if terminal else line, end="" if terminal else "\n")

    def _print(self, line: str, end: str = "\n") -> None:
        clear = "\r\x1b[K" if sys.stderr.isatty() else ""
        print(f"{clear}{line}", end=end, file=sys.stderr, flush=True)
