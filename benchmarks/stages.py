"""The stages of a run, in order, each timed: wardrobe, ground truth, training, cells, metrics, report.

What is written is written whole. A cell that fails is a row with its reason and the rest goes on.
"""

from __future__ import annotations

import dataclasses
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import datetime
from typing import TYPE_CHECKING, Any

from . import provenance
from .cell import Outcome, run_cell
from .methods import find_method
from .plan import Cell, Plan, runs
from .results import Row, RunFolder, with_provenance

if TYPE_CHECKING:
    from .jobs import Trained
    from .scene import BuiltScene
    from .wardrobe import Wardrobe


def execute(plan: Plan) -> int:
    """Run the plan. Returns 0 when every cell ended well, 1 when one failed or there is no report."""
    run = RunInProgress(plan)
    try:
        run.all_stages()
    except KeyboardInterrupt:
        run.note("interrupted", True)
        run.write_rows()
        raise
    made = run.make_report()
    from .closing import summary

    print(summary(run.rows, run.stages), flush=True)
    failed = [row for row in run.rows if not accepted(row)]
    for line in dict.fromkeys(f"{row.scene} x {row.method}: {row.status}: {row.reason}" for row in failed):
        print(line, file=sys.stderr)
    if made:
        print(run.folder.report_path.resolve(), flush=True)
    return 0 if made and not failed else 1


def accepted(row: Row) -> bool:
    """Whether a row lets the run end with status 0; an extreme case may fail honestly, never silently."""
    return row.passed or (row.suite == "extremes" and row.status != "failed" and bool(row.reason))


class RunInProgress:
    """The folder, the configuration and the rows of a run while it is going on."""

    def __init__(self, plan: Plan) -> None:
        self.plan = plan
        self.folder = RunFolder(plan.folder)
        self.hardware = provenance.hardware(plan.device)
        self.commit = provenance.commit()
        self.rows: list[Row] = []
        self.stages: list[dict[str, Any]] = []
        self.trained: dict[tuple[str, int], Trained] = {}
        self.untrained: dict[tuple[str, int], str] = {}  # why a network could not be trained
        self.data_seconds = 0.0
        self.targets: list[str] = []  # training motions with a whole simulation
        self.wardrobe: Wardrobe | None = None
        self.naked = ""  # why there is no wardrobe
        self.config: dict[str, Any] = {
            "command": plan.command,
            "preset": plan.preset.name,
            "suites": list(plan.suites),
            "scenes": [scene.name for scene in plan.scenes],
            "methods": list(dict.fromkeys(cell.method for cell in plan.cells)),
            "motions": {"train": list(plan.train), "test": list(plan.test)} if plan.needs_wardrobe else {},
            "seeds": list(plan.seeds),
            "commit": self.commit,
            "started": now(),
            "finished": None,
            "hardware": self.hardware,
            "versions": provenance.versions(),
            "preset_values": dataclasses.asdict(plan.preset),
            "stages": self.stages,
        }
        plan.folder.mkdir(parents=True, exist_ok=True)
        self.folder.write_config(self.config)

    def note(self, name: str, value: Any) -> None:
        """Set an entry of run.json and write it."""
        self.config[name] = value
        self.folder.write_config(self.config)

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Announce a stage and keep its wall time, also when it is interrupted."""
        print(f"== {name}", file=sys.stderr, flush=True)
        clock = time.perf_counter()
        try:
            yield
        finally:
            self.stages.append({"name": name, "seconds": round(time.perf_counter() - clock, 3)})
            self.folder.write_config(self.config)

    def all_stages(self) -> None:
        """Everything but the report."""
        plan = self.plan
        if plan.needs_wardrobe:
            with self.stage("body, T-shirt and motions"):
                self.open_wardrobe()
        if self.wardrobe is not None:
            with self.stage("ground truth"):
                self.ground_truth()
            if plan.models:
                with self.stage("training"):
                    self.train()
        if plan.cells:
            outcomes = self.cells_and_metrics()
            failed = sum(outcome.status == "failed" for outcome in outcomes)
            self.note("cells", {"run": sum(map(runs, plan.cells)), "failed": failed})
        if plan.checks:
            with self.stage("validation"):
                from .suites.validation import run_check

                self.rows += [run_check(check) for check in _bar(plan.checks, "validation", "check")]
        if plan.cases:
            with self.stage("extremes"):
                from .suites.extremes import run_case

                self.rows += [run_case(case) for case in _bar(plan.cases, "extremes", "case")]
        self.write_rows()

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
        self.note("garment", {
            "name": garment.name, "vertices": len(garment.rest_positions), "triangles": len(garment.faces),
            "parameters": {name: float(value) for name, value in garment.parameters.items()},
        })  # fmt: skip
        motions_of = self.wardrobe.motions
        self.config["motions"]["frames"] = {name: motions_of[name].frames for name in names}
        self.note("motion_sources", {name: motions_of[name].source or "embedded library" for name in names})

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
        self.note("data", {
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
        for kind, seed in plan.models:
            motions = self.targets if kind == "supervised" else list(plan.train)
            steps = plan.preset.steps.get(kind, 0)
            arguments = (kind, seed, steps, motions, plan.folder, plan.device)
            todo.append(Job(f"{kind} seed {seed}", jobs.train_network, arguments, steps))
        results = run_jobs(todo, self.wardrobe, title="training", unit="step")
        summary: dict[str, Any] = {"workers": worker_count()}
        for (kind, seed), job, result in zip(plan.models, todo, results):
            if isinstance(result, Failure):
                self.untrained[kind, seed] = result.reason
                summary[job.label] = {"failed": result.reason}
            else:
                self.trained[kind, seed] = result
                summary[job.label] = {"seconds": result.seconds, "steps": result.steps, "last": result.final}
        self.note("training", summary)

    def cells_and_metrics(self) -> list[Outcome]:
        """Cells one after another, nothing beside them; then metrics from their files, scene by scene."""
        outcomes: list[Outcome] = []
        built: dict[str, BuiltScene] = {}
        with self.stage("cells"):
            for cell in _bar(self.plan.cells, "cells", "cell"):
                outcomes.append(self.one_cell(cell, built))
        with self.stage("metrics"):
            for scene in _bar(self.plan.scenes, "metrics", "scene"):
                of_scene = [outcome for outcome in outcomes if outcome.cell.scene == scene]
                self.rows += self.measured(of_scene, built.get(scene.name))
            self.write_rows()
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

    def write_rows(self) -> None:
        """results.csv with the rows so far."""
        self.rows = with_provenance(
            self.rows,
            preset=self.plan.preset.name,
            commit=self.commit,
            hardware=provenance.hardware_line(self.hardware),
        )
        self.folder.write_rows(self.rows)

    def make_report(self) -> bool:
        """tables/, figures/ and report.pdf from the files; a failure is said and leaves the results."""
        self.note("finished", now())
        try:
            with self.stage("report"):
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


def now() -> str:
    """The time as ISO text with its zone."""
    return datetime.now().astimezone().isoformat(timespec="seconds")


def _bar(items: Any, title: str, unit: str) -> Any:
    from tqdm import tqdm

    return tqdm(items, desc=title, unit=unit)
