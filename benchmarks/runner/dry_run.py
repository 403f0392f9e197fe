"""Dry run: every task, its cache entry, and its duration where it is known."""

from __future__ import annotations

from functools import partial

from benchmarks.plan.plan import STATES, Plan, runs
from benchmarks.results.run_folder import RunFolder
from benchmarks.runner.cache import Cache, Cached
from benchmarks.runner.loop import LEFT_OUT, Runner
from benchmarks.runner.schedule import tasks_of
from benchmarks.tasks.task import Outcome


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
        return f"{garment} of {user_garment.file.path}"
    return f"{garment} of about {plan.preset.garment_vertices} vertices"


def _verdict(entry: Cached, outcome: Outcome | None) -> str:
    why = f" ({entry.state}{': ' * bool(entry.why)}{entry.why})"
    if outcome is None:
        took = f", {entry.outcome.seconds:.1f} s last time" if entry.outcome and entry.outcome.seconds else ""
        return f"run{why}{took}"
    if outcome is entry.outcome:
        return "cached" + (why if entry.state != "finished" else "")
    return f"left out{why}" if outcome.reason == LEFT_OUT else f"skip ({outcome.reason})"
