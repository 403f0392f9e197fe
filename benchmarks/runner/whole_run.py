"""run.json and results.csv of a run, and everything that it does from its first file to its report."""

from __future__ import annotations

import dataclasses
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from datetime import datetime
from typing import TYPE_CHECKING, Any

from benchmarks import provenance
from benchmarks.external.roll_out_option import MODULE
from benchmarks.fingerprint.digest import digest, digest_of_file
from benchmarks.plan.plan import Plan, runs
from benchmarks.process.errors import one_line
from benchmarks.results import frame_energies
from benchmarks.results.run_folder import OF_TRAINING, Row, RunFolder, with_provenance
from benchmarks.rows import described, rows_of
from benchmarks.runner.cache import Cache
from benchmarks.runner.console import remarks, summary
from benchmarks.runner.local_executor import Executor, LocalExecutor
from benchmarks.runner.loop import Runner
from benchmarks.runner.schedule import tasks_of
from benchmarks.tasks.task import RunStopped

if TYPE_CHECKING:
    from benchmarks.assets.assets import Assets

KEPT = ("command", "commit", "started", "finished", "stages")  # of an earlier run in the folder
OF_ROWS = ("metrics", "methods", "scenes", "cases", "digests", "tasks", "cells", "outdated")


def execute(plan: Plan, assets: Assets | None = None) -> int:
    """Run the plan, with its assets where they have been made.

    Returns 0 when all ended well, 1 when something failed or there is no report.
    """
    tasks = tasks_of(plan)
    log = RunLog(plan)
    runner = Runner(tasks, log.cache)
    try:
        if plan.garments:
            try:
                assets = log.open_assets(assets)
            except ValueError as error:  # all dressed scenes fail, for the same reason; the others go on
                runner.refuse(("start", "data", "clips", "network"), one_line(error))
        runner.run(executor_of(plan, log.folder, assets), log)
    except (KeyboardInterrupt, RunStopped):
        log.note("interrupted", True)
        rows = rows_of(plan, runner.tasks, runner.known())
        if rows or not log.folder.rows_path.is_file():  # nothing known is no reason to lose a table
            log.write_rows(rows)
        raise
    rows = rows_of(plan, runner.tasks, runner.outcomes)
    log.write_rows(rows)
    log.note_outcomes(runner)
    made = log.make_report()
    print(summary(log.rows, log.stages), flush=True)
    failed = [row for row in log.rows if not accepted(row)]
    for line in dict.fromkeys(f"{row.scene} x {row.method}: {row.status}: {row.reason}" for row in failed):
        print(line, file=sys.stderr)
    broken = runner.broken()
    for label, reason in broken.items():
        print(f"{label}: {reason}", file=sys.stderr)
    for line in remarks(log.rows, len(runner.reused), runner.outdated()):
        print(line, file=sys.stderr)
    if looks := log.config["test_looks"]:
        print(f"looks at the test motions from this folder: {len(looks)}", file=sys.stderr)
    if made:
        print(log.folder.report_path.resolve(), flush=True)
    return 0 if made and not (failed or broken) else 1


def executor_of(plan: Plan, folder: RunFolder, assets: Assets | None) -> Executor:
    """What executes the plan's tasks. Raises RunStopped where its cluster is gone."""
    if not plan.scheduler:
        return LocalExecutor(folder, assets, plan.workers)
    from benchmarks.process.scheduler import ClusterError
    from benchmarks.runner.cluster import ClusterExecutor

    try:
        return ClusterExecutor(folder, assets, plan.workers, plan.scheduler)
    except ClusterError as error:
        raise RunStopped(str(error)) from None


def check_roll_outs(plan: Plan) -> Assets | None:
    """Compare every stored roll-out with its scene before anything is written; gives the assets that it made.

    Raises RollOutError.
    """
    stored = [cell for cell in plan.cells if cell.entry.module == MODULE]
    if not stored:
        return None
    from benchmarks.external.roll_out_files import forget_roll_outs  # loads numpy

    try:
        assets = plan.open_assets() if plan.garments else None
    except ValueError:
        return None  # the run says so itself, of all dressed scenes
    for cell in stored:
        cell.entry.make(models=plan.folder, seed=0).prepare(cell.scene.build(assets))
    forget_roll_outs()  # each task that takes one reads it in its own process
    return assets


def accepted(row: Row) -> bool:
    """Whether a row lets the run end with status 0; an extreme case may fail honestly, never silently."""
    return row.passed or (row.suite == "extremes" and row.status != "failed" and bool(row.reason))


class RunLog:
    """The configuration, the stages and the rows of one run. Making it makes the folder."""

    def __init__(self, plan: Plan) -> None:
        self.plan = plan
        body, garment = plan.inputs.body, plan.inputs.garment
        self.folder = RunFolder(plan.folder)
        self.hardware = provenance.hardware(plan.device)
        # Only training uses an accelerator: its rows name it, see write_rows.
        hardware = provenance.hardware_line(self.hardware | {"accelerator": None})
        self.origin = {"commit": provenance.commit(), "preset": plan.preset.name, "hardware": hardware}
        self.cache = Cache(self.folder, only=plan.only, origin=self.origin)
        self.rows: list[Row] = []
        self.stages: list[dict[str, Any]] = []
        before = self.folder.read_config() if self.folder.config_path.is_file() else {}
        runs_before = [{name: before.get(name) for name in KEPT}] if before else []
        self.config: dict[str, Any] = {
            "command": plan.command,
            "preset": plan.preset.name,
            "suites": list(plan.suites),
            "motions": {
                f"{what} {garment}": list(names(garment))
                for garment in plan.garments
                for what, names in (
                    ("train", plan.motions.train_of),
                    ("validation", plan.motions.validation_of),
                    ("test", plan.motions.test_of),
                )
            },
            "split": plan.motions.split,
            "body": [body.path.name, body.digest] if body else "of the package",
            "garment": [garment.file.path.name, garment.digest] if garment else "tailored",
            "seeds": list(plan.seeds),
            "clock": {"name": "time.perf_counter", "threads": 1, "cells_at_a_time": 1},
            "workers": plan.workers,
            "scheduler": plan.scheduler or None,
            "commit": self.origin["commit"],
            "started": now(),
            "finished": None,
            "hardware": self.hardware,
            "versions": provenance.versions(),
            "preset_values": dataclasses.asdict(plan.preset),
            "stages": self.stages,
            # Earlier runs in this folder: their stages are the times of what this one reuses.
            "earlier": [*(before.get("earlier") or []), *runs_before],
            "test_looks": before.get("test_looks") or [],
            # What the rows there mean, until there are others.
            **{name: before[name] for name in OF_ROWS if name in before},
        }
        plan.folder.mkdir(parents=True, exist_ok=True)
        self.folder.remove_parts()
        if plan.fresh:
            self.cache.forget_all()
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

    def open_assets(self, made: Assets | None = None) -> Assets:
        """Body, garments and motions of the dressed scenes. Raises ValueError where one cannot be made."""
        with self.stage("body, garments and motions"):
            assets = made or self.plan.open_assets()
        self.config["garments"] = {
            garment.name: {
                "vertices": len(garment.rest_positions),
                "triangles": len(garment.faces),
                "parameters": {name: float(value) for name, value in garment.parameters.items()},
                "material": dataclasses.asdict(garment.material),
            }
            for garment in assets.garments.values()
        }
        motions = assets.motions
        self.config["motions"]["frames"] = {name: motion.frames for name, motion in motions.items()}
        self.note("motion_sources", {name: motion.source for name, motion in motions.items()})
        return assets

    def note_outcomes(self, runner: Runner) -> None:
        """What became of ground truth, trainings and cells, and what the rows mean."""
        of_kind: dict[str, dict[str, Any]] = {}
        for task in runner.tasks:
            outcome = runner.outcomes[task.id]
            if task.silent:
                failed = {"failed": f"{outcome.status}: {outcome.reason}"} if outcome.failed else {}
                facts = {**outcome.result, **failed, "wall_seconds": round(outcome.seconds, 3)}
                of_kind.setdefault(task.stage, {})[task.label] = facts
        outcomes = [runner.outcomes["cell", cell.name] for cell in self.plan.cells if runs(cell)]
        cells = {"run": len(outcomes), "failed": sum(outcome.failed for outcome in outcomes)}
        self.config |= {"tasks": of_kind, "cells": cells, "outdated": runner.outdated()}
        for outcome in runner.outcomes.values():
            self.config["digests"] |= outcome.digests
        self.folder.write_config(self.config)

    def write_rows(self, rows: Sequence[Row]) -> None:
        """results.csv, energies of frames, and what run.json says of them."""
        everything = provenance.hardware_line(self.hardware)
        self.rows = [
            dataclasses.replace(row, hardware=everything)
            if row.metric in OF_TRAINING and row.hardware == self.origin["hardware"]
            else row
            for row in with_provenance(rows, **self.origin)
        ]
        self.count_look()
        self.folder.write_rows(self.rows)
        frame_energies.write(self.folder, self.rows)
        self.config |= described(self.plan, self.rows)
        written = (self.folder.rows_path, self.folder.frame_energies_path)
        self.config["digests"] = {path.name: digest_of_file(path) for path in written if path.is_file()}
        self.folder.write_config(self.config)

    def count_look(self) -> None:
        """Add a look at the test motions where the rows hold numbers of them that no earlier look had."""
        role_of = self.plan.motions.role_of
        tests = {scene.name for scene in self.plan.scenes if role_of(scene.motion) == "test"}
        rows = [row for row in self.rows if row.scene in tests]
        seen = [[row.scene, row.method, row.seed, row.metric, row.value] for row in rows]
        look = {"started": self.config["started"], "commit": self.origin["commit"], "rows": digest(seen)}
        if seen and look["rows"] not in [earlier.get("rows") for earlier in self.config["test_looks"]]:
            self.config["test_looks"] = [*self.config["test_looks"], look]

    def make_report(self) -> bool:
        """tables/, figures/, report.html and report.pdf; a failure is said and leaves the results."""
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


def now() -> str:
    """The time as ISO text with its zone."""
    return datetime.now().astimezone().isoformat(timespec="seconds")
