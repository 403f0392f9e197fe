"""Tasks that fail, are blocked or cannot be kept, the order of all, and what the next run does of them."""

from __future__ import annotations

import dataclasses
import os
import signal
import time
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from benchmarks.methods import find_method
from benchmarks.plan.motions import Motions
from benchmarks.plan.plan import Network
from benchmarks.results.run_folder import RunFolder
from benchmarks.runner import execute_plan as execution
from benchmarks.runner.cache import Cache
from benchmarks.runner.execute_plan import describe
from benchmarks.runner.executor import Executor
from benchmarks.runner.loop import Runner
from benchmarks.runner.rows import rows_of
from benchmarks.runner.schedule import Schedule, tasks_of
from benchmarks.runner.task import Outcome, Task
from benchmarks.validation.case import Case
from benchmarks.validation.registry import CASES, KNOWN_ANSWERS, STRESS_TESTS
from tests.benchmarks.runner.tasks_by_hand import InProcess
from tests.benchmarks.runner.test_cell_tasks import finish, plan_of


def write(name, dies, context, needed):
    """Write a file, or die."""
    if dies:
        os.kill(os.getpid(), signal.SIGKILL)
    path = context.folder.path / f"{name}.txt"
    path.write_text("".join(outcome.result["word"] for outcome in needed.values()) or "first")
    return Outcome(result={"word": name}, files=(path.name,))


def task(name: str, *, dies: bool = False, value: int = 0, **ties) -> Task:
    return Task(
        kind="network", name=name, label=name, stage="writing", run=partial(write, name, dies), silent=True,
        inputs={"value": value}, code=("benchmarks/results",), **ties,
    )  # fmt: skip


def run_tasks(folder: Path, *tasks: Task, only=("stale", "missing")) -> Runner:
    runner = Runner(tasks, Cache(RunFolder(folder), only=only))
    runner.run(Executor(RunFolder(folder), None, 1))
    return runner


class TwoAtOnce(InProcess):
    """Two workers, of which the one that began first ends first; writes down what is at work at a time."""

    side_by_side = 2

    def __init__(self, folder: RunFolder) -> None:
        super().__init__(folder)
        self.at_work: list[list[str]] = []

    def together(self, ready, bar):
        begun = []
        while True:
            while len(begun) < 2 and (batch := ready()):
                begun.append(batch)
            if not begun:
                return
            self.at_work.append([task.name for tasks, _ in begun for task in tasks])
            tasks, needed = begun.pop(0)
            for task in tasks:
                yield task, task.run(self.context(), needed)

    def alone(self, task, needed):
        self.at_work.append([task.name])
        return super().alone(task, needed)


def test_a_task_begins_when_its_needs_are_there_and_nothing_is_beside_a_timed_task(tmp_path):
    def ids(*names: str) -> tuple[tuple[str, str], ...]:
        return tuple(("network", name) for name in names)

    tasks = (
        task("short"), task("long", seconds=5.0), task("next", needs=ids("short", "long")),
        task("timed", needs=ids("next"), process="own"),
        task("after", needs=ids("timed")), task("one", needs=ids("short"), batch="both"),
        task("two", needs=ids("long"), batch="both"), task("three", needs=ids("next")),
    )  # fmt: skip
    folder = RunFolder(tmp_path)
    runner, executor = Runner(tasks, Cache(folder)), TwoAtOnce(folder)
    runner.run(executor)
    assert executor.at_work == [
        ["long", "short"], ["short"], ["one", "two", "next"], ["next"], ["three"], ["timed"], ["after"],
    ]  # fmt: skip
    assert all(outcome.status == "ok" for outcome in runner.outcomes.values())


def test_the_last_batch_is_shared_by_workers_that_would_wait(tmp_path):
    tasks = tuple(task(name, batch="all") for name in ("one", "two", "three"))
    at_work = {}
    for workers in (1, 2):
        (tmp_path / str(workers)).mkdir()
        executor = TwoAtOnce(folder := RunFolder(tmp_path / str(workers)))
        executor.side_by_side = workers
        Runner(tasks, Cache(folder)).run(executor)
        at_work[workers] = executor.at_work
    assert at_work == {1: [["one", "two", "three"]], 2: [["one", "two", "three"], ["three"]]}


def test_a_task_whose_process_is_killed_is_kept_as_failed_and_done_again_when_asked(tmp_path):
    def ended(*dies: bool, **only) -> tuple[list[Outcome], Runner]:
        tasks = [task(name, dies=d) for name, d in zip(("one", "two", "three"), dies)]
        runner = run_tasks(tmp_path, *tasks, **only)
        return list(runner.outcomes.values()), runner

    first, runner = ended(False, True, False)
    assert [outcome.failed for outcome in first] == [False, True, False]
    assert first[1].status == "out-of-memory" and "SIGKILL" in first[1].reason
    assert "the system was out of memory" in first[1].reason
    entry = runner.cache.find(task("two"), {})
    assert entry.state == "failed" and entry.why.startswith("out-of-memory") and "SIGKILL" in entry.why
    assert dict(runner.broken()) == {"network two": entry.why}
    again, runner = ended(True, False, True)
    assert again[1].reason == first[1].reason and dict(runner.broken()) == {"network two": entry.why}
    again, runner = ended(True, False, True, only=("failed",))
    assert not again[1].failed and dict(runner.broken()) == {}


def test_what_needs_a_failed_task_is_blocked_and_done_once_nothing_blocks_it(tmp_path):
    def both(dies: bool, **only) -> Outcome:
        needs = task("second", needs=(("network", "first"),))
        return run_tasks(tmp_path, task("first", dies=dies), needs, **only).outcomes["network", "second"]

    blocked = both(dies=True)
    assert blocked.failed and blocked.reason.startswith("cannot be run: network first: out-of-memory")
    assert both(dies=True).reason == blocked.reason
    assert both(dies=True, only=("failed",)).failed
    assert both(dies=False, only=("failed",)).status == "ok"
    assert (tmp_path / "second.txt").read_text() == "first"


def test_what_reads_a_failed_task_goes_on_without_it_and_is_another(tmp_path):
    def both(dies: bool) -> Runner:
        reads = task("second", reads=(("network", "first"),))
        return run_tasks(tmp_path, task("first", dies=dies), reads, only=("failed", "stale", "missing"))

    assert not both(dies=True).outcomes["network", "second"].failed
    assert (tmp_path / "second.txt").read_text() == "first" and both(dies=True).reused == ["network second"]
    assert both(dies=False).reused == []


def test_a_damaged_file_is_made_anew_alone_where_it_comes_back_as_it_was(tmp_path):
    tasks = task("first"), task("second", needs=(("network", "first"),)), task("third")
    run_tasks(tmp_path, *tasks)
    assert len(run_tasks(tmp_path, *tasks).reused) == 3
    (tmp_path / "first.txt").write_text("damaged")
    cache = Cache(RunFolder(tmp_path))
    assert cache.find(tasks[0], {}).state == "missing"
    assert cache.find(tasks[0], {}).why == "first.txt is damaged"
    runner = run_tasks(tmp_path, *tasks)
    assert (tmp_path / "first.txt").read_text() == "first"
    assert runner.reused == ["network third", "network second"]  # it came back as it was
    (tmp_path / "second.txt").unlink()
    assert Cache(RunFolder(tmp_path)).find(tasks[1], runner.cached).why == "second.txt is gone"
    cache.path(tasks[2]).write_text("{")
    assert cache.find(tasks[2], {}).state == "missing"


def test_a_network_that_learned_without_a_failed_simulation_is_another(tmp_path):
    plan = plan_of(tmp_path, motions=Motions(train=("walk", "run")))
    schedule = Schedule(plan)
    lost = schedule.data("run", "tshirt", find_method("simulation")).id
    assert lost in schedule.training(Network("supervised", 0, "tshirt")).reads
    assert schedule.training(Network("snug", 0, "tshirt")).reads == ()


def test_a_failed_task_that_no_row_speaks_of_makes_the_exit_status_1(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(execution, "make_report", lambda log: "")
    monkeypatch.setattr(execution, "tasks_of", lambda plan: [task("lame", dies=True)])
    assert execution.execute(plan_of(tmp_path)) == 1
    assert "network lame: out-of-memory: the process was killed" in capsys.readouterr().err


def test_a_dry_run_decides_as_the_run_does(tmp_path):
    """A dry run foresees every decision of the run except those that follow from a failure."""

    def planned_and_done(dies: bool, *only: str) -> tuple[set[str], set[str]]:
        tasks = (
            task("first", dies=dies), task("second", needs=(("network", "first"),)),
            task("third", reads=(("network", "first"),)), task("fourth"),
        )  # fmt: skip
        preview = Runner(tasks, Cache(RunFolder(tmp_path), only=only)).preview()
        planned = {task.name for task, _, outcome in preview if outcome is None}
        runner = run_tasks(tmp_path, *tasks, only=only)
        blocked = "failed: cannot be run"
        ran = {name for (_, name), entry in runner.cached.items() if not entry.why.startswith(blocked)}
        return planned, ran - {title.removeprefix("network ") for title in runner.reused}

    planned, done = planned_and_done(True, "stale", "missing")
    assert planned - done == {"second"} and done == {"first", "third", "fourth"}
    assert planned_and_done(True, "stale", "missing") == (set(), set())
    (tmp_path / "cache" / "network" / "second.json").unlink()
    assert planned_and_done(True, "missing") == (set(), set())
    (tmp_path / "fourth.txt").unlink()
    assert planned_and_done(False, "failed") == ({"first", "second"}, {"first", "second"})
    assert planned_and_done(False, "stale", "missing") == ({"third", "fourth"}, {"third", "fourth"})


def give(outcome, context, needed):
    return outcome


@pytest.mark.parametrize(
    ("outcome", "word"),
    [(Outcome(result={"x": np.float32(1)}), "float32"), (Outcome(files=("nowhere.npy",)), "nowhere.npy")],
)
def test_what_cannot_be_kept_has_failed_and_the_others_go_on(outcome, word, tmp_path):
    bad = dataclasses.replace(task("bad"), kind="unkept", run=partial(give, outcome))
    runner = run_tasks(tmp_path, bad, task("good"))
    assert runner.outcomes["unkept", "bad"].failed and word in runner.outcomes["unkept", "bad"].reason
    assert runner.outcomes["network", "good"].status == "ok"
    assert run_tasks(tmp_path, bad, task("good")).reused == ["unkept bad", "network good"]


warm = 0.0  # in the process: how often it was warmed up


def warm_up():
    global warm
    warm += 1.0


def warmth():
    return warm


def hang():
    time.sleep(1000)


def wrong():
    raise RuntimeError("lost")


def case(function: str, seconds: float = 60.0, **declared) -> Case:
    return Case(
        name=function, suite="extremes", description="", module=__name__, function=function, seconds=seconds,
        metric="outcome", **declared,
    )  # fmt: skip


def rows_of_cases(folder, *cases: Case, processes: bool = False, **changes):
    plan = plan_of(folder, cases=cases, **changes)
    runner = finish(plan, "validation", processes=processes)
    return rows_of(plan, runner.tasks, runner.outcomes), runner


def test_what_did_not_come_back_is_a_failed_row_and_the_next_case_is_run(tmp_path):
    cases = case("hang", 0.5, expected=0.0), *(case(name) for name in ("warmth", "wrong", "absent"))
    (hung, next_one, *others), _ = rows_of_cases(tmp_path, *cases, processes=True)
    assert (hung.status, hung.value, hung.expected) == ("failed", None, 0.0)
    assert "no answer within 0.5 s" in hung.reason
    assert (next_one.status, next_one.value) == ("ok", 1.0)  # a new process is warmed up anew
    assert [(row.status, row.value) for row in others] == [("failed", None)] * 2
    for row, message in zip(others, ("RuntimeError: lost", "AttributeError"), strict=True):
        assert message in row.reason


def test_a_case_is_computed_once_and_again_when_it_declares_something_else(tmp_path):
    known = next(c for c in KNOWN_ANSWERS if c.smoke and c.tolerance is not None)
    first, runner = rows_of_cases(tmp_path, known)
    assert runner.reused == []
    again, runner = rows_of_cases(tmp_path, known)
    assert again == first and runner.reused == [f"case {known.name}"]
    off = dataclasses.replace(known, expected=(known.expected or 0.0) + 1e6, tolerance=1e-9)
    (failed,), runner = rows_of_cases(tmp_path, off)
    assert failed.status == "failed" and runner.reused == []
    assert runner.cached["case", known.name].state == "failed"
    again, runner = rows_of_cases(tmp_path, off)
    assert [(r.status, r.reason) for r in again] == [("failed", failed.reason)] and len(runner.reused) == 1
    assert f"case {known.name}: cached (failed: " in describe(plan_of(tmp_path, cases=(off,)))


def test_a_case_that_is_kept_though_it_is_out_of_date_says_so(tmp_path):
    known = next(c for c in KNOWN_ANSWERS if c.smoke)
    rows_of_cases(tmp_path, known)
    finer = dataclasses.replace(known, tolerance=1e-30)
    (row,), _ = rows_of_cases(tmp_path, finer, only=frozenset({"missing"}))
    assert row.status == "ok" and row.reason == "kept though declared changed"
    assert rows_of_cases(tmp_path / "new", finer, only=frozenset({"failed"}))[0] == []


def test_every_case_has_an_identity_of_its_own(tmp_path):
    plan = plan_of(tmp_path, cases=CASES)
    tasks = tasks_of(plan)
    assert len({task.id for task in tasks}) == len(tasks) == len(CASES)
    assert len({RunFolder(tmp_path).cache / f"{task.name}.json" for task in tasks}) == len(CASES)


def test_a_stress_test_depends_on_how_it_is_checked_and_on_energies_but_on_no_report_and_no_network(tmp_path):
    from benchmarks.runner.cache import dependencies

    (task,) = tasks_of(plan_of(tmp_path, cases=STRESS_TESTS[:1]))
    places = set(dependencies(task))
    assert {"benchmarks/validation", "reference_sim"} <= places
    assert not any(place.startswith(("reports", "snug/networks", "benchmarks/plan")) for place in places)
