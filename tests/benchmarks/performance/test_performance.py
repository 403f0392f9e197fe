"""Microbenchmarks: what a run takes of them, their rows, and each part on a small case."""

from __future__ import annotations

import csv
import functools
import math
import os
from pathlib import Path

import numpy as np
import pytest

import snug.training.train_network
from benchmarks import provenance, run
from benchmarks.methods.catalogue.all_methods import find_method
from benchmarks.methods.catalogue.trainings import TRAININGS
from benchmarks.metrics import find_metric
from benchmarks.metrics.cost.microbenchmarks import METRICS, PROCESS_MEMORY
from benchmarks.performance import convergence, garment, inference, search, sheet, training_step
from benchmarks.performance.convergence import HELD_OUT
from benchmarks.performance.microbenchmark import Microbenchmark, Settings
from benchmarks.performance.registry import MICROBENCHMARKS
from benchmarks.plan.choose_cells import MEASURED, Selection, choose_cells, choose_suites
from benchmarks.plan.plan import Motions, Plan, PlanError
from benchmarks.presets import find_preset
from benchmarks.results.run_folder import RunFolder
from benchmarks.runner import execute_plan as execution
from benchmarks.runner.rows import rows_of
from benchmarks.runner.run_json import described
from benchmarks.runner.schedule import tasks_of
from benchmarks.tasks.task import Outcome
from reference_sim import simulate
from reference_sim.energies import BendHinge, Gravity, StretchStVK
from reports.run.finished_run import make_run
from reports.tables import make_tables
from snug.motion.library import TEST, TRAIN
from snug.networks.trained_model import TrainedModel
from tests.snug.training.dressing import swaying, tube_dress

SMOKE, QUICK = find_preset("smoke"), find_preset("quick")
SMALL_SHEET = Microbenchmark(
    name="sheet/4x4", description="", module="benchmarks.performance.sheet", function="scaling",
    options={"side": 4, "frames": 1}, repeats=1,
)  # fmt: skip


def settings(method="simulation", **changes):
    return Settings(**{"repeats": 1, "training": TRAININGS.get(method)} | changes)


def plan_of(folder, *benchmarks, device="cpu", preset=SMOKE):
    return Plan(
        preset=preset, suites=("performance",), cells=(), cases=(), microbenchmarks=benchmarks, seeds=(0,),
        device=device, folder=folder, command="",
    )  # fmt: skip


def chosen(*, preset=QUICK, scenes=(), methods=(), suites=("performance",)):
    request = Selection(suites=suites, preset=preset, motions=Motions(), scenes=scenes, methods=methods)
    return choose_cells(request)[2]


# --- what a run takes of them -------------------------------------------------------------------------------


def test_they_are_run_only_where_their_suite_is_named():
    assert "performance" not in choose_suites(())
    assert "performance" in choose_suites(["all"]) and choose_suites(["performance"]) == ("performance",)
    short = {benchmark for benchmark in MICROBENCHMARKS if not benchmark.long}
    assert set(chosen()) == short and len(short) == len(MICROBENCHMARKS) - 1
    with pytest.raises(PlanError, match="nothing to run"):
        chosen(suites=("speed",), scenes=("scaling/*",))


def test_patterns_methods_and_the_smallest_preset_choose_among_them():
    assert {b.name for b in chosen(scenes=("scaling/*",))} == {
        f"scaling/{side}x{side}" for side in (32, 64, 128, 256, 512)
    }
    assert {b.name.split("/")[0] for b in chosen(methods=("pbns",))} == {"training_step", "inference"}
    assert chosen(preset=SMOKE) == tuple(b for b in MICROBENCHMARKS if b.smoke)
    assert [b.name for b in chosen(preset=SMOKE, scenes=("sheet/*",))] == ["sheet/64x64"]


def test_a_long_one_needs_its_whole_name():
    assert [b.name for b in chosen(scenes=("convergence/4400",))] == ["convergence/4400"]
    assert all(not b.long for b in chosen(scenes=("*/4400",)))


def test_a_wrong_word_is_one_line_and_exit_2(refused):
    refused("sheet/64x64", run.main, ["--suite", "performance", "--scenes", "sheet/64x46"])


def test_the_command_says_what_it_would_measure(tmp_path, capsys):
    options = ["--suite", "performance", "--scenes", "scaling/*", "-o", str(tmp_path / "run"), "--dry-run"]
    assert run.main(options) == 0
    output = capsys.readouterr().out
    assert "suites performance;" in output and "0 cells, 0 skipped, 0 cases, 5 microbenchmarks" in output
    assert "  microbenchmark scaling/64x64 x simulation: run (missing)\n" in output


def test_names_are_unique_and_of_methods_that_there_are():
    assert len({benchmark.label for benchmark in MICROBENCHMARKS}) == len(MICROBENCHMARKS)
    others = {entry.name for entry in MEASURED if not isinstance(entry, Microbenchmark)}
    assert not others & {benchmark.name for benchmark in MICROBENCHMARKS}
    assert {find_method(b.method).dtype for b in MICROBENCHMARKS if b.name.startswith("inference/")} == {
        "float32"
    }


def test_the_device_reaches_what_trains_and_nothing_else(tmp_path, monkeypatch):
    monkeypatch.setattr(provenance, "hardware", lambda device: {"device": device})
    tasks = tasks_of(plan_of(tmp_path, *MICROBENCHMARKS, device="cuda", preset=QUICK))
    setups = {task.name: (task.settings.device, task.settings.steps) for task in tasks}
    trains = {name for name, (device, _) in setups.items() if device == "cuda"}
    parts = ("training_step-", "convergence-")
    assert trains == {name for name in setups if name.startswith(parts)} and len(trains) == 13
    assert setups["convergence-4400-x-snug"] == ("cuda", QUICK.steps["snug"])
    assert setups["inference-4400-x-snug"] == ("cpu", 0)
    # Timed: alone on the machine, each in a process of its own.
    assert len({task.process for task in tasks}) == len(tasks) and all(task.process for task in tasks)


# --- rows ---------------------------------------------------------------------------------------------------


@pytest.fixture
def without_report(monkeypatch):
    monkeypatch.setattr(execution, "make_report", lambda log: "")


def test_a_run_measures_in_a_process_of_its_own_and_reuses_the_rows(tmp_path, without_report):
    plan = plan_of(tmp_path, SMALL_SHEET)
    assert execution.execute(plan) == 0
    rows = {row.metric: row for row in RunFolder(tmp_path).read_rows()}
    assert {row.suite for row in rows.values()} == {"performance"}
    assert {(row.scene, row.method) for row in rows.values()} == {("sheet/4x4", "simulation")}
    assert rows["performance/vertices"].value == 16
    assert rows["performance/iteration"].unit == "ms" and rows["performance/iteration"].value > 0
    assert rows[PROCESS_MEMORY].value > 1 and rows[PROCESS_MEMORY].commit
    config = RunFolder(tmp_path).read_config()
    assert config["metrics"]["performance/iteration"]["table"] == "performance_scaling"
    assert config["methods"]["simulation"]["role"] == "reference"
    tables = make_tables(make_run(config, list(rows.values())))
    assert tables["performance_scaling_by_scene"].rows[0][:3] == ("performance", "sheet/4x4", "simulation")
    assert execution.execute(plan) == 0  # the times of the first run, to the last digit
    assert {row.metric: row.value for row in RunFolder(tmp_path).read_rows()} == {
        name: row.value for name, row in rows.items()
    }


def die(settings):
    os._exit(7)


def fail(settings):
    raise ValueError("no such thing")


@pytest.mark.parametrize(
    ("function", "reason"),
    [
        pytest.param("die", "the process ended with status 7", marks=pytest.mark.slow),
        ("fail", "ValueError: no such thing"),
    ],
)
def test_one_that_dies_or_raises_is_a_row_and_exit_1(function, reason, tmp_path, without_report, capsys):
    bad = Microbenchmark(name="bad/one", description="", module=__name__, function=function)
    assert execution.execute(plan_of(tmp_path, bad, SMALL_SHEET)) == 1
    first, *others = RunFolder(tmp_path).read_rows()
    assert (first.metric, first.status, first.reason) == (PROCESS_MEMORY, "failed", reason)
    assert (first.value is None) == (function == "die")
    assert {row.status for row in others} == {"ok"} and len(others) == 5
    assert f"bad/one x simulation: failed: {reason}" in capsys.readouterr().err


def test_a_number_that_is_none_fails_and_the_others_stand(tmp_path):
    (task,) = tasks_of(plan := plan_of(tmp_path, SMALL_SHEET))
    result = {"performance/iteration": math.nan, "performance/vertices": 16}
    rows = rows_of(plan, [task], {task.id: Outcome(result=result, origin={"commit": "abc"})})
    assert [(row.value, row.status, row.commit) for row in rows] == [
        (None, "failed", "abc"),
        (16, "ok", "abc"),
    ]
    assert "performance/iteration is not finite" in rows[0].reason
    assert set(described(plan, rows)["metrics"]) == set(result)


def test_metrics_are_declared_once_each():
    assert len({metric.name for metric in METRICS}) == len(METRICS)
    assert all(metric.title and metric.definition for metric in METRICS)


def values(metrics):
    """The numbers, once every name is that of a metric."""
    for name, value in metrics.items():
        assert find_metric(f"performance/{name}").table.startswith("performance"), name
        assert math.isfinite(value), name
    return metrics


# --- the simulator ------------------------------------------------------------------------------------------


def test_a_frame_of_the_sheet_has_a_time_that_is_split():
    metrics = values(sheet.frames(settings(repeats=2), side=6))
    assert 0 < metrics["frame"] <= metrics["frame_worst"] and metrics["vertices"] == 36
    assert metrics["converged_frames"] == 100.0 and 0 < metrics["gradient"] < 1e-6
    assert metrics["linear_solver"] > 0 and metrics["outside_linear_solver"] > 0


def test_the_sheet_falls_as_a_simulation_does():
    cloth = sheet.regular_sheet(6)
    start = cloth.rest_positions + np.random.default_rng(0).normal(0, sheet.NOISE, cloth.rest_positions.shape)
    start[cloth.pins] = cloth.rest_positions[cloth.pins]
    terms = [StretchStVK(cloth), BendHinge(cloth), Gravity(cloth)]
    simulated = simulate(cloth, terms, dt=sheet.DT, frames=4, start=start)
    results = [result for result, _ in sheet.fall(cloth, 3)]
    assert [r.iterations for r in results] == simulated.frame_fields["iterations"][1:].tolist()
    assert np.array_equal(results[-1].positions, simulated.positions[-1])


def test_an_iteration_has_a_cost(monkeypatch):
    monkeypatch.setattr(sheet, "SMALLEST", 4)
    metrics = values(sheet.scaling(settings(), side=8, frames=1))
    assert metrics["iteration_per_vertex"] == pytest.approx(1e3 * metrics["iteration"] / 64)
    assert metrics["lbfgs_iteration"] > 0 and metrics["lbfgs_slope"] < 3 and metrics["lbfgs_memory"] >= 0


def test_the_shirt_is_cut_to_its_frames_and_measured(monkeypatch):
    monkeypatch.setattr(garment, "FRAMES", 3)
    scene = garment.dressed("walk", 350)
    assert scene.frames == 3 and scene.obstacle is not None
    monkeypatch.setattr(garment, "dressed", lambda motion, vertices: scene)
    metrics = values(garment.measure(settings(), motion="walk", vertices=350))
    assert metrics["converged_frames"] == 100.0 and metrics["vertices"] == scene.cloth.vertex_count
    assert 0 < metrics["iterations"] <= metrics["iterations_worst"]
    assert 0 <= metrics["deep_vertices"] <= metrics["penetrating_vertices"] < 100
    monkeypatch.setattr(search, "dressed", lambda motion, vertices: scene)
    metrics = values(search.measure(settings(), motion="walk", vertices=350, frames=3))
    assert 0 < metrics["search"] <= metrics["search_worst"] and metrics["samples"] > 5 * metrics["vertices"]


# --- networks -----------------------------------------------------------------------------------------------


@pytest.fixture
def small(tmp_path, monkeypatch):
    """Every part on the tube dress and two short motions; the settings of a short run."""
    motions = [swaying(20), swaying(10, name=HELD_OUT, degrees=15.0)]
    for part in (convergence, inference, training_step):
        monkeypatch.setattr(part, "dressed_body", lambda vertices: tube_dress())
        monkeypatch.setattr(part, "training_motions", lambda: motions)
    monkeypatch.setattr(training_step, "BLOCK", 2)
    monkeypatch.setattr(training_step, "WARM_UP", 1)
    monkeypatch.setattr(convergence, "POINTS", 3)
    files = (tmp_path / "convergence.csv", tmp_path / "models" / "snug-150.safetensors")
    return settings("snug", repeats=2, steps=6, files=files, key="now")


def lines(path: Path):
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


@pytest.mark.parametrize("network", ["snug", "supervised", "pbns"])
def test_a_step_has_a_time_and_parts(small, network):
    metrics = values(
        training_step.measure(settings(network, repeats=2, steps=6, files=small.files), vertices=150)
    )
    assert 0 < metrics["training_step_least"] <= metrics["training_step"]
    parts = {name.partition("/")[2] for name in metrics if name.startswith("training_step/")}
    assert metrics["training_step/backward"] > 0 and ("energies" in parts) == (network != "supervised")
    assert metrics["paper_training"] == pytest.approx(metrics["training_step"] / 120)  # 30,000 steps


def test_a_frame_has_a_time_and_a_network_a_size(small):
    metrics = values(inference.measure(small, vertices=150))
    assert 0 < metrics["inference_least"] <= metrics["inference"] <= metrics["inference_p95"]
    assert metrics["inference_cold"] > metrics["inference_least"]
    assert metrics["timed_frames"] == 2 * 20
    assert 4e-6 * metrics["parameters"] <= metrics["network_memory"] <= metrics["model_file"]


def test_a_killed_convergence_goes_on_to_the_same_curve(small, monkeypatch):
    curve, model_path = small.files
    metrics = values(convergence.measure(small, vertices=150))
    whole = lines(curve)
    assert [row["step"] for row in whole] == ["2", "4", "6"] and metrics["steps"] == 6
    assert 20 < metrics["training_frames"] <= 20 * 13  # augmented motions too, the held-out one not
    model = TrainedModel.load(model_path)
    assert model.steps == 6 and all(row["seconds/validation"] > 0 for row in model.history)
    assert 0 < float(whole[-1]["seconds"]) < model.history[-1]["seconds"]

    curve.unlink()
    model_path.with_name(".snug-150.checkpoint.safetensors").write_text("of other code")
    asked = iter([False, False, False, True])
    stopped = functools.partial(snug.training.train_network.train_network, stop=lambda: next(asked))
    with monkeypatch.context() as patch:
        patch.setattr(convergence, "train_network", stopped)
        with pytest.raises(Exception, match="stopped after step 4"):
            convergence.measure(small, vertices=150)
    begun = []
    step_of = snug.training.train_network.train_network
    monkeypatch.setattr(convergence, "train_network", lambda *a, **k: step_of(*a, log=begun.append, **k))
    convergence.measure(small, vertices=150)
    assert [row["step"] for row in begun] == [6]  # only what was left
    again = lines(curve)
    for name in ("step", "loss", "validation", "strain"):
        assert [row[name] for row in again] == [row[name] for row in whole], name
    assert list(model_path.parent.iterdir()) == [model_path]


def test_the_time_of_validations_is_left_out():
    history = [
        {"step": 2.0, "seconds": 3.0, "loss": 2.0, "validation": 4.0, "seconds/validation": 0.5},
        {"step": 4.0, "seconds": 5.0, "loss": 1.0, "validation": 3.0, "seconds/validation": 0.5},
    ]
    assert [point["seconds"] for point in convergence.curve(history)] == [2.0, 3.0]


def test_a_validation_that_is_no_number_is_near_to_nothing():
    rows = [{"step": 2.0 * k, "seconds": 3.0 * k, "loss": 2.0, "validation": 4.0} for k in (1, 2, 3)]
    del rows[1]["validation"]
    numbers = np.array([point["validation"] for point in convergence.curve(rows)])
    assert np.isnan(numbers[1]) and convergence.arrival(numbers, 0.1) == 2
    assert convergence.arrival(np.array([4.0, 4.0, np.nan]), 0.1) == 2
    assert convergence.found_on(convergence.curve(rows))["validation_best"] == 4.0


def test_arrival_is_for_good():
    falling = np.array([3.0, 1.02, 1.2, 1.02, 1.005, 1.0])
    assert convergence.arrival(falling, 0.03) == 3  # not 1, for it left again
    assert convergence.arrival(falling, 0.01) == 4
    assert convergence.arrival(np.ones(3), 0.01) == 0


def test_the_held_out_motion_is_one_to_train_on():
    assert HELD_OUT in TRAIN and HELD_OUT not in TEST
