"""A whole run: from its plan to its report."""

from __future__ import annotations

import fcntl
import os
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

from benchmarks.external.roll_out_files import MODULE as STORED
from benchmarks.external.roll_out_files import RollOutFileError
from benchmarks.plan.plan import Plan, runs
from benchmarks.results.row import USABLE, Row
from benchmarks.results.run_folder import RunFolder
from benchmarks.runner.cache import Cache
from benchmarks.runner.executor import Executor
from benchmarks.runner.loop import Runner
from benchmarks.runner.progress import Progress
from benchmarks.runner.rows import rows_of
from benchmarks.runner.run_json import RunLog
from benchmarks.runner.schedule import tasks_of
from benchmarks.runner.task import RunRefused, Task, one_line

if TYPE_CHECKING:
    from benchmarks.assets import Assets


MOST_FAILURES = 8  # that the end of a run names; its files have all


def execute(plan: Plan, assets: Assets | None = None) -> int:
    """Run the plan, with its assets where they have been made; then make its report.

    Returns 0 when all ended well, 1 when something failed or there is no report. Raises RunRefused where
    no network in the files that the plan names is of its meshes and motions.
    """
    tasks = tasks_of(plan)
    networks = [task for task in tasks if task.kind == "network"]
    readers = [task for task in networks if task.inputs.get("file")]
    if readers and all(task.skip for task in networks):
        raise RunRefused(readers[0].skip)  # all else is there to be compared with them
    log = RunLog(plan)
    runner = Runner(tasks, log.cache)
    if plan.garments:
        try:
            assets = log.open_assets(assets)
        except ValueError as error:  # all dressed scenes fail, for the same reason; the others go on
            runner.refuse(("start", "data", "clips", "network"), one_line(error))
    runner.run(Executor(log.folder, assets, plan.workers))
    rows = rows_of(plan, runner.tasks, runner.outcomes)
    log.write_rows(rows)
    log.note_outcomes(runner)
    answer = make_report(log)
    if answer:
        print(answer, flush=True)
    failed = [row for row in log.rows if not is_accepted(row)]
    ends = dict.fromkeys(f"{row.scene} x {row.method}: {row.status}: {row.reason}" for row in failed)
    lines = [*ends, *runner.broken()]
    if failures := len(lines):
        lines[MOST_FAILURES:] = ["more in results.csv and run.json"] * (failures > MOST_FAILURES)
    methods = {row.method for row in log.rows if row.status != "skipped"}
    reasons = {row.method: row.reason for row in log.rows if row.method not in methods}
    lines += [f"{method}: skipped: {reason}" for method, reason in reasons.items()]
    if runner.reused:
        lines.append(f"{len(runner.reused)} results taken from earlier runs in this folder")
    print(*lines, sep="\n", end="\n" if lines else "", file=sys.stderr)
    if answer is not None:
        print(*ends_with(log.folder, log.rows), sep="\n", flush=True)
    return 0 if answer is not None and not failures else 1


def ends_with(folder: RunFolder, rows: Sequence[Row]) -> Iterator[str]:
    """Yield paths of a run's page, PDF and rows, and commands that may come next."""
    for path in (folder.page_path, folder.report_path, folder.rows_path):
        yield f"{path.suffix[1:]:4}  {path.resolve()}"
    costs = [row for row in rows if row.status in USABLE and row.metric == "cost/frame"]
    if costs:
        methods = list(dict.fromkeys(row.method for row in costs if row.scene == costs[0].scene))
        options = f"--scene {costs[0].scene} --methods {','.join(methods[:4])}"
        yield f"film  python -m reports.film {folder.path} {options} -o film.gif"
    yield f"beside another run  python -m reports.compare {folder.path} OTHER"
    yield "more motions and methods  python -m benchmarks.run full"


class NotSettled(Exception):
    """A method asks for a start that is not simulated yet."""


def _refuse_start() -> NoReturn:
    raise NotSettled


def check_methods(plan: Plan) -> Assets | None:
    """Prepare stored roll-outs and a user's methods before anything is written; return assets.

    Each roll-out has to fit its scene, and a method to be prepared for its first, up to where it asks for
    the start. Methods are not asked whose network is still to be trained.

    Raises RollOutFileError, and RunRefused with what a method says.
    """
    cells = [cell for cell in plan.cells if runs(cell)]
    users = (cell for cell in reversed(cells) if cell.entry.declared_in and not cell.entry.trained)
    checked = [cell for cell in cells if cell.entry.module == STORED]
    checked += {cell.method: cell for cell in users}.values()
    assets = None
    with suppress(ValueError):  # the run says itself what cannot be made
        assets = plan.open_assets() if plan.garments and checked else None
    for cell in checked:
        try:
            scene = replace(cell.scene.build(assets), settle=_refuse_start)
        except Exception:  # whatever a user's code raises: the cell itself says it
            continue
        try:
            with suppress(NotSettled):
                cell.entry.make(models=plan.folder, seed=cell.seed).prepare(scene)
        except RollOutFileError:
            raise
        except Exception as error:
            raise RunRefused(f"{cell.label}: cannot be prepared: {one_line(error)}") from None
    return assets


def is_accepted(row: Row) -> bool:
    """Return whether a row lets the run end well; an extreme case may fail with a reason."""
    may_end = row.suite == "extremes" and row.status != "failed" and bool(row.reason)
    return row.status in ("ok", "skipped") or may_end


def make_report(log: RunLog) -> str | None:
    """Make the report and return its answer as text, None without a report.

    A failure is one line and leaves the results.
    """
    print("report", file=sys.stderr, flush=True)
    try:
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
    """Hold a folder, made if absent. Raises RunRefused where another run, or a file, has it.

    The lock lies on the folder itself and leaves no file; it ends with the process. Where the file system
    has no such locks nothing is held, and that is said.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:  # as where a file is in the way
        raise RunRefused(f"--out {folder}: cannot be made ({error.strerror}); name another") from None
    with ExitStack() as closing:
        try:
            hold = os.open(folder, os.O_RDONLY)
            closing.callback(os.close, hold)
            fcntl.flock(hold, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise RunRefused(
                f"--out {folder}: another run is going on there; wait for its end or name another folder"
            ) from None
        except OSError:
            print(f"{folder}: cannot be locked here; let no other run use it", file=sys.stderr)
        yield


def describe(plan: Plan) -> str:
    """Return the plan in a few lines, and a line for each task. Writes nothing."""
    folder = RunFolder(plan.folder / "none" if plan.fresh else plan.folder)
    study, skipped, stage = plan.study, sum(not runs(cell) for cell in plan.cells), ""
    todo: list[Task] = []
    lines = [
        f"preset {study.sizes.name}: {study.sizes.description}",
        f"folder {plan.folder}",
        f"parts {', '.join(study.parts)}; seeds {', '.join(map(str, study.seeds))}; device {study.device}; "
        f"{plan.workers} workers, timed cells alone here",
        *(str(file.path) for file in (plan.inputs.body, plan.inputs.garment) if file),
        f"{len(plan.cells)} cells, {skipped} skipped, {len(plan.cases)} cases",
    ]
    counts: Counter[str] = Counter()
    for task, reason, outcome in Runner(tasks_of(plan), Cache(folder, retry=plan.retry)).preview():
        if task.stage != stage:
            stage = task.stage
            lines.append(stage)
        state = "run" if outcome is None else "cached" if outcome.content else "skip"
        lines.append(f"  {task.title}: {state}" + f" ({reason})" * bool(reason))
        counts[state] += 1
        todo += [task] * (state == "run")
    time_left = Progress(todo, plan.workers).time_left()
    return "\n".join([*lines, f"{counts['run']} tasks to run, {time_left}; {counts['cached']} cached"])
