"""What a run that was interrupted can say: the rows of all that is finished and current, from the records."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from .agenda import Agenda
from .cells import outcome_of_record, with_repeat
from .curves import remarked
from .judged import kept_row, kept_rows, work_of, work_of_study
from .measuring import costs_of
from .plan import runs
from .records import Records
from .results import Row
from .rows import clock_costs, rows_of
from .validation.case import Case

ENDED = ("finished", "failed")


def with_finished(rows: Iterable[Row], agenda: Agenda, records: Records) -> list[Row]:
    """`rows`, and those of the plan's other work whose records are current."""
    found = {_place(row): row for row in finished_rows(agenda, records)}
    return list((found | {_place(row): row for row in rows}).values())


def finished_rows(agenda: Agenda, records: Records) -> Iterator[Row]:
    """Rows of cells with their metrics, checks, cases and studies. Computes and measures nothing."""
    plan = agenda.plan
    agenda.remember_lost(records)  # the interrupt may have come before the stage that asks for them
    cells: list[Row] = []
    for cell in filter(runs, plan.cells):
        found, metrics = records.find(agenda.cell(cell)), records.find(agenda.metrics(cell))
        if found.state == "failed" and found.result is not None:
            cells += rows_of(outcome_of_record(cell, found), {})
        elif found.state == metrics.state == "finished" and metrics.result is not None:
            outcome = outcome_of_record(cell, found)
            for number in range(1, plan.preset.repeats):
                once_more = records.find(agenda.repeat(cell, number))
                if once_more.state in ENDED:
                    outcome = with_repeat(outcome, outcome_of_record(cell, once_more), number)
            cells += rows_of(outcome, metrics.result | clock_costs(outcome) | costs_of(cell, agenda, records))
    yield from remarked(cells)
    items: tuple[Case, ...] = (*plan.checks, *plan.cases)
    for item in items:
        found = records.find(work_of(item, agenda))
        if found.state in ENDED and found.result is not None:
            yield kept_row(Row(**found.result), found)
    for study in plan.studies:
        found = records.find(work_of_study(study, agenda, records))
        if found.state in ENDED:
            yield from kept_rows(found)


def _place(row: Row) -> tuple[str, str, str, int, str]:
    return row.suite, row.scene, row.method, row.seed, row.metric
