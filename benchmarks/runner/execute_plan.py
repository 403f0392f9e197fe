"""A whole run: from its plan to its report."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

from benchmarks.external.roll_out_option import MODULE, RollOutFileError
from benchmarks.plan.plan import Plan
from benchmarks.process.errors import one_line
from benchmarks.results.row import Row
from benchmarks.results.run_folder import RunFolder
from benchmarks.runner.console import named, remarks, summary
from benchmarks.runner.executor import Executor
from benchmarks.runner.loop import Runner
from benchmarks.runner.rows import rows_of
from benchmarks.runner.run_json import RunLog, now
from benchmarks.runner.schedule import tasks_of
from benchmarks.tasks.task import RunStopped

if TYPE_CHECKING:
    from benchmarks.assets.assets import Assets

MOST_FAILURES = 8  # that the end of a run names; its files have all


def execute(plan: Plan, assets: Assets | None = None, *, report: bool = True) -> int:
    """Run the plan, with its assets where they have been made; then make its report unless that is unwanted.

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
    log.note("finished", now())
    answer = make_report(log) if report else ""
    print(summary(log.rows, log.stages, answer or ""), flush=True)
    failed = [row for row in log.rows if not accepted(row)]
    ends = dict.fromkeys(f"{row.scene} x {row.method}: {row.status}: {row.reason}" for row in failed)
    broken = [f"{label}: {reason}" for label, reason in runner.broken().items()]
    for line in (
        *named(list(ends), "failed in results.csv", MOST_FAILURES),
        *named(broken, "failed in run.json", MOST_FAILURES),
        *remarks(log.rows, len(runner.reused), runner.outdated()),
    ):
        print(line, file=sys.stderr)
    if looks := log.config["test_looks"]:
        print(f"looks at the test motions from this folder: {len(looks)}", file=sys.stderr)
    if report and answer is not None:
        print(log.folder.report_path.resolve(), flush=True)
    return 0 if answer is not None and not (failed or broken) else 1


def executor_of(plan: Plan, folder: RunFolder, assets: Assets | None) -> Executor:
    """Return the executor of the plan's tasks. Raises RunStopped where its cluster is gone."""
    if not plan.scheduler:
        return Executor(folder, assets, plan.workers)
    from benchmarks.process.cluster_address import ClusterError
    from benchmarks.runner.cluster import Cluster  # loads dask

    try:
        return Executor(folder, assets, plan.workers, Cluster(folder, assets, plan.scheduler))
    except ClusterError as error:
        raise RunStopped(str(error)) from None


def check_roll_outs(plan: Plan) -> Assets | None:
    """Compare every stored roll-out with its scene before anything is written; return the assets made for it.

    Raises RollOutFileError.
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
        try:
            scene = cell.scene.build(assets)
        except RollOutFileError:
            raise
        except ValueError:
            continue  # of a scene that cannot be built the run says so itself, for all methods
        cell.entry.make(models=plan.folder, seed=0).prepare(scene)
    forget_roll_outs()  # each task that takes one reads it in its own process
    return assets


def accepted(row: Row) -> bool:
    """Return whether a row lets the run end with status 0; an extreme case may fail with a reason."""
    return row.passed or (row.suite == "extremes" and row.status != "failed" and bool(row.reason))


def make_report(log: RunLog) -> str | None:
    """Make the report and return its answer as text, None without a report.

    A failure is one line and leaves the results.
    """
    try:
        with log.stage("report"):
            from reports.build import build_report

            built = build_report(log.folder.path)
    except Exception as error:
        line = one_line(error)
        print(f"no report ({line}); the results are in {log.folder.path}", file=sys.stderr)
        return None
    for problem in built.problems:
        print(f"report: left out: {problem}", file=sys.stderr)
    return built.answer
