"""Cells that were computed before: reused, out of date, repeated in turn, left out."""

from __future__ import annotations

import dataclasses

import pytest

from benchmarks.results.run_folder import RunFolder
from benchmarks.runner.execute_plan import describe
from benchmarks.runner.rows import clock_costs, rows_of
from benchmarks.runner.task import Outcome
from tests.benchmarks.runner.tasks_by_hand import InProcess
from tests.benchmarks.runner.test_cell_tasks import (
    TINY,
    finish,
    found_of,
    outcome_of,
    plan_of,
)


def plain(outcome: Outcome) -> tuple:
    return outcome.status, outcome.reason, outcome.files, dict(outcome.result)


def test_a_finished_cell_is_reused_until_something_that_it_uses_changes(tmp_path):
    plan = plan_of(tmp_path, "simulation")
    first = outcome_of(plan)
    again = finish(plan)
    assert plain(again.outcomes["cell", plan.cells[0].name]) == plain(first)
    assert again.reused == [f"cell {plan.cells[0].label}"]

    finer = plan_of(tmp_path, "simulation", preset=dataclasses.replace(TINY, sheet_cells=4))
    entry = found_of(finer)
    assert (entry.state, entry.why, entry.wanted) == ("stale", "scene", True)
    kept = finish(dataclasses.replace(finer, only=frozenset({"missing"})))
    outcome = kept.outcomes["cell", plan.cells[0].name]
    assert plain(outcome) == plain(first) and outcome.remark == "kept though scene changed"
    assert kept.outdated() == {f"cell {plan.cells[0].label}": "kept though scene changed"}

    elsewhere = plan_of(
        tmp_path, "simulation", preset=dataclasses.replace(TINY, garment_vertices=99, gap_samples=9)
    )
    assert plain(outcome_of(elsewhere)) == plain(first)

    RunFolder(tmp_path).trajectory_path("free_fall", "simulation").unlink()
    assert found_of(plan).state == "missing"
    gone = finish(dataclasses.replace(plan, only=frozenset({"failed"})))
    left_out = gone.outcomes["cell", plan.cells[0].name]
    assert (left_out.status, left_out.files, gone.reused) == ("skipped", (), [])
    assert "--only" in left_out.reason
    assert "left out" in describe(dataclasses.replace(plan, only=frozenset({"failed"})))


def test_a_cell_that_is_run_again_leaves_nothing_of_its_earlier_run(tmp_path):
    plan = plan_of(tmp_path, "simulation", "newton-1", "newton-4")
    folder = RunFolder(tmp_path)

    def measured() -> list[str]:
        """Methods whose metrics are there."""
        return [
            c.method for k, c in enumerate(plan.cells) if found_of(plan, "metrics", k).state == "finished"
        ]

    def after(number: int) -> list[str]:
        finish(plan, "cells", "metrics")
        assert len(measured()) == 3
        folder.trajectory_path("free_fall", plan.cells[number].method).unlink(missing_ok=True)
        folder.quasi_static_path("free_fall", plan.cells[number].method).touch()
        outcome_of(plan, number)
        assert not folder.quasi_static_path("free_fall", plan.cells[number].method).exists()
        return measured()

    assert after(1) == ["simulation", "newton-4"]
    assert after(0) == []  # the others are compared with it
    outcome_of(plan_of(tmp_path, "simulation", "newton-1", how="raise"), 1)
    assert not folder.trajectory_path("free_fall", "newton-1").exists()


def test_repeats_take_turns_and_are_kept(tmp_path, monkeypatch):
    names = ("simulation", "newton-1", "newton-4")
    preset = dataclasses.replace(TINY, repeats=3, repeat_seconds=60.0)
    plan = plan_of(tmp_path, *names, preset=preset, how="still")
    order, alone = [], InProcess.alone

    def watched(self, task, needed):
        order.append((task.kind, task.label.split(" x ")[1]))
        return alone(self, task, needed)

    monkeypatch.setattr(InProcess, "alone", watched)
    runner = finish(plan)
    repeats = [method for kind, method in order if kind == "repeat"]
    assert repeats[:3] == ["newton-1", "newton-4", "simulation"]
    assert repeats[3:] == ["newton-4", "simulation", "newton-1"]
    cell = plan.cells[0]
    seconds = [runner.outcomes["cell", cell.name].result["seconds"]]
    seconds += [runner.outcomes["repeat", f"{cell.name}-{n}"].result["seconds"] for n in (1, 2)]
    costs, _ = clock_costs(cell, 3, runner.outcomes)
    assert costs["cost/frame"] == pytest.approx(1e3 * sorted(seconds)[1] / 3)
    assert costs["cost/spread"] > 0.0
    order.clear()
    again = finish(plan)
    assert order == [] and clock_costs(cell, 3, again.outcomes)[0] == costs


def test_a_process_ends_when_none_of_its_cells_repeats_will_come(tmp_path, monkeypatch):
    preset = dataclasses.replace(TINY, repeats=3, repeat_seconds=0.0)
    plan = plan_of(tmp_path, "simulation", "newton-1", preset=preset)
    order = []
    for name in ("alone", "release"):
        inner = getattr(InProcess, name)

        def watched(self, first, *rest, name=name, inner=inner):
            order.append((name, getattr(first, "process", first)))
            return inner(self, first, *rest)

        monkeypatch.setattr(InProcess, name, watched)
    finish(plan)
    names = [cell.name for cell in plan.cells]
    assert order[:2] == [("alone", names[0]), ("release", names[0])]
    assert order[2:4] == [("alone", names[1]), ("release", names[1])]


def test_a_repeat_that_fails_is_said_on_the_rows(tmp_path):
    plan = plan_of(tmp_path, "newton-1", preset=dataclasses.replace(TINY, repeats=2, repeat_seconds=60.0))
    runner = finish(plan, "cells", "metrics")
    name = f"{plan.cells[0].name}-1"
    crowd = Outcome("failed", "more than one thread", result={"seconds": 0.1})
    rows = rows_of(plan, runner.tasks, runner.outcomes | {("repeat", name): crowd})
    assert {row.reason for row in rows} == {"repeat 1: failed: more than one thread"}
    assert {row.status for row in rows} == {"ok"} and "cost/spread" not in {row.metric for row in rows}


def test_repeats_that_lie_apart_carry_a_remark(tmp_path):
    plan = plan_of(tmp_path, "simulation", preset=dataclasses.replace(TINY, repeats=2))
    name = plan.cells[0].name

    def reasons(*seconds: float) -> dict[str, str]:
        first = {"seconds": seconds[0], "frames": 1, "peak": 1.0}
        outcomes = {
            ("cell", name): Outcome(result=first, files=("x",)), ("metrics", name): Outcome(),
            ("repeat", f"{name}-1"): Outcome(result={"seconds": seconds[1]}),
        }  # fmt: skip
        return {row.metric: row.reason for row in rows_of(plan, (), outcomes)}

    wide, near = reasons(1.0, 1.5), reasons(1.0, 1.1)
    assert "20 %" in wide["cost/spread"] and wide["cost/frame"] == ""
    assert near["cost/spread"] == ""


def test_a_dry_run_tells_what_is_there(tmp_path):
    plan = plan_of(tmp_path / "run", "simulation", "newton-1", "skinning")
    assert "4 tasks to run; 0 cached" in describe(plan) and not plan.folder.exists()
    outcome_of(plan)
    description = describe(plan)
    assert "cell free_fall x simulation: cached" in description
    assert "metrics free_fall x simulation: run (missing)" in description
    assert (
        "cell free_fall x newton-1: run (missing)" in description
        and "cell free_fall x skinning: skip" in description
    )
    assert "3 tasks to run; 1 cached" in description
    longer = dataclasses.replace(TINY, sheet_frames=5)
    stale = describe(plan_of(plan.folder, "simulation", "newton-1", preset=longer))
    assert "cell free_fall x simulation: run (stale: scene), " in stale and "s last time" in stale
    assert "4 tasks to run" in describe(dataclasses.replace(plan, fresh=True))
