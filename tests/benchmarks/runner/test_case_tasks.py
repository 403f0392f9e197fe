"""Cases as tasks: what hangs or dies is a failed row, the next is run, and each is computed once."""

from __future__ import annotations

import dataclasses
import time

from benchmarks.results.run_folder import RunFolder
from benchmarks.runner.execute_plan import describe
from benchmarks.runner.rows import rows_of
from benchmarks.runner.schedule import tasks_of
from benchmarks.validation.case import Case
from benchmarks.validation.registry import CASES, KNOWN_ANSWERS, STRESS_TESTS
from tests.benchmarks.runner.test_cell_tasks import finish, plan_of

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


def rows_of_cases(folder, *cases: Case, **changes):
    plan = plan_of(folder, cases=cases, **changes)
    runner = finish(plan, "validation")
    return rows_of(plan, runner.tasks, runner.outcomes), runner


def test_what_did_not_come_back_is_a_failed_row_and_the_next_case_is_run(tmp_path):
    cases = case("hang", 0.5, expected=0.0), *(case(name) for name in ("warmth", "wrong", "absent"))
    (hung, next_one, *others), _ = rows_of_cases(tmp_path, *cases)
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
