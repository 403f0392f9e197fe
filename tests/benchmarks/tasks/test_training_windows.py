"""Windows beside roll-outs: equal where the state says nothing, apart where it does; who is looked at."""

from __future__ import annotations

import dataclasses
from dataclasses import replace

import numpy as np
import pytest
import torch

from benchmarks.assets.assets import Assets
from benchmarks.methods import find_method
from benchmarks.plan.plan import Motions, Plan
from benchmarks.plan.selection import Request, choose
from benchmarks.presets import find_preset
from benchmarks.results.run_folder import RunFolder
from benchmarks.runner.schedule import tasks_of
from benchmarks.tasks.task import Context, Outcome
from benchmarks.tasks.training_windows import CompareWindows, _loss, both_losses
from snug.body.skinning import skin
from snug.recipes.recipe import DEFAULT
from snug.training.train import train, untrained_model
from snug.training.trainer import Trainer
from tests.benchmarks.runner.tasks_by_hand import training as training_task
from tests.snug.training.dressing import swaying, tube_dress

SMOKE = find_preset("smoke")
MOTIONS = [swaying(30), swaying(24, name="slow", degrees=10.0)]


def test_a_network_at_its_zero_start_does_in_windows_what_it_does_in_roll_outs():
    model = untrained_model("snug", tube_dress(), MOTIONS, seed=0, recipe=DEFAULT)
    with torch.no_grad():
        model.network.offsets.weight.zero_()
        model.network.offsets.bias.zero_()
    window, roll_out = both_losses(model, tube_dress(), MOTIONS)
    assert window == pytest.approx(roll_out, rel=1e-6) and window > 0.0


def test_a_network_that_lives_on_its_state_does_not():
    model = untrained_model("snug", tube_dress(), MOTIONS, seed=0)
    window, roll_out = both_losses(model, tube_dress(), MOTIONS)
    assert abs(window - roll_out) > 1e-3 * window


def test_windows_that_remember_the_one_before_go_on_as_a_roll_out_but_for_their_noise():
    recipe = replace(DEFAULT, h0_sigma=0.0)
    model = untrained_model("snug", tube_dress(), MOTIONS, seed=0, recipe=recipe)
    with torch.no_grad():
        model.network.offsets.weight.normal_()
    window, roll_out = both_losses(model, tube_dress(), MOTIONS)
    assert window == pytest.approx(roll_out, rel=1e-5)
    model.recipe = replace(recipe, h0_sigma=0.3)
    assert both_losses(model, tube_dress(), MOTIONS)[0] != pytest.approx(roll_out, rel=1e-3)
    model.recipe = replace(recipe, remembered=False)
    assert both_losses(model, tube_dress(), MOTIONS)[0] != pytest.approx(roll_out, rel=1e-3)


def test_a_run_without_a_network_has_no_windows_to_look_at(tmp_path):
    def kinds(**words):
        suites = words.pop("suites", ("garments",))
        motions = Motions(("walk",), ("kick",), {}, ("walk",), ("twist_stop",))
        cells = choose(Request(suites=suites, preset=SMOKE, motions=motions, **words))[0]
        plan = Plan(
            preset=SMOKE, suites=suites, cells=cells, cases=(), motions=motions, seeds=(0,), device="cpu",
            folder=tmp_path, command="",
        )  # fmt: skip
        tasks = tasks_of(plan)
        assert not any(task.process for task in tasks if task.kind == "windows")
        return [task.name for task in tasks if task.kind == "windows"]

    assert kinds() == [f"tshirt/{name}-seed0" for name in ("snug", "supervised", "pbns")]
    assert kinds(methods=("simulation",)) == kinds(methods=("untrained",)) == []
    assert kinds(suites=("speed",)) == []
    assert kinds(methods=("snug+cleanup",), seeds=(3,)) == ["tshirt/snug-seed3"]
    assert kinds(scenes=("skirt/*",)) == []  # windows of one garment are enough


def test_what_was_judged_before_leaves_no_trace(monkeypatch):
    trainer = Trainer("snug", tube_dress(), MOTIONS, steps=1, seed=0, recipe=replace(DEFAULT, mixed=0.0))
    batch = trainer.data.batch(np.arange(4), None)
    x = skin(batch.rest, trainer.weights, batch.transforms) - torch.tensor([0.0, 0.0, 0.08])  # deep inside
    first = _loss(trainer, batch, x)
    _loss(trainer, batch, x + torch.tensor([0.0, 0.1, 0.0]))  # its anchors are no good for x
    assert _loss(trainer, batch, x) == first
    monkeypatch.setattr(trainer.contact, "search", None)  # vertices that are nowhere have no closest points
    assert np.isnan(_loss(trainer, batch, torch.nan * x))


def done(tmp_path, motions, name, model, seed=0):
    """The rows of a network in the folder of a run, and their task."""
    dressed, folder = tube_dress(), RunFolder(tmp_path)
    training = dataclasses.replace(training_task(name, *(m.name for m in motions), steps=1), seed=seed)
    model.save(training.path(folder))
    known = {motion.name: motion for motion in motions}
    context = Context(folder, Assets(dressed.body, {"tshirt": dressed.garment}, known, {}))
    task = CompareWindows(
        name=training.name, label=name, inputs={}, modules=("x",), needs=(training.id,), training=training,
        entry=find_method(name),
    )  # fmt: skip
    return task.rows(task.run(context, {})), task


def test_rows_are_those_of_networks_that_energies_taught(tmp_path):
    dressed = tube_dress()
    model = train("snug", dressed, MOTIONS, steps=3, seed=1, progress=False)
    model.summary["high_windows"] = 2
    found, task = done(tmp_path, MOTIONS, "snug", model, seed=1)
    assert {(row.suite, row.scene, row.method, row.seed) for row in found} == {
        ("garments", "training", "snug", 1)
    }
    assert {(row.role, row.dtype, row.garment) for row in found} == {("network", "float32", "tshirt")}
    values = {row.metric: row.value for row in found}
    assert set(values) == {"train/window", "train/roll_out", "train/high_windows", "train/step"}
    assert values["train/roll_out"] > 0.0 and values["train/high_windows"] == 2.0
    (row,) = task.rows(Outcome("failed", "why", failed=True))
    assert (row.status, row.reason, row.value) == ("failed", "why", None)
    static = train("pbns", dressed, MOTIONS, steps=2, seed=0, progress=False)
    assert done(tmp_path, MOTIONS, "pbns", static)[0] == []
    assert done(tmp_path, MOTIONS, "snug", untrained_model("snug", dressed, MOTIONS, seed=0))[0] == []


def test_a_network_that_is_not_finite_has_diverged(tmp_path):
    model = train("snug", tube_dress(), MOTIONS, steps=1, seed=0, progress=False)
    with torch.no_grad():
        model.network.offsets.bias.fill_(torch.nan)
    found, _ = done(tmp_path, MOTIONS, "snug", model)
    states = {row.metric: (row.status, row.value) for row in found}
    assert states["train/window"] == states["train/roll_out"] == ("diverged", None)
    assert states["train/step"][0] == "ok" and all(row.passed or row.reason for row in found)


def test_a_network_whose_windows_are_longer_than_every_motion_costs_no_other(tmp_path):
    recipe = replace(DEFAULT, window=24, batch=2, mixed=0.0)
    model = train("snug", tube_dress(), MOTIONS, steps=1, seed=0, recipe=recipe, progress=False)
    (row,), _ = done(tmp_path, [swaying(12)], "snug", model)
    assert row.status == "skipped" and "24 frames" in row.reason


def test_high_windows_are_counted_where_high_means_the_same(tmp_path):
    recipe = replace(DEFAULT, spike=9.0, mixed=0.0)
    model = train("snug", tube_dress(), MOTIONS, steps=1, seed=0, recipe=recipe, progress=False)
    found, _ = done(tmp_path, MOTIONS, "snug", model)
    assert {row.metric for row in found} == {"train/window", "train/roll_out", "train/step"}
