"""A microbenchmark of benchmarks.performance."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from benchmarks.cell import TaskId
from benchmarks.method import MethodEntry
from benchmarks.performance.microbenchmark import SUITE, Settings
from benchmarks.process.memory import peak_memory
from benchmarks.results.row import Row
from benchmarks.results.run_folder import RunFolder
from benchmarks.tasks.task import Context, Outcome, Task, failure

if TYPE_CHECKING:
    from benchmarks.performance.microbenchmark import Microbenchmark


@dataclass(frozen=True, kw_only=True, eq=False)
class RunMicrobenchmark(Task):
    """The rows of one microbenchmark. settings: but for the paths of its files."""

    kind = "microbenchmark"
    stage = SUITE
    benchmark: Microbenchmark
    entry: MethodEntry
    settings: Settings

    def clear(self, folder: RunFolder) -> None:
        """Remove the files of an earlier measurement."""
        for name in self.benchmark.files:
            (folder.path / name).unlink(missing_ok=True)

    def run(self, context: Context, needed: Mapping[TaskId, Outcome]) -> Outcome:
        """Measure; a failure has the memory of its process too."""
        from benchmarks.metrics.cost.microbenchmarks import PROCESS_MEMORY

        files = self.benchmark.files
        settings = dataclasses.replace(
            self.settings, files=tuple(context.folder.path / name for name in files)
        )
        try:
            outcome = Outcome(result=self.benchmark.measure(settings), files=files)
        except Exception as error:
            outcome = failure(error)
        return dataclasses.replace(outcome, result={**outcome.result, PROCESS_MEMORY: peak_memory()})

    def rows(self, outcome: Outcome) -> list[Row]:
        """Return a row for each number; where the process died, one that says so."""
        from benchmarks.metrics.cost.microbenchmarks import PROCESS_MEMORY

        benchmark, entry = self.benchmark, self.entry
        base = Row(
            suite=SUITE, scene=benchmark.name, method=entry.name, seed=0, metric=PROCESS_MEMORY, unit="",
            status="failed", reason=outcome.reason, dtype=entry.dtype, role=entry.role,
            family=entry.reporting.family or entry.name, level=entry.reporting.level,
            base=entry.reporting.base,
        )  # fmt: skip
        rows = []
        for name, value in outcome.result.items():
            status, reason = outcome.status, outcome.reason
            if not math.isfinite(value):
                status, reason, value = "failed", reason or f"{name} is not finite", None
            rows.append(dataclasses.replace(base, metric=name, value=value, status=status, reason=reason))
        return rows or [dataclasses.replace(base, status=outcome.status)]
