"""Tables of outcomes: checks, stress tests, cells that did not end well; and of everything measured."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

import pandas as pd

from reports.run.finished_run import Run
from reports.statistics.outcomes import BAD, check_name, checks, counted, stress_tests, tolerances_away
from reports.tables.table import METHOD, SCENE, SUITE, Cell, Column, Table, table

REASON = Column("reason", "Reason", text=True)


def validation(run: Run) -> list[Table]:
    """List the checks: measured against expected; one without a tolerance is reported, not judged.

    A row that is ok outside its tolerance is of a program under test, which violates what is expected.
    """
    lines = [
        (
            check_name(run, row),
            row.unit,
            row.value,
            row.expected,
            row.tolerance,
            tolerances_away(row),
            _result(row),
        )
        for row in checks(run).itertuples()
    ]
    columns = (
        Column("check", "Check", text=True),
        Column("unit", "Unit", text=True),
        Column("measured", "Measured", digits=7, trim=True),
        Column("expected", "Expected", digits=7, trim=True),
        Column("tolerance", "Tolerance", digits=2, trim=True),
        Column("away", "Tolerances away", digits=2),
        Column("status", "Result", text=True),
    )
    return table("validation", columns, lines, "Checks with a known answer.")


def _result(row: Any) -> str:
    if row.status != "ok":
        return row.status
    if pd.isna(row.tolerance):
        return "reported"
    return "pass" if (tolerances_away(row) or 0.0) <= 1.0 else "violated"


def extremes(run: Run) -> list[Table]:
    """List the stress tests and how each ended."""
    rows = stress_tests(run)
    lines = [(r.scene, r.method, "converged" if r.status == "ok" else r.status, r.value, r.reason)
        for r in rows.itertuples()]  # fmt: skip
    unit = rows["unit"].iloc[0] if len(rows) else ""
    columns = (
        Column("case", "Case", text=True),
        METHOD,
        Column("outcome", "Outcome", text=True),
        Column("gradient", "Largest gradient", unit, digits=2, trim=True),
        Column("reason", "In words", text=True),
    )
    return table("extremes", columns, lines, "Every stress test and how it ended.")


def endings(run: Run) -> list[Table]:
    """Count cells, checks and stress tests by how they ended."""
    ends = ("ok", *BAD, "skipped")
    lines: list[tuple[Cell, ...]] = [
        (kind, *(counts[end] for end in ends), sum(counts.values())) for kind, counts in counted(run).items()
    ]
    columns = [Column(name, name.capitalize()) for name in (*ends, "all")]
    return table("endings", (Column("what", "What", text=True), *columns), lines, "How many ended how.")


def unfinished(run: Run) -> list[Table]:
    """List every cell that failed or was skipped, once per reason, whatever the number of its metrics."""
    judged_elsewhere = (run.frame["case"] != "") & (run.frame["status"] != "skipped")
    rows = run.frame[(run.frame["status"] != "ok") & ~judged_elsewhere]
    names = ["suite", "scene", "method", "seed", "status", "reason"]
    lines = rows[names].drop_duplicates().itertuples(index=False)
    columns = (SUITE, SCENE, METHOD,
        Column("seed", "Seed", text=True), Column("status", "Status", text=True), REASON)  # fmt: skip
    cells = [(*line[:5], line[5] or "no reason given") for line in lines]
    return table("unfinished", columns, cells, "Cells that failed or were skipped, with the reason of each.")


def merged(table: Table, names: Iterable[str]) -> Table:
    """Merge lines that differ in one of the columns alone into one with all that stands there."""
    rows: Sequence[tuple[Cell, ...]] = table.rows
    for place in [place for place, column in enumerate(table.columns) if column.name in set(names)]:
        texts: dict[tuple[Cell, ...], list[str]] = {}
        for row in rows:
            texts.setdefault((*row[:place], *row[place + 1 :]), []).append(str(row[place]))
        rows = [(*key[:place], ", ".join(every), *key[place:]) for key, every in texts.items()]
    return replace(table, rows=tuple(rows), grouped_by=(), references=(), note="")
