"""The stages of a run, in order, each timed: wardrobe, ground truth, training, cells, metrics, report.

What is written is written whole. A cell that fails is a row with its reason and the rest goes on.
"""

from __future__ import annotations

import dataclasses
import sys
from typing import TYPE_CHECKING, Any

from snug.recipe import learns_from_simulation

from .cell import Outcome, run_cell
from .methods import find_method
from .plan import Cell, Plan, runs
from .record import Record, now
from .results import Row

if TYPE_CHECKING:
    from .jobs import Trained
    from .scene import BuiltScene
    from .wardrobe import Wardrobe


def execute(plan: Plan) -> int:
    """Run the plan. Returns 0 when every cell ended well, 1 when one failed or there is no report."""
    record = Record(plan)
    stages = Stages(record)
    try:
        stages.run()
    except KeyboardInterrupt:
        record.note("interrupted", True)
        record.write_rows()
        raise
    made = stages.make_report()
    from .closing import summary

    print(summary(record.rows, record.stages), flush=True)
    failed = [row for row in record.rows if not accepted(row)]
    for line in dict.fromkeys(f"{row.scene} x {row.method}: {row.status}: {row.reason}" for row in failed):
        print(line, file=sys.stderr)
    if made:
        print(record.folder.report_path.resolve(), flush=True)
    return 0 if made and not failed else 1


def accepted(row: Row) -> bool:
    """Whether a row lets the run end with status 0; an extreme case may fail honestly, never silently."""
    return row.passed or (row.suite == "extremes" and row.status != "failed" and bool(row.reason))


class Stages:
    """Everything that a run does, one stage after another."""

    def __init__(self, record: Record) -> None:
        self.record = record
        self.plan, self.folder = record.plan, record.folder
        self.trained: dict[tuple[str, int], Trained] = {}
        self.untrained: dict[tuple[str, int], str] = {}  # why a network could not be trained
        self.data_seconds = 0.0
        self.targets: list[str] = []  # training motions with a whole simulation
        self.wardrobe: Wardrobe | None = None
        self.naked = ""  # why there is no wardrobe

    def run(self) -> None:
        """Everything but the report."""
        plan = self.plan
        if plan.needs_wardrobe:
            with self.record.stage("body, T-shirt and motions"):
                self.open_wardrobe()
        if self.wardrobe is not None:
            with self.record.stage("ground truth"):
                self.ground_truth()
            if plan.models:
                with self.record.stage("training"):
                    self.train()
        if plan.cells:
            outcomes = self.cells_and_metrics()
            failed = sum(outcome.status == "failed" for outcome in outcomes)
            self.record.note("cells", {"run": sum(map(runs, plan.cells)), "failed": failed})
        if plan.checks:
            with self.record.stage("validation"):
                from .suites.validation import run_check

                self.record.rows += [run_check(check) for check in _bar(plan.checks, "validation", "check")]
        if plan.cases:
            with self.record.stage("extremes"):
                from .suites.extremes import run_case

                self.record.rows += [run_case(case) for case in _bar(plan.cases, "extremes", "case")]
        for study in plan.studies:
            with self.record.stage(f"{study.suite}: {study.name}"):
                self.record.rows += study.run(plan, self.folder, self.wardrobe)
        self.record.write_rows()

    def open_wardrobe(self) -> None:
        from .wardrobe import embedded_motions, open_wardrobe

        plan = self.plan
        names = [*plan.test, *(plan.train if plan.needs_training_motions else ())]
        motions = [plan.files[name] for name in names if name in plan.files]
        motions += embedded_motions(name for name in names if name not in plan.files)
        try:
            self.wardrobe = open_wardrobe(plan.preset, motions)
        except ValueError as error:  # of all cells only the dressed ones fail
            self.naked = one_line(error)
            return
        garment = self.wardrobe.garment
        self.record.note("garment", {
            "name": garment.name, "vertices": len(garment.rest_positions), "triangles": len(garment.faces),
            "parameters": {name: float(value) for name, value in garment.parameters.items()},
        })  # fmt: skip
        motions_of = self.wardrobe.motions
        self.record.config["motions"]["frames"] = {name: motions_of[name].frames for name in names}
        self.record.note("motion_sources", {name: motions_of[name].source for name in names})

    def ground_truth(self) -> None:
        """Settle every dressed scene and simulate the training motions, two at a time."""
        from . import jobs
        from .workers import Failure, Job, run_jobs, worker_count

        plan, preset = self.plan, self.plan.preset
        assert self.wardrobe is not None
        simulated = [cell for cell in plan.cells if not find_method(cell.method).needs_body]
        todo = []
        for name in dict.fromkeys(cell.scene.name for cell in simulated if cell.scene.dressed):
            todo.append(Job(name, jobs.settle, (name, preset, plan.folder), preset.settle_frames))
        for motion in plan.train if plan.needs_targets else ():
            units = preset.settle_frames + self.wardrobe.motions[motion].frames
            todo.append(Job(motion, jobs.simulate_motion, (motion, preset, plan.folder), units))
        results = run_jobs(todo, self.wardrobe, title="simulating", unit="frame")
        unused = {}
        for job, result in zip(todo, results):
            if isinstance(result, jobs.Simulated):
                self.data_seconds += result.seconds
                if result.whole:
                    self.targets.append(result.motion)
                else:
                    unused[result.motion] = f"{result.status}: {result.reason}"
            elif isinstance(result, Failure):
                unused[job.label] = result.reason
        done = [result for result in results if isinstance(result, jobs.Simulated)]
        rough = {r.motion: f"{r.status}: {r.reason}" for r in done if r.status != "converged"}
        self.record.note("data", {
            "workers": worker_count(),
            "seconds": self.data_seconds,
            "frames": sum(result.frames for result in done),
            "not_converged": rough,
            "unused": unused,
        })  # fmt: skip

    def train(self) -> None:
        """Train the networks, two at a time, one thread each."""
        from . import jobs
        from .workers import Failure, Job, run_jobs, worker_count

        plan = self.plan
        assert self.wardrobe is not None
        todo = []
        # The longest first: two workers then end at about the same time.
        models = sorted(plan.models, key=lambda model: -plan.preset.steps_of(model[0]))
        for kind, seed in models:
            motions = self.targets if learns_from_simulation(kind) else list(plan.train)
            steps = plan.preset.steps_of(kind)
            arguments = (kind, seed, steps, motions, plan.folder, plan.device)
            todo.append(Job(f"{kind} seed {seed}", jobs.train_network, arguments, steps))
        results = run_jobs(todo, self.wardrobe, title="training", unit="step")
        summary: dict[str, Any] = {"workers": worker_count()}
        for (kind, seed), job, result in zip(models, todo, results):
            if isinstance(result, Failure):
                self.untrained[kind, seed] = result.reason
                summary[job.label] = {"failed": result.reason}
            else:
                self.trained[kind, seed] = result
                summary[job.label] = {
                    "recipe": result.recipe,
                    "seconds": result.seconds,
                    "steps": result.steps,
                    "last": result.final,
                }
        self.record.note("training", summary)

    def cells_and_metrics(self) -> list[Outcome]:
        """Cells one after another, nothing beside them; then metrics from their files, scene by scene."""
        outcomes: list[Outcome] = []
        built: dict[str, BuiltScene] = {}
        with self.record.stage("cells"):
            for cell in _bar(self.plan.cells, "cells", "cell"):
                outcomes.append(self.one_cell(cell, built))
        with self.record.stage("metrics"):
            for scene in _bar(self.plan.scenes, "metrics", "scene"):
                of_scene = [outcome for outcome in outcomes if outcome.cell.scene == scene]
                self.record.rows += self.measured(of_scene, built.get(scene.name))
            self.record.write_rows()
        return outcomes

    def one_cell(self, cell: Cell, built: dict[str, BuiltScene]) -> Outcome:
        entry = find_method(cell.method)
        if reason := entry.skip(cell.scene):
            return Outcome(cell, "skipped", reason)
        if cell.scene.dressed and self.naked:
            return Outcome(cell, "failed", self.naked)
        if entry.trained and (reason := self.untrained.get((entry.trained, cell.seed))):
            return Outcome(cell, "failed", f"its network could not be trained: {reason}")
        try:
            if cell.scene.name not in built:
                built[cell.scene.name] = self.build(cell)
        except Exception as error:
            return Outcome(cell, "failed", one_line(error))
        return run_cell(cell, built[cell.scene.name], self.folder, device=self.plan.device)

    def build(self, cell: Cell) -> BuiltScene:
        """The scene; a dressed one starts where the workers settled it, and its body is written as a mesh."""
        scene = cell.scene.build(self.plan.preset, self.wardrobe)
        if not cell.scene.dressed:
            return scene
        import numpy as np

        from .jobs import start_path

        path = start_path(self.folder, scene.name)
        if path.is_file():
            start = np.load(path)
            scene = dataclasses.replace(scene, settle=lambda: start)
        self.write_body(scene)
        return scene

    def write_body(self, scene: BuiltScene) -> None:
        """trajectories/<scene>/body.vtkhdf, to look at the garments upon."""
        import numpy as np

        from reference_sim import Trajectory

        assert scene.obstacle is not None
        path = self.folder.trajectory_path(scene.name, "body")
        path.parent.mkdir(parents=True, exist_ok=True)
        Trajectory(
            positions=scene.obstacle.positions.astype(np.float32),  # for the eye: half the size
            faces=scene.obstacle.faces,
            times=np.arange(scene.frames) * scene.dt,
            frame_seconds=np.full(scene.frames, np.nan),
            provenance={"what": "the body of this scene"},
        ).save(path)

    def measured(self, outcomes: list[Outcome], scene: BuiltScene | None) -> list[Row]:
        """The rows of all cells of one scene."""
        from .evaluate import measure_scene, model_costs, rows_of

        recorded = [outcome for outcome in outcomes if outcome.recorded]
        networks = [(find_method(o.cell.method).trained or "", o.cell.seed) for o in recorded]
        costs = [model_costs(self.trained.get(network), self.data_seconds) for network in networks]
        metrics: list[dict[str, float]] = []
        try:
            if scene is not None and recorded:
                samples = self.plan.preset.gap_samples
                metrics = measure_scene(recorded, scene, self.folder, costs, gap_samples=samples)
        except Exception as error:
            reason = f"metrics: {one_line(error)}"
            failed = {o.cell: dataclasses.replace(o, status="failed", reason=reason) for o in recorded}
            outcomes = [failed.get(outcome.cell, outcome) for outcome in outcomes]
        by_cell = {outcome.cell: found for outcome, found in zip(recorded, metrics)}
        return [row for outcome in outcomes for row in rows_of(outcome, by_cell.get(outcome.cell, {}), scene)]

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


def one_line(error: Exception) -> str:
    """What was raised, in one line."""
    return " ".join(f"{type(error).__name__}: {error}".split())


def _bar(items: Any, title: str, unit: str) -> Any:
    from tqdm import tqdm

    return tqdm(items, desc=title, unit=unit)
