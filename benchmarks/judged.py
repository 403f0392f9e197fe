"""Checks, cases, studies: rows are computed, or taken from the record while inputs and code are the same."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Iterable
from typing import Any

from snug.recipe import DEFAULT

from .agenda import Agenda, declared
from .fingerprint import code_of
from .plan import Network, runs
from .records import Found, Records, Work
from .results import Row, cells_to_row, row_to_cells
from .study import METHOD, Study
from .validation.case import Case
from .wardrobe import Wardrobe

# What studies reach by name, through lists that are no code: the dressed body's scene and skinning.
BY_NAME = ("benchmarks.scenes.dressed_body", "benchmarks.methods.skinning")


def work_of(item: Case, agenda: Agenda) -> Work:
    """What the row of a case depends on."""
    kind, code = "case", code_of(item.module, "benchmarks.validation.case")
    return Work(kind, item.name, agenda.inputs(code) | {"declared": declared(item)}, code)


def rows_of(items: Iterable[Case], run: Callable[[Any], Row], agenda: Agenda, records: Records) -> list[Row]:
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
            rows.append(kept_row(Row(**found.result), found))
    return rows


def read_by(study: Study, agenda: Agenda) -> list[Work]:
    """The roll-outs and networks of the run that a study looks at."""
    plan, read = agenda.plan, list[Work]()
    if "roll-outs" in study.reads:
        read += [agenda.cell(cell) for cell in plan.cells if cell.scene.dressed and runs(cell)]
    if "networks" in study.reads:
        read += [agenda.network(Network(name, seed)) for name, seed in plan.models]
    return read


def work_of_study(study: Study, agenda: Agenda, records: Records) -> Work:
    """What the rows of a study depend on: also whether what it reads has been finished or has failed."""
    code, read = code_of(study.module, "benchmarks.study", *BY_NAME), read_by(study, agenda)
    inputs = agenda.inputs(code) | {"declared": declared(study), "recipe": dataclasses.asdict(DEFAULT)}
    inputs["read"] = {f"{work.kind} {work.name}": [work.key, records.find(work).state] for work in read}
    if "motions" in study.reads:
        inputs["motions"] = [agenda.motion(name) for name in agenda.plan.test]
    return Work("study", study.name, inputs, code)


def unfounded(study: Study, agenda: Agenda, records: Records) -> str:
    """Why a study cannot be done: what it would read is there still, but out of date. Or empty."""
    for work in read_by(study, agenda):
        if remark := records.find(work).remark:
            return f"not built upon {work.kind} {work.name}, {remark}"
    return ""


def rows_of_study(study: Study, agenda: Agenda, records: Records, wardrobe: Wardrobe | None) -> list[Row]:
    """The rows of a study; none where --only leaves it out, a skipped one where what it reads is stale."""
    work = work_of_study(study, agenda, records)
    found = records.find(work)
    if not found.wanted:
        return kept_rows(found)
    if reason := unfounded(study, agenda, records):
        return [Row(study.suite, study.name, METHOD, 0, "study", "", None, "skipped", reason)]
    clock = time.perf_counter()
    rows = study.run(agenda.plan, records.folder, wardrobe)
    failed = next((f"{row.scene}: {row.reason}" for row in rows if row.status == "failed"), "")
    result = {"rows": [row_to_cells(row) for row in rows]}
    records.keep(work, result, seconds=time.perf_counter() - clock, failed=failed)
    return rows


def kept_rows(found: Found) -> list[Row]:
    """The rows in the record of a study."""
    rows = found.result["rows"] if found.result else []
    return [kept_row(cells_to_row(cells), found) for cells in rows]


def kept_row(row: Row, found: Found) -> Row:
    """A row from a record: with the commit that measured it, and a remark where it is out of date."""
    reason = "; ".join(filter(None, (row.reason, found.remark)))
    return dataclasses.replace(row, commit=found.commit, reason=reason)
