"""Windows beside roll-outs: equal where the state says nothing, apart where it does; who is looked at."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import torch
from benchmarks.methods.networks import model_path
from dressing import swaying, tube_dress

from benchmarks.results import RunFolder
from benchmarks.studies.training_windows import _loss, both_losses, rows
from snug.recipe import DEFAULT
from snug.skinning import skin
from snug.train import train, untrained_model
from snug.trainer import Trainer

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


def test_a_run_without_a_network_has_no_windows_to_look_at():
    def named(names):
        raise KeyError(names[0])  # the motions of training are loaded for networks alone

    wardrobe = SimpleNamespace(body=None, garment=None, named=named)
    assert rows(SimpleNamespace(models=(), train=("walk",)), RunFolder(Path()), wardrobe) == []


def test_what_was_judged_before_leaves_no_trace(monkeypatch):
    trainer = Trainer("snug", tube_dress(), MOTIONS, steps=1, seed=0, recipe=replace(DEFAULT, mixed=0.0))
    batch = trainer.data.batch(np.arange(4), None)
    x = skin(batch.rest, trainer.weights, batch.transforms) - torch.tensor([0.0, 0.0, 0.08])  # deep inside
    first = _loss(trainer, batch, x)
    _loss(trainer, batch, x + torch.tensor([0.0, 0.1, 0.0]))  # its anchors are no good for x
    assert _loss(trainer, batch, x) == first
    monkeypatch.setattr(trainer.contact, "search", None)  # vertices that are nowhere have no closest points
    assert np.isnan(_loss(trainer, batch, torch.nan * x))


def test_rows_are_those_of_networks_that_energies_taught(tmp_path):
    dressed, folder = tube_dress(), RunFolder(tmp_path)
    model = train("snug", dressed, MOTIONS, steps=3, seed=1, progress=False)
    model.summary["high_windows"] = 2
    model.save(model_path(folder.models, "snug", 1))
    train("pbns", dressed, MOTIONS, steps=2, seed=0, progress=False).save(
        model_path(folder.models, "pbns", 0)
    )
    untrained_model("snug", dressed, MOTIONS, seed=0).save(model_path(folder.models, "untrained", 0))
    models = (("snug", 1), ("snug", 2), ("pbns", 0), ("untrained", 0))
    wardrobe = SimpleNamespace(body=dressed.body, garment=dressed.garment, named=lambda names: MOTIONS)
    found = rows(SimpleNamespace(models=models, train=("sway", "slow")), folder, wardrobe)
    assert {(row.method, row.seed) for row in found} == {("snug", 1)}
    values = {row.metric: row.value for row in found}
    assert set(values) == {"train/window", "train/roll_out", "train/high_windows", "train/step"}
    assert values["train/roll_out"] > 0.0 and values["train/high_windows"] == 2.0


def test_a_network_that_is_not_finite_has_diverged(tmp_path):
    dressed, folder = tube_dress(), RunFolder(tmp_path)
    model = train("snug", dressed, MOTIONS, steps=1, seed=0, progress=False)
    with torch.no_grad():
        model.network.offsets.bias.fill_(torch.nan)
    model.save(model_path(folder.models, "snug", 0))
    wardrobe = SimpleNamespace(body=dressed.body, garment=dressed.garment, named=lambda names: MOTIONS)
    found = rows(SimpleNamespace(models=(("snug", 0),), train=("sway", "slow")), folder, wardrobe)
    states = {row.metric: (row.status, row.value) for row in found}
    assert states["train/window"] == states["train/roll_out"] == ("diverged", None)
    assert states["train/step"][0] == "ok" and all(row.passed or row.reason for row in found)


def test_a_network_whose_windows_are_longer_than_every_motion_costs_no_other(tmp_path):
    dressed, folder = tube_dress(), RunFolder(tmp_path)
    for seed, window in ((0, 24), (1, 3)):
        recipe = replace(DEFAULT, window=window, batch=2, mixed=0.0)
        model = train("snug", dressed, MOTIONS, steps=1, seed=seed, recipe=recipe, progress=False)
        model.save(model_path(folder.models, "snug", seed))
    short = [swaying(12)]
    wardrobe = SimpleNamespace(body=dressed.body, garment=dressed.garment, named=lambda names: short)
    found = rows(SimpleNamespace(models=(("snug", 0), ("snug", 1)), train=("sway",)), folder, wardrobe)
    assert {(row.seed, row.status) for row in found} == {(0, "skipped"), (1, "ok")}
    assert "24 frames" in next(row.reason for row in found if row.seed == 0)


def test_high_windows_are_counted_where_high_means_the_same(tmp_path):
    dressed, folder = tube_dress(), RunFolder(tmp_path)
    recipe = replace(DEFAULT, spike=9.0, mixed=0.0)
    model = train("snug", dressed, MOTIONS, steps=1, seed=0, recipe=recipe, progress=False)
    model.save(model_path(folder.models, "snug", 0))
    wardrobe = SimpleNamespace(body=dressed.body, garment=dressed.garment, named=lambda names: MOTIONS)
    found = rows(SimpleNamespace(models=(("snug", 0),), train=("sway", "slow")), folder, wardrobe)
    assert {row.metric for row in found} == {"train/window", "train/roll_out", "train/step"}
