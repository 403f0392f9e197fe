"""All cells of a plan, one after another and nothing beside them, each in a process of its own.

First every cell once; then the short ones of suite speed again, so many rounds, the order of the methods
turned on from round to round, so that a machine that grows slower does not favour whoever came first.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from .agenda import Agenda
from .cell import Outcome, Task, failed, perform, perform_again
from .guarded import Broken, Guarded
from .methods import find_method
from .plan import Cell, Plan
from .records import Records, Work
from .results import RunFolder
from .wardrobe import Wardrobe

KEPT = tuple(field.name for field in dataclasses.fields(Outcome) if field.name != "cell")
LEFT_OUT = "not asked for: --only names other states"


class Cells:
    """Runs or reuses cells. obstacles: cell -> why it cannot be run, or None."""

    def __init__(self, plan: Plan, agenda: Agenda, records: Records, wardrobe: Wardrobe | None) -> None:
        self.plan, self.agenda, self.records, self.wardrobe = plan, agenda, records, wardrobe
        self.reused: list[str] = []
        self.outdated: dict[str, str] = {}  # label -> what has changed since

    def first(self, cell: Cell, obstacle: str | None) -> Outcome:
        """The outcome of a cell, run or from its record; `obstacle` says why it cannot be run."""
        if reason := find_method(cell.method).skip(cell.scene):
            return Outcome(cell, "skipped", reason)
        work = self.agenda.cell(cell)
        found = self.records.find(work)
        if found.wanted and obstacle:
            return Outcome(cell, "failed", obstacle)
        if found.wanted:
            outcome = self._guarded(perform, cell)
            self._keep(work, outcome)
            return outcome
        if found.result is None:
            return Outcome(cell, "skipped", LEFT_OUT)
        self.reused.append(cell.label)
        if found.state == "stale":
            self.outdated[cell.label] = found.why
        return _outcome(cell, found.result)

    def again(self, outcomes: Iterable[Outcome], *, bar: Callable[..., Any]) -> list[Outcome]:
        """The outcomes with the seconds of repeats, where the plan wants any."""
        by_cell = {outcome.cell: outcome for outcome in outcomes}
        short = [o.cell for o in by_cell.values() if self._is_repeated(o)]
        todo = []
        for number in range(1, self.plan.preset.repeats):
            for cells in _by_scene(short):
                turn = number * len(cells) // self.plan.preset.repeats
                todo += [(cell, number) for cell in (*cells[turn:], *cells[:turn])]
        for cell, number in bar(todo, "repeats", "run"):
            work = self.agenda.repeat(cell, number)
            found = self.records.find(work)
            result = found.result
            if found.state != "finished":
                once_more = self._guarded(perform_again, cell)
                self._keep(work, once_more)
                result = {"seconds": once_more.seconds, "status": once_more.status}
            before = by_cell[cell]
            if result and result["status"] == "ok":
                by_cell[cell] = dataclasses.replace(before, seconds=(*before.seconds, *result["seconds"]))
        return list(by_cell.values())

    def _is_repeated(self, outcome: Outcome) -> bool:
        """Cells of suite speed that ended well, and soon enough to be run again."""
        return (
            outcome.recorded
            and "speed" in outcome.cell.suites
            and outcome.seconds[0] <= self.plan.preset.repeat_seconds
            and outcome.cell.label not in self.outdated
        )

    def _guarded(self, function: Callable[[Task], Outcome], cell: Cell) -> Outcome:
        """The outcome of a cell in a process that is ended at the deadline. Only an interrupt is raised."""
        plan, wardrobe = self.plan, self.wardrobe
        if wardrobe is not None and cell.scene.dressed:
            wardrobe = wardrobe.of_motion(cell.scene.name.split("/", 1)[1])
        task = Task(
            cell=cell,
            entry=find_method(cell.method),
            preset=plan.preset,
            wardrobe=wardrobe if cell.scene.dressed else None,
            folder=plan.folder,
            device=plan.device,
        )
        try:
            with Guarded() as guarded:
                return guarded.call(function, task, seconds=plan.preset.cell_seconds)
        except Broken as broken:
            return Outcome(cell, broken.status, str(broken))
        except Exception as error:
            return failed(cell, error)

    def _keep(self, work: Work, outcome: Outcome) -> None:
        folder, cell = self.records.folder, outcome.cell
        files = [trajectory(folder, cell)] if outcome.recorded else []
        broken = "" if outcome.recorded or outcome.seconds else f"{outcome.status}: {outcome.reason}"
        result = {name: getattr(outcome, name) for name in KEPT}
        self.records.keep(work, result, seconds=sum(outcome.seconds), files=files, failed=broken)


def trajectory(folder: RunFolder, cell: Cell) -> Path:
    """The file of a cell's trajectory."""
    return folder.trajectory_path(cell.scene.name, cell.method, cell.seed)


def _outcome(cell: Cell, result: dict[str, Any]) -> Outcome:
    values: dict[str, Any] = {
        name: tuple(value) if isinstance(value, list) else value
        for name, value in result.items() if name in KEPT
    }  # fmt: skip
    return Outcome(cell, **values)


def _by_scene(cells: Iterable[Cell]) -> list[list[Cell]]:
    groups: dict[str, list[Cell]] = {}
    for cell in cells:
        groups.setdefault(cell.scene.name, []).append(cell)
    return list(groups.values())
