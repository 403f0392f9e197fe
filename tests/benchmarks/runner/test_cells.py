"""Cells: what goes wrong is an outcome, what is finished is reused, and repeats take turns."""

from __future__ import annotations

import dataclasses

import pytest

from benchmarks.plan.plan import Plan
from benchmarks.results.row import Row
from benchmarks.results.run_folder import RunFolder
from benchmarks.runner.cache import Cache
from benchmarks.runner.loop import Runner
from benchmarks.runner.rows import clock_costs, rows_of
from benchmarks.runner.schedule import tasks_of
from tests.benchmarks.runner.tasks_by_hand import TINY, InProcess, finish, outcome_of, plan_of


def why(plan: Plan, kind: str = "cell", number: int = 0) -> str:
    """Return why a cell, or what follows it, has to be run; "finished" where it has not."""
    runner = Runner(tasks_of(plan), Cache(RunFolder(plan.folder), retry=plan.retry))
    reasons = {task.id: why for task, why, _ in runner.preview()}
    return reasons[kind, plan.cells[number].name] or "finished"


def rows(runner: Runner, plan: Plan) -> dict[str, Row]:
    """Return metric -> row."""
    return {row.metric: row for row in rows_of(plan, runner.tasks, runner.outcomes)}


@pytest.mark.parametrize(
    ("how", "word"),
    [
        ("raise", "RuntimeError: broken on purpose"),
        ("early", "its time cannot be believed"),
        ("unheld", "OSError: no room left"),
        ("late", "run() gives positions float64 (5, 16, 3): floats (4, 16, 3) are due"),
        ("astray", "quasi_static() gives positions float64 (4, 2, 3)"),
    ],
)
def test_a_cell_that_goes_wrong_is_an_outcome_with_its_reason(how, word, tmp_path):
    plan = plan_of(tmp_path, "newton-1", how=how)
    # Threads of tests falsify times.
    runner = finish(plan, "timed methods", "metrics", processes=how == "early")
    outcome = runner.outcomes["cell", plan.cells[0].name]
    assert word in outcome.reason and outcome.failed and not outcome.files
    (row,) = rows(runner, plan).values()
    assert (row.status, row.value) == ("failed", None) and not list(tmp_path.rglob("*.vtkhdf"))
    assert why(plan) == outcome.ending


def test_what_a_cell_has_run_stands_where_many_go_wrong(tmp_path):
    plan = plan_of(tmp_path, "newton-1", how="torn")
    runner = finish(plan, "timed methods", "metrics")
    outcome, first = runner.outcomes["cell", plan.cells[0].name], rows(runner, plan)
    assert (outcome.status, outcome.failed) == ("ok", False)
    assert first["cost/frame"].status == "ok" and "cost/batch" not in first
    assert "many at once: failed: RuntimeError: no two bodies" in first["cost/frame"].reason
    assert RunFolder(tmp_path).trajectory_path("free_fall", "newton-1").is_file()
    assert rows(finish(plan, "timed methods", "metrics"), plan).keys() == first.keys()


def test_a_cell_says_how_long_it_took_and_how_much_memory(tmp_path):
    plan = plan_of(tmp_path, "simulation", scene="hanging_sheet")
    outcome = outcome_of(plan, processes=True)
    result = outcome.result
    assert (outcome.status, len(outcome.files), result["frames"]) == ("ok", 1, 3)
    assert 0.0 < result["seconds"] < 10.0 and 50.0 < result["peak"] < 1000.0
    assert result["terms"] == "strain+bending+gravity+inertia"
    costs, remark = clock_costs(plan.cells[0], 1, {("cell", plan.cells[0].name): outcome})
    frames = {"cost/frame_p50", "cost/frame_p95", "cost/frame_worst"}
    assert set(costs) == {"cost/frame", "cost/whole", "cost/peak"} | frames and remark == ""
    assert costs["cost/frame"] == costs["cost/whole"] == pytest.approx(1e3 * result["seconds"] / 3)


def test_a_finished_cell_is_reused_until_something_that_it_uses_changes(tmp_path):
    plan = plan_of(tmp_path, "simulation")
    first, again = outcome_of(plan), finish(plan)
    assert again.outcomes["cell", plan.cells[0].name] == first
    assert again.reused == [f"cell {plan.cells[0].label}"] and why(plan) == "finished"
    finer = plan_of(tmp_path, "simulation", preset=dataclasses.replace(TINY, sheet_cells=4))
    assert why(finer) == "stale: scene"
    sizes = dataclasses.replace(TINY, garment_vertices=99, gap_samples=9)
    assert why(plan_of(tmp_path, "simulation", preset=sizes)) == "finished"


def test_a_cell_that_is_run_again_leaves_nothing_of_its_earlier_run(tmp_path):
    plan = plan_of(tmp_path, "simulation", "newton-1", "newton-4")
    folder = RunFolder(tmp_path)

    def measured_after(number: int) -> list[str]:
        """Return the methods whose metrics are still up to date once a cell has run again."""
        finish(plan, "timed methods", "metrics")
        folder.trajectory_path("free_fall", plan.cells[number].method).unlink(missing_ok=True)
        folder.quasi_static_path("free_fall", plan.cells[number].method).touch()
        outcome_of(plan, number)
        assert not folder.quasi_static_path("free_fall", plan.cells[number].method).exists()
        return [c.method for k, c in enumerate(plan.cells) if why(plan, "metrics", k) == "finished"]

    assert measured_after(1) == ["simulation", "newton-4"]
    assert measured_after(0) == []  # the others are compared with it
    outcome_of(plan_of(tmp_path, "simulation", "newton-1", how="raise"), 1)
    assert not folder.trajectory_path("free_fall", "newton-1").exists()


def test_repeats_take_turns_and_are_kept(tmp_path, monkeypatch):
    preset = dataclasses.replace(TINY, repeats=3, repeat_seconds=60.0)
    plan = plan_of(tmp_path, "simulation", "newton-1", "newton-4", preset=preset, how="still")
    calls: list = []
    alone = InProcess.run_alone

    def watched(self, task, needed):
        calls.append(task)
        return alone(self, task, needed)

    monkeypatch.setattr(InProcess, "run_alone", watched)
    runner = finish(plan)
    repeats = [task.label.split(" x ")[1] for task in calls if task.kind == "repeat"]
    assert repeats == ["newton-1", "newton-4", "simulation", "newton-4", "simulation", "newton-1"]
    cell = plan.cells[0]
    ids = [cell.id(), cell.id("repeat", 1), cell.id("repeat", 2)]
    seconds = [runner.outcomes[id].result["seconds"] for id in ids]
    costs, _ = clock_costs(cell, 3, runner.outcomes)
    assert costs["cost/frame"] == pytest.approx(1e3 * sorted(seconds)[1] / 3)
    assert costs["cost/spread"] > 0.0
    calls.clear()
    again = finish(plan)
    assert calls == [] and clock_costs(cell, 3, again.outcomes)[0] == costs
