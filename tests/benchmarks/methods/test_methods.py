"""Every method on every scene (sweeps on two), tiny: a trajectory or an explained skip; and its metrics."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks import timing
from benchmarks.assets import make_motions, open_assets
from benchmarks.method import Method
from benchmarks.methods import find_method
from benchmarks.methods.declared_solvers import SOLVERS
from benchmarks.metrics import energy_gap
from benchmarks.metrics.dynamics import shares_quasi_static
from benchmarks.plan.cell import Cell
from benchmarks.plan.motions import Motions
from benchmarks.presets import find_preset
from benchmarks.results import run_folder
from benchmarks.results.run_folder import RunFolder
from benchmarks.runner.cache import Cache
from benchmarks.runner.cells import build_scene
from benchmarks.runner.loop import Runner
from benchmarks.runner.measurements import measure_roll_out
from benchmarks.runner.rows import rows_of
from benchmarks.runner.schedule import tasks_of
from benchmarks.scenes import SCENES
from reference_sim import Trajectory
from tests.benchmarks.runner.tasks_by_hand import (
    InProcess,
    dressed_scene,
    grouped,
    plan_of,
    prepared,
    small_scene,
)

SIZES = {"frames": 16, "settle_frames": 2, "sheet_cells": 4, "sheet_frames": 5, "gap_samples": 2}
SIZES["least_seconds"] = 0.01
TRAIN, TEST = "arm_raise", "kick"
KINDS = ("snug", "supervised-vertices", "pbns")
TINY = dataclasses.replace(
    find_preset("smoke"), **SIZES, repeats=1, steps=dict.fromkeys(("snug", "supervised", "pbns"), 2)
)


def effort(entry) -> float:
    level = entry.level or 0.0
    return -level if entry.family == "simulation-tolerance" else level


# Further learned methods have tests of their own; of a family the one of least effort speaks for all.
ENTRIES = [*map(find_method, ("simulation", "skinning", *KINDS)), *SOLVERS]
LEAST = {e.family or e.name: e for e in sorted(ENTRIES, key=effort, reverse=True)}.values()
CHOSEN = [entry for entry in ENTRIES if entry in LEAST]
BODY = f"tshirt/{TEST}"
# Each solver is run in one scene at least, these in all of them.
EVERYWHERE = ("simulation", "simulation-perturbed", "skinning", "newton")
ON_A_BODY = (
    "snug", "supervised-vertices", "pbns", "lbfgs", "fast-lbfgs", "vbd", "xpbd",
    "skinning+lbfgs", "snug+newton",
)  # fmt: skip
NAMES = [*(scene.name for scene in SCENES), BODY]


def runs_in(entry, name: str) -> bool:
    family = entry.family or entry.name
    return family in EVERYWHERE or (name == BODY and family in ON_A_BODY)


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A whole run in this process."""
    folder = RunFolder(tmp_path_factory.mktemp("run"))
    scenes = [*(scene.at(TINY) for scene in SCENES), dressed_scene(TEST, preset=TINY)]
    cells = tuple(
        Cell(scene, entry, 0, ("garments", "speed"))
        for scene in scenes
        for entry in CHOSEN
        if scene.name == "hanging_sheet" or runs_in(entry, scene.name)
    )
    plan = plan_of(folder.path, preset=TINY, cells=cells, motions=Motions((TRAIN,), (TEST,)))
    assets = open_assets(TINY, make_motions([TRAIN, TEST]), ["tshirt"])
    runner = Runner(tasks_of(plan), Cache(folder))
    executor = InProcess(folder, assets)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(timing, "AFTER", 0.005)  # [s] that each run is watched after its end
        patch.setattr(energy_gap, "PRECISION", float("inf"))  # two frames speak for all
        # Before each timed run; outcomes of so many cells make it a tenth of a second.
        patch.setattr(timing, "gc", SimpleNamespace(collect=lambda: 0))
        runner.run(executor)
    return plan, runner, executor


@pytest.fixture(scope="module")
def rows(run):
    plan, runner, _ = run
    return rows_of(plan, runner.tasks, runner.outcomes)


@pytest.fixture(scope="module")
def scenes(run):
    """Name -> built scene."""
    plan, _, executor = run
    return {scene.name: build_scene(scene, executor.context()) for scene in plan.scenes}


def outcomes_of(run, name):
    plan, runner, _ = run
    return {c.method: runner.outcomes["cell", c.name] for c in plan.cells if c.scene.name == name}


def trajectory_of(run, name, method) -> Trajectory:
    return Trajectory.load(run[1].cache.folder.trajectory_path(name, method))


@pytest.mark.parametrize("name", NAMES)
def test_every_method_gives_a_whole_trajectory_or_a_reason(name, run, scenes):
    scene = scenes[name]
    for method, outcome in outcomes_of(run, name).items():
        entry = find_method(method)
        if outcome.status == "skipped":
            assert outcome.reason and scene.dressed is None and entry.needs_body
            continue
        assert outcome.status == "ok", f"{name} x {method}: {outcome.reason}"
        trajectory = trajectory_of(run, name, method)
        assert trajectory.positions.shape == (scene.frames, *scene.cloth.rest_positions.shape)
        assert np.isfinite(trajectory.positions).all()
        assert np.array_equal(trajectory.faces, scene.cloth.faces)
        seconds, result = trajectory.frame_seconds[1:], outcome.result  # as the method says
        assert (seconds > 0).all() and ("frame_p95" in result) == ("inputs" in result) == entry.timed
        if entry.timed:
            assert 0.0 < result["frame_p50"] <= result["frame_p95"] <= result["frame_worst"]
            assert result["frame_p50"] * len(seconds) / 2 <= result["seconds"]
            assert result["runs"] > 1 or result["seconds"] >= TINY.least_seconds
            assert (result["inputs"] > 0.0) == (scene.dressed is not None)
        assert trajectory.provenance["scene"] == name
        assert result["frames"] == scene.frames - (not entry.gives_first_frame)


def test_dressed_rows_hold_every_metric_and_small_ones_what_they_have(run, rows, scenes):
    costs = {"cost/frame", "cost/whole", "cost/peak"}
    expected = {
        "curvature/mean", "energy/total", "gap/relative", "gap/local", "gradient/norm",
        "intersections/triangles", "deformation/edges", "deformation/areas",
    }  # fmt: skip
    against = {"distance/rms", "distance/p95", "curvature/error", "curvature/histogram"}
    for name, scene in scenes.items():
        for method, outcome in outcomes_of(run, name).items():
            if outcome.status == "skipped":
                continue
            cell_rows = [r for r in rows if (r.suite, r.scene, r.method) == ("speed", name, method)]
            assert all(row.status == "ok" for row in cell_rows), (name, method)
            values = {row.metric: row.value for row in cell_rows}
            entry, on_body, network = find_method(method), scene.dressed is not None, method in KINDS
            assert costs & set(values) == (costs if entry.timed else set())
            assert not entry.timed or (values["cost/whole"] > values["cost/frame"]) == on_body
            assert {f"energy/{term}" for term in scene.terms} | expected <= set(values)
            assert against & set(values) == (set() if method == "simulation" else against)
            # Nobody knows how another material, or a solver started by a network, answers to held poses.
            answered = on_body and (network or method == "skinning" or shares_quasi_static(entry))
            for metric, has_it in {
                "penetration/vertices": scene.obstacle is not None,
                "cost/train": entry.trained is not None,
                "cost/batch": network and entry.timed,
                # What has an answer to poses held still: networks, skinning, and the simulator on a body.
                "dynamics/quasi_static_difference": network
                or (on_body and method in ("skinning", "simulation")),
                "dynamics/amplitude": answered,
                "dynamics/common_amplitude": on_body,
            }.items():
                assert (metric in values) == has_it, (name, method, metric)
            if method == "simulation" and on_body:
                assert values["dynamics/amplitude"] == pytest.approx(1.0)
            if method == "skinning":
                assert values["dynamics/amplitude"] == values["dynamics/quasi_static_difference"] == 0.0
            assert not network or (values["cost/data"] > 0.0) == (method == "supervised-vertices")
        of = {r.method: r.value for r in rows if r.scene == name and r.metric == "gap/local"}
        assert of["simulation"] == pytest.approx(0.0, abs=1e-12)
        errors = [
            r for r in rows if r.scene == name and r.metric == "distance/rms" and r.suite == "speed"
        ]
        twins = {r.method: r.value for r in errors if r.family == "simulation-perturbed"}
        # So few frames do not drive two runs apart [mm]; as little is what a distance to the reference
        # means.
        assert 0.0 < twins["simulation-perturbed-1e-9"] < 1e-3


@pytest.mark.parametrize("name", ["simulation", "skinning", "snug", "skinning+lbfgs-1", "snug+newton-1"])
def test_a_run_that_is_done_again_gives_the_same_and_inputs_are_what_it_takes_as_ready(name, run, scenes):
    plan, _, executor = run
    scene = scenes[BODY]
    cell = next(cell for cell in plan.cells if (cell.scene.name, cell.method) == (BODY, name))
    method = prepared(cell.entry, scene, executor.folder.models_of(cell.scene.garment))
    first, again = method.run().positions, method.run().positions
    assert np.array_equal(first, again)
    assert np.array_equal(first, trajectory_of(run, BODY, name).positions)
    last = scene.frames - 1
    fields = method.inputs(scene)(last)
    pose, body = fields if "+" in name else (fields, fields)
    if name not in ("skinning", "snug"):
        assert np.abs(body[0] - scene.obstacle.positions[last]).max() < 1e-12
    if name.startswith(("skinning", "snug")):
        features, transforms, pelvis = pose
        assert (features is None) == name.startswith("skinning") and transforms.shape == (24, 3, 4)
        rest, shifts = scene.dressed.body.joints()[0], scene.dressed.motion.translations
        assert np.array_equal(pelvis, rest + shifts[last])
    assert Method().inputs(scenes["hanging_sheet"]) is None


def test_energies_of_judged_frames_are_kept_of_references_baselines_and_networks(run, rows, scenes):
    folder, scene = run[1].cache.folder, scenes[BODY]
    run_folder.write_frame_energies(folder, rows)
    table = run_folder.read_frame_energies(folder.frame_energies_path)
    assert list(table) == ["scene", "method", "seed", "seconds", *scene.terms, "total"]
    names = {entry.name for entry in CHOSEN if entry.role in ("reference", "baseline", "network")}
    assert set(table["method"]) == names and set(table["scene"]) == {BODY}
    means = {(r.method, r.metric): r.value for r in rows if (r.suite, r.scene) == ("garments", BODY)}
    for method, lines in table.groupby("method"):
        judged = scene.dt * np.arange(scene.warm_up, scene.frames)
        assert lines["seconds"].to_numpy() == pytest.approx(judged, abs=1e-4)
        for term in (*scene.terms, "total"):
            mean = means[method, f"energy/{term}"]
            assert lines[term].mean() == pytest.approx(mean, rel=1e-4, abs=1e-9)


def test_a_roll_out_that_is_lost_is_measured_up_to_there_and_ends_no_other_ones_metrics():
    scene = small_scene("hanging_sheet", cells=4, frames=5)
    falling = np.asarray(scene.start) + 0.001 * np.arange(scene.frames)[:, None, None]
    lost = {
        "simulation": (9, 0.0),
        "newton-1": (3, np.nan),
        "newton-4": (0, np.inf),
        "newton-8": (4, 1e200),
    }
    spoilt = {}
    for method, (first, value) in lost.items():
        spoilt[method] = falling.copy()
        spoilt[method][first:] = value
    group = grouped(scene, spoilt, suites=("speed",))
    for roll_out in group.roll_outs[1:]:
        roll_out.status = "diverged"
    with np.errstate(all="ignore"):
        metrics, curves, _ = zip(*(measure_roll_out(roll_out) for roll_out in group.roll_outs))
    metrics, curves = dict(zip(lost, metrics)), dict(zip(lost, curves))
    plain = {m: {n: getattr(v, "value", v) for n, v in values.items()} for m, values in metrics.items()}
    assert np.isfinite(list(plain["simulation"].values())).all() and metrics["newton-4"] == {}
    assert plain["newton-1"]["distance/rms"] == 0.0 and np.isfinite(plain["newton-1"]["gap/energy"])
    assert np.isnan(plain["newton-8"]["gap/energy"])
    total = curves["newton-1"]["energy/total"]
    assert len(total) == 3 and np.isfinite(total).all()
