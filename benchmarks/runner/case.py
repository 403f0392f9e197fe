"""A known answer, or a stress test, of benchmarks.validation."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from benchmarks.plan.plan import TaskId
from benchmarks.results.row import Row
from benchmarks.runner.task import Context, Outcome, Task

if TYPE_CHECKING:
    from benchmarks.validation.case import Case


@dataclass(frozen=True, kw_only=True, eq=False)
class RunCase(Task):
    """The row of one case."""

    kind = "case"
    stage = "validation"
    unit_seconds = 0.2
    case: Case

    def warm_up(self) -> None:
        """Compile what the case needs."""
        self.case.warm_up()

    def run(self, context: Context, needed: Mapping[TaskId, Outcome]) -> Outcome:
        """Run the case; its row is the result."""
        row = self.case.run()
        context.tell(self.units)
        return Outcome(row.status, row.reason, failed=row.status != "ok", result=dataclasses.asdict(row))

    def rows(self, outcome: Outcome) -> list[Row]:
        """Return the row of the case, also of one that died or hung.

        A hang and a crash are failures of the solver: only one that ends by itself may call it a timeout.
        """
        if outcome.result:
            return [Row(**outcome.result)]
        return [self.case.row(status="failed", reason=outcome.reason)]
