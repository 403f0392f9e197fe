"""What a run would do: every piece of work, what its folder holds of it, and the time where it is known."""

from __future__ import annotations

from collections.abc import Iterator

from .agenda import Agenda
from .judged import unfounded, work_of, work_of_study
from .plan import Plan, runs
from .records import Found, Records, Work
from .results import RunFolder
from .study import Study


def describe(plan: Plan) -> str:
    """The plan in a few lines, and one line for each piece of work. Starts nothing, writes nothing."""
    outlook = Outlook(plan)
    skipped = sum(not runs(cell) for cell in plan.cells)
    lines = [
        f"preset {plan.preset.name}: {plan.preset.description}",
        f"folder {plan.folder}",
        f"suites {', '.join(plan.suites)}; seeds {', '.join(map(str, plan.seeds))}; device {plan.device}; "
        f"{plan.workers} workers, cells alone",
        *outlook.made_before_cells(),
        f"{len(plan.cells) - skipped} cells, {skipped} skipped, {len(plan.checks)} checks, "
        f"{len(plan.cases)} extreme cases, {len(plan.studies)} studies",
        *outlook.of_cells(),
    ]
    for suite, items in (("validation", plan.checks), ("extremes", plan.cases)):
        lines += [f"  {i.name} [{suite}]: {outlook.verdict(work_of(i, outlook.agenda))}" for i in items]
    lines += [f"  {study.name} [{study.suite}]: {outlook.of_study(study)}" for study in plan.studies]
    return "\n".join([*lines, outlook.total()])


class Outlook:
    """Asks the records of the plan's folder, and adds up what is to be done."""

    def __init__(self, plan: Plan) -> None:
        self.plan, self.agenda = plan, Agenda(plan)
        only = ("finished", "failed", "stale", "missing") if plan.fresh else plan.only
        self.records = Records(RunFolder(plan.folder), only=only)
        if "failed" not in only:
            self.agenda.remember_lost(self.records)
        self.wanted: list[Found] = []
        self.cached = 0

    def made_before_cells(self) -> Iterator[str]:
        """Garment, ground truth and networks."""
        plan, agenda = self.plan, self.agenda
        if plan.body:
            yield f"body {plan.body.path}"
        if plan.needs_wardrobe:
            for garment in plan.garments:
                yield f"{garment} of about {plan.preset.garment_vertices} vertices"
                yield f"test motions {', '.join(plan.test_of(garment))}"
            for scene in (scene for scene in plan.scenes if scene.dressed):
                yield f"  settle {scene.name}: {self.verdict(agenda.start(scene))}"
        for garment in dict.fromkeys(network.garment for network in plan.networks):
            simulated = garment in plan.simulated
            targets = "simulated for networks that learn from it" if simulated else "not simulated"
            yield f"training motions {', '.join(plan.train_of(garment))} ({targets})"
            for motion in plan.train_of(garment) if simulated else ():
                yield f"  simulate {motion}: {self.verdict(agenda.data(motion, garment))}"
        for network in plan.networks:
            steps = plan.preset.steps_of(network.name)
            yield f"  train {network.label}: {steps} steps, {self.verdict(agenda.network(network))}"

    def of_cells(self) -> Iterator[str]:
        """Each cell, with the state of its metrics where the trajectory is there."""
        for cell in self.plan.cells:
            line = f"  {cell.label} [{', '.join(cell.suites)}]: "
            if not runs(cell):
                yield line + "skip"
                continue
            verdict = self.verdict(self.agenda.cell(cell))
            if verdict == "cached" and self.records.find(self.agenda.metrics(cell)).state != "finished":
                verdict += ", metrics to be computed"
            yield line + verdict

    def of_study(self, study: Study) -> str:
        """What happens to a study, which may read what is still to be done."""
        work = work_of_study(study, self.agenda, self.records)
        kept = "stale" not in self.records.only  # what is stale otherwise is done again before the study
        if kept and self.records.find(work).wanted and (why := unfounded(study, self.agenda, self.records)):
            return f"skip ({why})"
        return self.verdict(work)

    def verdict(self, work: Work) -> str:
        """What happens to a piece of work, counted."""
        found = self.records.find(work)
        why = f" ({found.state}{': ' * bool(found.why)}{found.why})"
        if found.wanted:
            self.wanted.append(found)
            took = f", {found.seconds:.1f} s last time" if found.seconds else ""
            return f"run{why}{took}"
        if found.result is None:
            return f"left out{why}"
        self.cached += 1
        return "cached" + (why if found.state != "finished" else "")

    def total(self) -> str:
        """How much is to be done."""
        known = [found.seconds for found in self.wanted if found.seconds]
        times = f", about {sum(known):.0f} s for the {len(known)} whose time is known" if known else ""
        return f"{len(self.wanted)} pieces of work to run{times}; {self.cached} cached"
