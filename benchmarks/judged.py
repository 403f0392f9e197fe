"""Checks and extreme cases: each row is computed, or taken from its record while its code is the same."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Iterable
from typing import Any

from .agenda import Agenda, declared
from .check import Check
from .fingerprint import code_of
from .records import Records, Work
from .results import Row
from .suites.extremes import Case


def work_of(item: Check | Case, agenda: Agenda) -> Work:
    """What the row of a check or a case depends on."""
    if isinstance(item, Check):
        kind, code = "check", code_of(f"benchmarks.checks.{item.module}", "benchmarks.check")
    else:
        module = item.function.partition(":")[0]
        kind, code = "case", code_of(f"benchmarks.checks.{module}", "benchmarks.suites.extremes")
    return Work(kind, item.name, agenda.inputs(code) | {"declared": declared(item)}, code)


def rows_of(
    items: Iterable[Check | Case], run: Callable[[Any], Row], agenda: Agenda, records: Records
) -> list[Row]:
    """The row of each item. One that is left out by --only has none."""
    rows = []
    for item in items:
        work = work_of(item, agenda)
        found = records.find(work)
        if found.wanted:
            clock = time.perf_counter()
            row = run(item)
            failed = "" if row.status == "ok" else f"{row.status}: {row.reason}"
            records.keep(work, dataclasses.asdict(row), seconds=time.perf_counter() - clock, failed=failed)
            rows.append(row)
        elif found.result is not None:
            rows.append(Row(**found.result | {"commit": found.commit}))
    return rows
