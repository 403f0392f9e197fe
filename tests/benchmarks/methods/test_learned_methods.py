"""A training that was killed goes on where it was."""

from __future__ import annotations

import pytest
import torch

from benchmarks.results.run_folder import RunFolder, model_path
from benchmarks.runner.networks import train
from snug.networks.trained_model import TrainedModel
from snug.training.optimisation_step import Trainer
from tests.benchmarks.runner.tasks_by_hand import assets_of, context, training
from tests.snug.training.dressing import swaying, tube_dress

CHECKPOINT = ".snug-seed0.checkpoint.safetensors"


def test_a_training_that_was_killed_goes_on_where_it_was(tmp_path, monkeypatch):
    monkeypatch.setattr("benchmarks.runner.networks.CHECKPOINT_MINUTES", 1e-9)
    dressed, motion = tube_dress(), swaying(30)
    assets, step, done = assets_of(dressed, motion), Trainer.step, []

    def trained(folder, key, stop=99):
        """Train, in this run as far as some steps; `done` are those of this run."""

        def counted(self, number):
            if len(done) == stop:
                raise KeyboardInterrupt
            done.append(number)
            return step(self, number)

        done.clear()
        monkeypatch.setattr(Trainer, "step", counted)
        return train(training("snug", motion.name, steps=5, key=key), context(folder, assets), {})

    models = RunFolder(tmp_path).models
    for key in ("before", "now"):  # the first is another training: of other inputs, or of other code
        with pytest.raises(KeyboardInterrupt):
            trained(tmp_path, key, 3)
        assert done == list(range(3))
        assert [path.name for path in models.iterdir()] == [CHECKPOINT]
    assert trained(tmp_path, "now").result["steps"] == 5 and done == [3, 4]
    (tmp_path / "damaged" / "models").mkdir(parents=True)
    (tmp_path / "damaged" / "models" / CHECKPOINT).write_bytes(b"half")
    trained(tmp_path / "damaged", "now")
    one, other = (
        TrainedModel.load(model_path(RunFolder(folder).models, "snug", 0)).network.state_dict()
        for folder in (tmp_path, tmp_path / "damaged")
    )
    assert all(torch.equal(one[name], other[name]) for name in one)
    assert [path.name for path in models.iterdir()] == ["snug-seed0.safetensors"]
