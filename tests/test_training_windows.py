"""Windows beside roll-outs: equal where the state says nothing, apart where it does; who is looked at."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import pytest
import torch
from dressing import swaying, tube_dress

from benchmarks.methods.networks import model_path
from benchmarks.results import RunFolder
from benchmarks.studies.training_windows import both_losses, rows
from snug.recipe import DEFAULT
from snug.train import train, untrained_model

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


def test_a_run_without_a_network_has_no_windows_to_look_at():
    def named(names):
        raise KeyError(names[0])  # the motions of training are loaded for networks alone

    wardrobe = SimpleNamespace(body=None, garment=None, named=named)
    assert rows(SimpleNamespace(models=(), train=("walk",)), RunFolder(Path()), wardrobe) == []


def test_rows_are_those_of_networks_that_energies_taught(tmp_path):
    dressed, folder = tube_dress(), RunFolder(tmp_path)
    train("snug", dressed, MOTIONS, steps=3, seed=1, progress=False).save(
        model_path(folder.models, "snug", 1)
    )
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
    assert values["train/roll_out"] > 0.0 and values["train/high_windows"] == 0.0
