"""All cells of a plan, one after another and nothing beside them, each in a process of its own.

Short cells of suite speed are run again, so many rounds, the order of the methods turned on from round to
round, so that a machine that grows slower does not favour whoever came first. Until then their processes
wait, idle, some cells of one scene at a time.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from glob import escape
from pathlib import Path
from typing import Any

from .agenda import REFERENCE, Agenda, flat, name_of
from .cell import Outcome, Task, failed, perform, perform_again, perform_many
from .clock import one_thread
from .guarded import Broken, Guarded
from .methods import find_method
from .plan import Cell, Plan
from .records import Found, Records, Work
from .results import RunFolder
from .wardrobe import Wardrobe

AT_ONCE = 8  # idle processes at most: each holds some hundred megabytes
KEPT = tuple(field.name for field in dataclasses.fields(Outcome) if field.name not in ("cell", "commit"))
BLOCKED = "cannot be run: "  # what the cell needs is not there
LEFT_OUT = "not asked for: --only names other states"


class Cells:
    """Runs or reuses cells, and remembers which it reused and which of those are out of date."""

    def __init__(self, plan: Plan, agenda: Agenda, records: Records, wardrobe: Wardrobe | None) -> None:
        one_thread()  # the processes of cells inherit it, whoever starts them
        self.plan, self.agenda, self.records, self.wardrobe = plan, agenda, records, wardrobe
        self.reused: list[str] = []
        self.outdated: dict[str, str] = {}  # label -> what has changed since
        self._idle: dict[Cell, Guarded] = {}

    def first(self, cell: Cell, obstacle: str | None) -> Outcome:
        """The outcome of a cell, run or from its record; `obstacle` says why it cannot be run."""
        if reason := find_method(cell.method).skip(cell.scene):
            return Outcome(cell, "skipped", reason)
        work = self.agenda.cell(cell)
        found = self.records.find(work)
        freed = found.why.startswith(f"failed: {BLOCKED}") and not obstacle
        if found.wanted or freed:
            self._clear(cell)
            blocked = Outcome(cell, "failed", f"{BLOCKED}{obstacle}")
            outcome = blocked if obstacle else self._guarded(perform, cell)
            if outcome.recorded:
                outcome = self._with_many(outcome)
            self._keep(work, outcome)
            return outcome
        if found.result is None:
            return Outcome(cell, "skipped", LEFT_OUT)
        self.reused.append(cell.label)
        if found.state == "stale":
            self.outdated[cell.label] = found.why
        return outcome_of_record(cell, found)

    def all(self, *, obstacle: Callable[[Cell], str | None], bar: Callable[..., Any]) -> list[Outcome]:
        """Every cell of the plan; `obstacle` says why one cannot be run, or None."""
        outcomes: dict[Cell, Outcome] = {}
        waiting: list[Cell] = []  # of one scene, their processes idle
        try:
            for cell in bar(self.plan.cells, "cells", "cell"):
                if waiting and (waiting[0].scene != cell.scene or len(waiting) == AT_ONCE):
                    self._repeat(waiting, outcomes)
                    waiting = []
                outcomes[cell] = self.first(cell, obstacle(cell))
                if self._is_repeated(outcomes[cell]):
                    waiting.append(cell)
                elif cell in self._idle:
                    self._idle.pop(cell).close()
            self._repeat(waiting, outcomes)
        finally:
            for process in self._idle.values():
                process.close()
        return list(outcomes.values())

    def _repeat(self, cells: list[Cell], outcomes: dict[Cell, Outcome]) -> None:
        """The rounds of these cells; adds the seconds to their outcomes and ends their processes."""
        rounds = self.plan.preset.repeats
        for number in range(1, rounds):
            turn = number * len(cells) // rounds
            for cell in (*cells[turn:], *cells[:turn]):
                outcomes[cell] = with_repeat(outcomes[cell], self._once_more(cell, number), number)
        for cell in cells:
            if cell in self._idle:
                self._idle.pop(cell).close()

    def _once_more(self, cell: Cell, number: int) -> Outcome:
        work = self.agenda.repeat(cell, number)
        found = self.records.find(work)
        if found.state == "finished" and found.result is not None:
            return outcome_of_record(cell, found)
        outcome = self._guarded(perform_again, cell)
        self._keep(work, outcome)
        return outcome

    def _with_many(self, outcome: Outcome) -> Outcome:
        """The outcome with the time of many bodies at once.

        Whatever goes wrong with so many, its run stands. But a time that cannot be believed takes the cell
        with it: a method that works on behind the clock did so in its run too.
        """
        many = self._guarded(perform_many, outcome.cell)
        if many.status == "ok":
            return dataclasses.replace(outcome, batch_seconds=many.batch_seconds)
        reason = f"many at once: {many.status}: {many.reason}"
        if many.batch_seconds is None:
            return dataclasses.replace(outcome, reason=outcome.reason or reason)
        self._clear(outcome.cell)
        return Outcome(outcome.cell, "failed", reason)

    def _is_repeated(self, outcome: Outcome) -> bool:
        """Cells of suite speed that ended well, and soon enough to be run again."""
        return (
            outcome.recorded
            and "speed" in outcome.cell.suites
            and outcome.seconds[0] <= self.plan.preset.repeat_seconds
            and outcome.cell.label not in self.outdated
        )

    def _guarded(self, function: Callable[[Task], Outcome], cell: Cell) -> Outcome:
        """The outcome of a cell in its own process, ended at the deadline. Raises nothing but interrupts."""
        plan, wardrobe = self.plan, self.wardrobe
        if wardrobe is not None and cell.scene.dressed:
            wardrobe = wardrobe.of_motion(cell.scene.name.split("/", 1)[1])
        task = Task(
            cell=cell,
            entry=find_method(cell.method),
            preset=plan.preset,
            wardrobe=wardrobe if cell.scene.dressed else None,
            folder=plan.folder,
        )
        process = self._idle.setdefault(cell, Guarded())
        try:
            return process.call(function, task, seconds=plan.preset.cell_seconds)
        except Broken as broken:
            return Outcome(cell, broken.status, str(broken))
        except Exception as error:
            return failed(cell, error)

    def _clear(self, cell: Cell) -> None:
        """Remove what an earlier run of the cell has left: no one is to take it for this one's.

        Keys tell inputs and code apart, not how a cell ended: what the scene's other cells were compared with
        may have failed then and be there now.
        """
        folder, place = self.records.folder, (cell.scene.name, cell.method, cell.seed)
        folder.trajectory_path(*place).unlink(missing_ok=True)
        folder.held_path(*place).unlink(missing_ok=True)
        for number in range(1, self.plan.preset.repeats):
            self.records.forget("repeat", f"{escape(name_of(cell))}-{number}")
        compared = cell.method.startswith(REFERENCE)
        names = f"{escape(flat(cell.scene.name))}/**/*" if compared else escape(name_of(cell))
        self.records.forget("metrics", names)

    def _keep(self, work: Work, outcome: Outcome) -> None:
        folder, cell = self.records.folder, outcome.cell
        files = [trajectory(folder, cell)] if outcome.recorded else []
        broken = "" if outcome.recorded or outcome.seconds else f"{outcome.status}: {outcome.reason}"
        result = {name: getattr(outcome, name) for name in KEPT}
        self.records.keep(work, result, seconds=sum(outcome.seconds), files=files, failed=broken)


def trajectory(folder: RunFolder, cell: Cell) -> Path:
    """The file of a cell's trajectory."""
    return folder.trajectory_path(cell.scene.name, cell.method, cell.seed)


def outcome_of_record(cell: Cell, found: Found) -> Outcome:
    """The outcome that the record of a cell, or of its repeat, holds."""
    values: dict[str, Any] = {
        name: tuple(value) if isinstance(value, list) else value
        for name, value in (found.result or {}).items() if name in KEPT
    }  # fmt: skip
    return Outcome(cell, **values, commit=found.commit)


def with_repeat(before: Outcome, again: Outcome, number: int) -> Outcome:
    """The outcome with the time of one repeat more. What the first run left stands in any case."""
    if again.status == "ok":
        return dataclasses.replace(before, seconds=(*before.seconds, *again.seconds))
    reason = before.reason or f"repeat {number}: {again.status}: {again.reason}"
    return dataclasses.replace(before, reason=reason)
