"""A whole run: from its plan to its report."""

from __future__ import annotations

import os
import sys
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from benchmarks.external.roll_out_files import MODULE, RollOutFileError
from benchmarks.plan.plan import STATES, Plan, runs
from benchmarks.results.row import DECLARED, Row
from benchmarks.results.run_folder import RunFolder
from benchmarks.runner.cache import Cache, Cached
from benchmarks.runner.executor import Executor
from benchmarks.runner.isolated_process import one_line
from benchmarks.runner.loop import LEFT_OUT, Runner
from benchmarks.runner.rows import MOST_NAMED, SPREAD, first_of, rows_of
from benchmarks.runner.run_json import RunLog, now
from benchmarks.runner.schedule import tasks_of
from benchmarks.runner.task import Outcome, RunRefused, RunStopped

if TYPE_CHECKING:
    from benchmarks.assets import Assets


def summary(rows: Sequence[Row], stages: Iterable[dict[str, Any]], answer: str = "") -> str:
    """Return the answer, the text of page one if there is one, and one line of counts and times."""
    last = []
    for suite in dict.fromkeys(row.suite for row in rows):
        statuses = Counter(row.status for row in rows if row.suite == suite)
        last.append(f"{suite}: " + ", ".join(f"{count} {status}" for status, count in statuses.items()))
    times: Counter[str] = Counter()
    for stage in stages:
        times[stage["name"]] += stage["seconds"]
    longest = ", ".join(f"{name} {seconds:.0f} s" for name, seconds in times.most_common(MOST_NAMED))
    last += [f"time: {times.total():.0f} s ({longest})"] if times else []
    return "\n".join(filter(None, [answer, "; ".join(last)]))


def remarks(rows: Iterable[Row], reused: int, outdated: Mapping[str, str]) -> list[str]:
    """Return remarks for whoever reads the numbers, a line each. outdated: task -> what has changed since."""
    rows, lines = list(rows), []
    if reused:
        lines.append(f"{reused} results taken from earlier runs in this folder")
    lines += named([f"{label}: {remark}" for label, remark in outdated.items()], "outdated in run.json")
    spreads = {f"{row.scene} x {row.method}": row.value or 0.0 for row in rows if row.metric == "cost/spread"}
    wide = {cell: percent for cell, percent in spreads.items() if percent > 100.0 * SPREAD}
    if wide:
        cells = [f"{cell} ({wide[cell]:.0f} %)" for cell in sorted(wide, key=lambda cell: -wide[cell])]
        lines.append(f"repeats more than {100.0 * SPREAD:.0f} % apart: {first_of(cells)}")
    declared = dict.fromkeys(row.method for row in rows if row.declared)
    if declared:
        lines.append(f"run time {DECLARED}: {', '.join(declared)}")
    pretrained = {row.method: row.pretrained for row in rows if row.pretrained}
    if pretrained:
        differences = {remark.partition("; ")[2] for remark in pretrained.values()}
        same = differences.pop() if len(differences) == 1 else "the reasons of their rows say what differs"
        lines.append(f"pretrained, not trained here: {', '.join(pretrained)}; {same}")
    return lines


def named(lines: Sequence[str], where: str, most: int = MOST_NAMED) -> list[str]:
    """Return the first lines, and one that says how many more there are.

    >>> named(["a", "b", "c", "d", "e"], "in results.csv")
    ['a', 'b', 'c', 'and 2 more in results.csv']
    """
    more = len(lines) - most
    return [*lines[:most], *([f"and {more} more {where}"] if more > 0 else [])]


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
    from benchmarks.runner.cluster import Cluster  # loads dask

    try:
        return Executor(folder, assets, plan.workers, Cluster(folder, assets, plan.scheduler))
    except RunRefused as error:
        raise RunStopped(str(error)) from None


def check_roll_outs(plan: Plan) -> Assets | None:
    """Compare every stored roll-out with its scene before anything is written; return the assets made for it.

    Raises RollOutFileError.
    """
    stored = [cell for cell in plan.cells if cell.entry.module == MODULE]
    if not stored:
        return None
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
        print(f"report: {problem}", file=sys.stderr)
    return built.answer


@contextmanager
def held(folder: Path) -> Iterator[None]:
    """Hold a folder, made where it is not there. Raises RunRefused where another run, or a file, has it.

    A folder made here that stayed empty, because the request was refused, is removed.
    The lock lies on the folder itself and leaves no file. The system releases it with the process, however
    that ended. Where the system or its file system has no such locks nothing is held, and that is said.
    """
    made = not folder.exists()
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:  # as where a file is in the way
        raise RunRefused(f"--out {folder}: cannot be made ({error.strerror}); name another folder") from None
    with ExitStack() as closing:
        try:
            import fcntl

            hold = os.open(folder, os.O_RDONLY)
            closing.callback(os.close, hold)
            fcntl.flock(hold, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise RunRefused(
                f"--out {folder}: another run is going on there; wait for its end or name another folder"
            ) from None
        except (ImportError, OSError):
            print(f"{folder}: cannot be locked here; let no other run use it", file=sys.stderr)
        try:
            yield
        finally:
            if made:
                with suppress(OSError):  # not empty
                    folder.rmdir()


def describe(plan: Plan) -> str:
    """Return the plan in a few lines, and one line for each task. Starts nothing, writes nothing."""
    only = STATES if plan.fresh else plan.only
    runner = Runner(tasks_of(plan), Cache(RunFolder(plan.folder), only=only))
    lines, wanted, cached = _head(plan), list[Cached](), 0
    stage = ""
    for task, entry, outcome in runner.preview():
        if task.stage != stage:
            stage = task.stage
            lines.append(stage)
        lines.append(f"  {task.title}: {_verdict(entry, outcome)}")
        if outcome is None:
            wanted.append(entry)
        cached += outcome is not None and outcome is entry.outcome
    known = [entry.outcome.seconds for entry in wanted if entry.outcome and entry.outcome.seconds]
    times = f", about {sum(known):.0f} s for the {len(known)} whose time is known" if known else ""
    return "\n".join([*lines, f"{len(wanted)} tasks to run{times}; {cached} cached"])


def _head(plan: Plan) -> list[str]:
    skipped = sum(not runs(cell) for cell in plan.cells)
    lines = [
        f"preset {plan.preset.name}: {plan.preset.description}",
        f"folder {plan.folder}",
        f"suites {', '.join(plan.suites)}; seeds {', '.join(map(str, plan.seeds))}; device {plan.device}; "
        f"{plan.scheduler or f'{plan.workers} workers'}, timed cells alone here",
        *([f"body {plan.inputs.body.path}"] if plan.inputs.body else []),
        *map(partial(_size, plan), plan.garments),
    ]
    learning = {net.garment for net in plan.networks if net.training and net.training.simulated}
    for garment in dict.fromkeys(network.garment for network in plan.networks):
        how = "simulated for networks that learn from it" if garment in learning else "not simulated"
        how = f"networks of {plan.trained}" if plan.trained else how
        lines.append(f"training motions {', '.join(plan.motions.train)} ({how})")
    return [*lines, f"{len(plan.cells)} cells, {skipped} skipped, {len(plan.cases)} cases"]


def _size(plan: Plan, garment: str) -> str:
    if (user_garment := plan.inputs.garment) and garment == user_garment.name:
        return f"{garment} of {user_garment.path}"
    return f"{garment} of about {plan.preset.garment_vertices} vertices"


def _verdict(entry: Cached, outcome: Outcome | None) -> str:
    why = f" ({entry.state}{': ' * bool(entry.why)}{entry.why})"
    if outcome is None:
        took = f", {entry.outcome.seconds:.1f} s last time" if entry.outcome and entry.outcome.seconds else ""
        return f"run{why}{took}"
    if outcome is entry.outcome:
        return "cached" + (why if entry.state != "finished" else "")
    return f"left out{why}" if outcome.reason == LEFT_OUT else f"skip ({outcome.reason})"
