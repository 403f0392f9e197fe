"""The stages of a run, in order, each timed: wardrobe, ground truth, training, cells, metrics, report.

What is written is written whole, and what an earlier run in the same folder has finished is taken from there.
A cell that fails is a row with its reason and the rest goes on.
"""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from snug.recipe import learns_from_simulation

from . import judged
from .agenda import Agenda
from .cell import Outcome
from .cells import LEFT_OUT, Cells
from .curves import remarked
from .measuring import rows_of_cells
from .plan import Cell, Network, Plan, network_of, runs
from .record import Record, now
from .records import Found, Work
from .results import Row
from .salvage import with_finished
from .scenes import TSHIRT, dressed_scene, worn_in
from .workers import Failure, Job, one_line, run_jobs

if TYPE_CHECKING:
    from .wardrobe import Wardrobe


def execute(plan: Plan) -> int:
    """Run the plan. Returns 0 when all ended well, 1 when something failed or there is no report."""
    record = Record(plan)
    stages = Stages(record)
    try:
        stages.run()
    except KeyboardInterrupt:
        record.note("interrupted", True)
        record.rows = with_finished(record.rows, stages.agenda, record.records)
        if record.rows or not record.folder.rows_path.is_file():  # nothing known is no reason to lose a table
            record.write_rows()
        raise
    made = stages.make_report()
    from .closing import remarks, summary

    print(summary(record.rows, record.stages), flush=True)
    failed = [row for row in record.rows if not accepted(row)]
    for line in dict.fromkeys(f"{row.scene} x {row.method}: {row.status}: {row.reason}" for row in failed):
        print(line, file=sys.stderr)
    for label, reason in stages.broken.items():
        print(f"{label}: {reason}", file=sys.stderr)
    for line in remarks(record.rows, len(record.reused), record.config.get("outdated", {})):
        print(line, file=sys.stderr)
    if made:
        print(record.folder.report_path.resolve(), flush=True)
    return 0 if made and not (failed or stages.broken) else 1


def accepted(row: Row) -> bool:
    """Whether a row lets the run end with status 0; an extreme case may fail honestly, never silently."""
    return row.passed or (row.suite == "extremes" and row.status != "failed" and bool(row.reason))


class Stages:
    """Everything that a run does, one stage after another."""

    def __init__(self, record: Record) -> None:
        self.record = record
        self.plan, self.folder, self.records = record.plan, record.folder, record.records
        self.agenda = Agenda(self.plan)
        self.untrained: dict[Network, str] = {}  # why a network could not be trained
        self.unsettled: dict[str, str] = {}  # scene -> why its garment has no start
        self.broken: dict[str, str] = {}  # ground truth or network -> how it failed
        self.targets: dict[str, dict[str, Path]] = {}  # garment, training motion -> its whole simulation
        self.wardrobe: Wardrobe | None = None
        self.naked = ""  # why there is no wardrobe
        self.cells: Cells | None = None

    def run(self) -> None:
        """Everything but the report."""
        plan = self.plan
        if plan.needs_wardrobe:
            with self.record.stage("body, garments and motions"):
                self.open_wardrobe()
        if self.wardrobe is not None:
            with self.record.stage("ground truth"):
                self.ground_truth()
            if plan.networks:
                with self.record.stage("training"):
                    self.train()
        if plan.cells:
            outcomes = self.cells_and_metrics()
            failed = sum(not outcome.recorded and outcome.status != "skipped" for outcome in outcomes)
            self.record.note("cells", {"run": sum(map(runs, plan.cells)), "failed": failed})
        if plan.checks:
            with self.record.stage("validation"):
                from .validation.case import Case

                checks = _bar(plan.checks, "validation", "check")
                self.record.rows += judged.rows_of(checks, Case.run, self.agenda, self.records)
        if plan.cases:
            with self.record.stage("extremes"):
                from .validation.isolated import run_isolated

                cases = _bar(plan.cases, "extremes", "case")
                self.record.rows += judged.rows_of(cases, run_isolated, self.agenda, self.records)
        for study in plan.studies:
            with self.record.stage(f"{study.suite}: {study.name}"):
                self.record.rows += judged.rows_of_study(study, self.agenda, self.records, self.wardrobe)
        self.record.write_rows()

    def open_wardrobe(self) -> None:
        from .wardrobe import embedded_motions, open_wardrobe

        plan = self.plan
        names = [name for garment in plan.garments for name in plan.test_of(garment)]
        names += [name for network in plan.networks for name in plan.train_of(network.garment)]
        names = list(dict.fromkeys(names))
        motions = [plan.files[name] for name in names if name in plan.files]
        motions += embedded_motions(name for name in names if name not in plan.files)
        try:
            self.wardrobe = open_wardrobe(plan.preset, motions, plan.garments, body=plan.body_file)
        except ValueError as error:  # of all cells only the dressed ones fail
            self.naked = one_line(error)
            return
        for garment in self.wardrobe.garments.values():
            self.record.note("garment" if garment.name == TSHIRT else garment.name, {
                "name": garment.name,
                "vertices": len(garment.rest_positions),
                "triangles": len(garment.faces),
                "parameters": {name: float(value) for name, value in garment.parameters.items()},
            })  # fmt: skip
        motions_of = self.wardrobe.motions
        self.record.config["motions"]["frames"] = {name: motions_of[name].frames for name in names}
        self.record.note("motion_sources", {name: motions_of[name].source for name in names})

    def ground_truth(self) -> None:
        """Settle every dressed scene and simulate the training motions, some at a time."""
        from . import ground_truth

        plan, preset = self.plan, self.plan.preset
        assert self.wardrobe is not None
        todo: dict[Work, Job] = {}
        for scene in (scene for scene in plan.scenes if scene.dressed):
            work, arguments = self.agenda.start(scene), (scene, preset, plan.folder)
            todo[work] = Job(scene.name, ground_truth.settle, arguments, preset.settle_frames)
        learned = [(garment, motion) for garment in plan.simulated for motion in plan.train_of(garment)]
        for garment, motion in learned:
            scene = dressed_scene(motion, garment)
            units = preset.settle_frames + self.wardrobe.motions[motion].frames
            work, arguments = self.agenda.data(motion, garment), (scene, preset, plan.folder)
            todo[work] = Job(scene.name, ground_truth.simulate_motion, arguments, units)
        results = self.finished(todo, title="simulating", unit="frame")
        unused, rough, frames, seconds = {}, {}, 0, 0.0
        for work, job in todo.items():
            result = results[work]
            if isinstance(result, Failure) and work.kind == "start":
                self.unsettled[job.label] = result.reason
            elif isinstance(result, Failure):
                unused[job.label] = result.reason
                self.agenda.lost |= {work.name}
            elif work.kind == "data":
                simulated = ground_truth.Simulated(**result)
                worn = worn_in(job.label).garment
                seconds += simulated.seconds
                frames += simulated.frames
                ending = f"{simulated.status}: {simulated.reason}"
                if simulated.status != "converged":
                    rough[job.label] = ending
                if simulated.whole:
                    targets = self.targets.setdefault(worn, {})
                    targets[simulated.motion] = self.folder.path / simulated.files[0]
                else:
                    unused[job.label] = ending
        self.record.note("data", {
            "workers": plan.workers,
            "seconds": seconds,
            "frames": frames,
            "not_converged": rough,
            "unused": unused,
        })  # fmt: skip

    def train(self) -> None:
        """Train the networks, some at a time, one thread each."""
        from . import training

        plan = self.plan
        assert self.wardrobe is not None
        todo: dict[Work, Job] = {}
        networks: dict[Work, Network] = {}
        # The longest first: the workers then end at about the same time.
        for network in sorted(plan.networks, key=lambda network: -plan.preset.steps_of(network.name)):
            motions: Mapping[str, Path | None] = dict.fromkeys(plan.train_of(network.garment))
            if learns_from_simulation(network.name):
                motions = self.targets.get(network.garment, {})
            steps = plan.preset.steps_of(network.name)
            work = self.agenda.network(network)
            arguments = (network, steps, motions, plan.folder, plan.device, work.key)
            todo[work] = Job(network.label, training.train_network, arguments, steps)
            networks[work] = network
        results = self.finished(todo, title="training", unit="step")
        summary: dict[str, Any] = {"workers": plan.workers}
        for work, job in todo.items():
            result = results[work]
            if isinstance(result, Failure):
                self.untrained[networks[work]] = result.reason
                summary[job.label] = {"failed": result.reason}
            else:
                trained = training.Trained(**result)
                summary[job.label] = {
                    "recipe": trained.recipe,
                    "seconds": trained.seconds,
                    "setup_seconds": trained.setup_seconds,
                    "steps": trained.steps,
                    "last": trained.final,
                }
        self.record.note("training", summary)

    def finished(self, todo: Mapping[Work, Job], *, title: str, unit: str) -> dict[Work, Any]:
        """Of each piece of work its result, from its record or by a worker that writes one; or a Failure."""
        found = {work: self.records.find(work) for work in todo}
        wanted = [work for work in todo if found[work].wanted]
        jobs = [dataclasses.replace(todo[work], work=work, records=self.records) for work in wanted]
        ended = run_jobs(jobs, self.wardrobe, title=title, unit=unit, workers=self.plan.workers)
        results: dict[Work, Any] = {}
        for work, end in zip(wanted, ended):
            failed = isinstance(end, Failure)
            results[work] = end if failed else dataclasses.asdict(end)
            if failed:
                self.records.keep(work, {}, seconds=0.0, failed=end.reason)
                self.broken[end.label] = end.reason
        for work, job in todo.items():
            if work not in results:
                results[work] = self.kept(found[work], job.label)
        return results

    def kept(self, found: Found, label: str) -> Any:
        """What is used of work that is not done now: its result, or a Failure."""
        if found.state == "failed":
            self.broken[label] = found.why
            return Failure(label, found.why)
        if found.state == "stale":
            return Failure(label, f"out of date ({found.why} changed), and --only names other states")
        if found.state == "missing" or found.result is None:
            return Failure(label, LEFT_OUT)
        self.record.reused.append(label)
        return found.result

    def cells_and_metrics(self) -> list[Outcome]:
        """Cells one after another, alone; then metrics from their files, scenes side by side."""
        self.cells = Cells(self.plan, self.agenda, self.records, self.wardrobe)
        with self.record.stage("cells"):
            outcomes = self.cells.all(obstacle=self.obstacle, bar=_bar)
        self.record.reused += self.cells.reused
        self.record.note("outdated", self.cells.outdated)
        with self.record.stage("metrics"):
            rows = rows_of_cells(outcomes, self.agenda, self.records, self.wardrobe)
            self.record.rows += remarked(rows)
            self.record.write_rows()
        return outcomes

    def obstacle(self, cell: Cell) -> str | None:
        """Why the cell cannot be run, or None."""
        if cell.scene.dressed and self.naked:
            return self.naked
        if cell.scene.name in self.unsettled:
            return self.unsettled[cell.scene.name]
        network = network_of(cell)
        if network and (reason := self.untrained.get(network)):
            return f"its network could not be trained: {reason}"
        return None

    def make_report(self) -> bool:
        """tables/, figures/ and report.pdf from the files; a failure is said and leaves the results."""
        self.record.note("finished", now())
        try:
            with self.record.stage("report"):
                from reports.build import build_report

                _, problems = build_report(self.folder.path)
        except Exception as error:
            line = one_line(error)
            print(f"no report ({line}); the results are in {self.folder.path}", file=sys.stderr)
            return False
        for problem in problems:
            print(f"report: left out: {problem}", file=sys.stderr)
        return True


def _bar(items: Any, title: str, unit: str) -> Any:
    from tqdm import tqdm

    return tqdm(items, desc=title, unit=unit)
