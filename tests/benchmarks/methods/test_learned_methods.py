"""Further baselines and ablations run when they are named or at a preset that holds them, never unasked."""

from __future__ import annotations

import pytest
import torch

from benchmarks.methods import METHODS
from benchmarks.methods.declared_networks import TRAININGS
from benchmarks.presets import PRESETS
from benchmarks.results.run_folder import RunFolder, model_path
from benchmarks.runner.networks import train
from snug.kinds import KINDS
from snug.networks.trained_model import TrainedModel
from tests.benchmarks.runner.tasks_by_hand import assets_of, context, training
from tests.snug.training.dressing import swaying, tube_dress


def test_every_kind_is_a_method_and_every_trained_method_has_steps_in_each_preset():
    trained = [entry for entry in METHODS if entry.trained not in (None, "untrained")]
    kinds = [(entry.training or TRAININGS[entry.trained]).kind for entry in trained]
    assert set(kinds) == set(KINDS)
    for entry, kind in zip(trained, kinds):
        assert entry.seeded != KINDS[kind].fitted and entry.reporting.pairing_group
        assert all(preset.steps_of(entry.trained, kind) > 0 for preset in PRESETS)


CHECKPOINT = ".snug-seed0.checkpoint.safetensors"


def test_a_training_that_was_killed_goes_on_where_it_was(tmp_path, monkeypatch):
    monkeypatch.setattr("benchmarks.runner.networks.CHECKPOINT_MINUTES", 1e-9)
    monkeypatch.setattr("benchmarks.runner.networks.LOG_EVERY", 4)
    monkeypatch.setattr("benchmarks.runner.networks.PREPARATION", 0.03)  # s, half of the expected time
    dressed, motion = tube_dress(), swaying(30)
    assets = assets_of(dressed, motion)

    def trained(folder, key, tell):
        job = training("snug", motion.name, steps=12, key=key)
        return train(job, context(folder, assets, tell=tell), {})

    def killed(share):
        reports.append(share)
        if len(reports) == 2:
            raise KeyboardInterrupt

    reports, went_on = [], []
    models = RunFolder(tmp_path).models
    for key in ("before", "now"):  # the first is another training: of other inputs, or of other code
        reports.clear()
        with pytest.raises(KeyboardInterrupt):
            trained(tmp_path, key, killed)
        # A thirteenth is the preparation, and each report is of a third of the steps.
        assert reports == pytest.approx([1 / 13 + 4 / 13, 4 / 13])
        assert [path.name for path in models.iterdir()] == [CHECKPOINT]
    result = trained(tmp_path, "now", went_on.append).result
    assert (
        sum(went_on) == pytest.approx(1.0) and result["steps"] == 12 and len(went_on) < 3
    )  # of three reports
    (tmp_path / "damaged" / "models").mkdir(parents=True)
    (tmp_path / "damaged" / "models" / CHECKPOINT).write_bytes(b"half")
    trained(tmp_path / "damaged", "now", print)
    one, other = (
        TrainedModel.load(model_path(RunFolder(folder).models, "snug", 0)).network.state_dict()
        for folder in (tmp_path, tmp_path / "damaged")
    )
    assert all(torch.equal(one[name], other[name]) for name in one)
    assert [path.name for path in models.iterdir()] == ["snug-seed0.safetensors"]
