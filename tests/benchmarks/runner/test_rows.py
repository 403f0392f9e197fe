"""From a trajectory to rows: what is judged, what is not finite, what may fail, and the closing lines."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.methods import find_method
from benchmarks.plan.cell import Cell
from benchmarks.plan.motions import Motions
from benchmarks.results.row import Row
from benchmarks.runner.cells import judge, misshapen
from benchmarks.runner.execute_plan import is_accepted
from benchmarks.runner.rows import clock_costs, rows_of
from benchmarks.runner.run_json import RunLog
from benchmarks.runner.schedule import tasks_of
from benchmarks.runner.task import Outcome
from benchmarks.scenes import SCENES
from benchmarks.timing import Reading
from reference_sim import Trajectory
from tests.benchmarks.runner.tasks_by_hand import dressed_scene, plan_of

SHEET = SCENES[0]


def trajectory(frames=4, **changes) -> Trajectory:
    values = {
        "positions": np.zeros((frames, 3, 3)), "faces": np.array([[0, 1, 2]]),
        "times": np.arange(frames) / 30,
        "frame_seconds": np.r_[0.0, np.full(frames - 1, 0.002)], "status": "converged",
    }  # fmt: skip
    return Trajectory(**(values | changes))


FOUR = SimpleNamespace(frames=4, cloth=SimpleNamespace(vertex_count=3))
assert misshapen(np.zeros(3), FOUR, other_mesh=True).startswith("gives positions float64 (3,)")
CONVERGED = {"converged": np.array([1, 1, 0, 0.0])}


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({}, ("ok", "")),
        ({"status": "max_iterations", "truncated": True, "reason": "gave up"}, ("ok", "")),
        ({"status": "max_iterations", "reason": "frame 2: gave up"}, ("stalled", "frame 2: gave up")),
        ({"frames": 2}, ("diverged", "ended after 2 of 4 frames")),
        ({"positions": np.full((4, 3, 3), np.nan)}, ("diverged", "a position is not finite")),
        ({"status": "fine"}, ("failed", "unknown status 'fine'")),
        (
            {"status": "stalled", "reason": "frame 2: x", "frame_fields": CONVERGED},
            ("stalled", "2 of 4 frames did not converge; frame 2: x"),
        ),
        ({"status": "diverged", "reason": "y", "frames": 3, "truncated": True}, ("diverged", "y")),
        ({"complaint": "it went on"}, ("failed", "its time cannot be believed: it went on")),
    ],
)
def test_a_trajectory_is_judged_by_what_is_in_it_and_by_the_clock(changes, expected):
    changes = {"truncated": False, "complaint": "", **changes}
    reading = Reading((1.0,), changes.pop("complaint"))
    entry = dataclasses.replace(find_method("simulation"), truncated=changes.pop("truncated"))
    status, reason = judge(trajectory(**changes), reading, FOUR, entry)
    assert status == expected[0] and reason.startswith(expected[1]) and bool(reason) == bool(expected[1])


def rows(
    cell: Cell, outcome: Outcome, metrics: dict[str, float] | None = None, **more: Outcome
) -> list[Row]:
    """Return the rows of one cell with these metrics; more: outcomes of its other tasks by kind."""
    outcomes = {("cell", cell.name): outcome} | {(kind, cell.name): other for kind, other in more.items()}
    if metrics is not None:
        outcomes["metrics", cell.name] = Outcome(result=metrics)
    return rows_of(dataclasses.replace(plan_of(Path()), cells=(cell,)), (), outcomes)


RAN = Outcome(result={"seconds": 1.0, "frames": 4, "peak": 70.0, "terms": "strain+inertia"}, files=("x",))


def test_rows_of_a_cell_stand_in_each_suite_and_tell_what_is_not_finite():
    cell = Cell(SHEET, find_method("newton-1"), 0, ("garments", "speed"))
    table = rows(cell, RAN, {"energy/strain": 1.0, "distance/rms": np.nan})
    assert [row.suite for row in table] == ["garments"] * 4 + ["speed"] * 4
    assert {(row.dtype, row.terms) for row in table} == {("float64", "strain+inertia")}
    by_metric = {row.metric: row for row in table}
    assert by_metric["cost/frame"].value == 250.0 and by_metric["cost/peak"].unit == "MB"
    strain, lost = by_metric["energy/strain"], by_metric["distance/rms"]
    assert strain.value == 1.0 and strain.unit == "J" and strain.status == "ok"
    assert lost.value is None and lost.status == "failed" and "finite" in lost.reason
    skinned = rows(Cell(SHEET, find_method("skinning"), 0, ("speed",)), RAN, {"energy/strain": 1.0})
    assert skinned[0].dtype == "float32"
    skipped = rows(cell, Outcome("skipped", "why"))
    assert [(row.status, row.reason, row.value) for row in skipped] == [("skipped", "why", None)] * 2
    untimed = dataclasses.replace(
        cell, scene=dataclasses.replace(SHEET, metrics=("geometry",)), suites=("a",)
    )
    (bare,) = rows(untimed, RAN, {})
    assert (bare.status, bare.reason) == ("skipped", "no metric that the scene names applies to it")


def test_inputs_are_added_to_a_methods_own_work_and_percentiles_are_medians_of_repeats():
    cell = Cell(SHEET, find_method("newton-1"), 0, ("speed",))
    outcomes: dict = {("cell", cell.name): RAN}
    as_earlier_runs_wrote_it = clock_costs(cell, 3, outcomes)[0]
    assert set(as_earlier_runs_wrote_it) == {"cost/frame", "cost/peak"}
    late = [{"seconds": s, "frame_p95": p} for s, p in ((1.0, 0.3), (1.2, 0.5), (1.1, 0.4))]
    outcomes["cell", cell.name] = dataclasses.replace(
        RAN, result={**RAN.result, **late[0], "inputs": 0.002}
    )
    outcomes |= {("repeat", f"{cell.name}-{n}"): Outcome(result=late[n]) for n in (1, 2)}
    costs, remark = clock_costs(cell, 3, outcomes)
    assert costs["cost/frame"] == pytest.approx(275.0) and costs["cost/whole"] == pytest.approx(277.0)
    assert costs["cost/frame_p95"] == pytest.approx(400.0) and remark == ""
    outcomes["repeat", f"{cell.name}-2"] = Outcome(
        "failed", "more than one thread", result={"seconds": 9.0}
    )
    costs, remark = clock_costs(cell, 3, outcomes)
    assert costs["cost/frame"] == pytest.approx(275.0)
    assert remark == "repeat 2: failed: more than one thread"


def test_an_extreme_case_may_fail_honestly_and_nothing_else_may():
    def row(suite, status, reason="why"):
        return Row(suite, "s", "m", 0, "x", "1", None, status, reason)

    assert is_accepted(row("extremes", "stalled")) and is_accepted(row("garments", "skipped"))
    assert not is_accepted(row("extremes", "failed")) and not is_accepted(row("garments", "stalled"))
    assert not is_accepted(row("extremes", "stalled", ""))


def test_a_run_that_has_just_begun_leaves_what_the_rows_there_mean(tmp_path):
    log = RunLog(plan_of(tmp_path))
    log.write_rows([Row("garments", "tshirt/kick", "snug", 0, "energy/total", "J", 1.0)])
    before = log.folder.read_config()
    RunLog(plan_of(tmp_path))  # and is interrupted before it knows anything
    after = log.folder.read_config()
    assert before["digests"] and all(after[name] == before[name] for name in ("scenes", "digests"))


def test_new_numbers_of_test_motions_are_a_look_and_others_are_none(tmp_path):
    motions = Motions(("walk",), ("dance_turn",), validation=("kick",))
    cells = [
        Cell(dressed_scene(name), find_method("skinning"), 0, ("garments",))
        for name in ("dance_turn", "kick")
    ]

    def looks(scene: str, *values: float) -> int:
        log = RunLog(plan_of(tmp_path, motions=motions, cells=tuple(cells)))
        log.write_rows(
            [Row("garments", scene, "skinning", 0, "energy/total", "J", value) for value in values]
        )
        config = log.folder.read_config()
        roles = {"tshirt/dance_turn": "test", "tshirt/kick": "validation"}
        assert config["scenes"][scene]["role"] == roles[scene]
        return len(config["test_looks"])

    assert looks("tshirt/kick", 1.0) == 0
    assert looks("tshirt/dance_turn", 1.0) == 1
    assert looks("tshirt/dance_turn", 1.0) == 1  # taken from the folder, or the report again
    assert looks("tshirt/dance_turn", 1.5) == 2  # other code, another seed
    assert looks("tshirt/kick", 2.0) == looks("tshirt/dance_turn") == looks("tshirt/dance_turn", 1.0) == 2


@pytest.mark.parametrize(("method", "data"), [("snug", 0.0), ("supervised", 7.0)])
def test_what_a_network_has_cost_is_that_of_its_training_and_of_what_it_learned_from(method, data):
    cell = Cell(dressed_scene("kick"), find_method(method), 0, ("garments",))
    motions = Motions(train=("walk", "run"), test=("kick",))
    plan = dataclasses.replace(plan_of(Path()), cells=(cell,), motions=motions)
    tasks, network = tasks_of(plan), plan.networks[0].task_id
    origin = {"commit": "c", "preset": "p", "hardware": "there"}
    result = {"seconds": 120.0, "setup_seconds": 20.0, "megabytes": 9.0, "steps": 60, "frames": 90}
    trained = Outcome(result=result, origin=origin)
    outcomes = {
        ("cell", cell.name): RAN, ("metrics", cell.name): Outcome(result={"energy/strain": 1.0}),
        network: trained,
        ("data", "tshirt-walk/simulation"): Outcome(seconds=3.0, origin=origin | {"hardware": "elsewhere"}),
        ("data", "tshirt-run/simulation"): Outcome(seconds=4.0, origin=origin),
        ("data", "tshirt-run/fast-lbfgs-10"): Outcome(seconds=5.0),
    }  # fmt: skip
    rows = rows_of(plan, tasks, outcomes)
    machines = {row.metric: row.hardware for row in rows}
    assert machines["cost/train"] == machines["cost/setup"] == "there" and machines["cost/frame"] == ""
    assert machines["cost/data"] == ("elsewhere and there" if data else "")
    assert {row.reason for row in rows} == {""}
    costs = {row.metric: row.value for row in rows}
    assert costs["cost/data"] == data and costs["cost/train"] == 120.0
    assert costs["cost/setup"] == 20.0 and costs["cost/memory"] == 9.0
    assert costs["cost/train_steps"] == 60 and costs["cost/train_frames"] == 90
    partial_outcome = dataclasses.replace(trained, result={**trained.result, "left_out": ["run"]})
    rows = rows_of(plan, tasks, outcomes | {network: partial_outcome})
    assert all("learned without run" in row.reason for row in rows)
