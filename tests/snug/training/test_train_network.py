"""Training follows its recipe, survives files, and names what goes wrong; so does its command."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from safetensors.torch import save_file

from snug.named_recipes import PAPER, SUPERVISED
from snug.networks import trained_model
from snug.networks.trained_model import TensorFileError, TrainedModel
from snug.recipe import DEFAULT
from snug.train import choose_motions, main, parse_options
from snug.training.augmentation import augment
from tests.snug.training.dressing import PLAIN, make_trainer, random_model, short, swaying, tube_dress


@pytest.mark.parametrize(
    ("schedule", "wanted"),
    [("cosine", (1.0, 0.505, 0.01)), ("epochs", (1.0, 1.0, 0.1))],
)
def test_rate_follows_its_schedule(schedule, wanted):
    recipe = replace(PLAIN, schedule=schedule)
    trainer = make_trainer(recipe, steps=40)
    for number, epoch, share in zip((0, 20, 40), (1, 10, 11), wanted):
        trainer.epoch = epoch
        trainer._set_rate(number)
        rate = trainer.optimiser.param_groups[0]["lr"]
        assert rate == pytest.approx(share * PLAIN.learning_rate, rel=1e-9)


SHAPED = replace(DEFAULT, shape_range=3.0, shape_of="clip")


def test_each_mixed_clip_has_a_body_of_its_own_and_given_motions_the_mean_one():
    def data(seed):
        return make_trainer(SHAPED, seed=seed).data

    mine, dressed = data(0), tube_dress()
    shapes = mine.shapes[1:]
    assert not mine.shapes[0].any() and len(shapes) == 6 and len(np.unique(shapes)) == shapes.size
    assert 2.5 < np.abs(shapes).max() <= 3.0 and 0.2 < (shapes > 0).mean() < 0.8
    assert np.array_equal(data(0).shapes, mine.shapes) and not np.isin(data(1).shapes[1:], shapes).any()
    clips = augment([swaying(30)], SHAPED, vertices=dressed.vertices, seed=0)
    windows = np.array([4, np.flatnonzero(mine.starts == mine.first[3] + 7)[0]])
    batch = mine.batch(windows)
    for row, (motion, betas, first) in enumerate([(swaying(30), None, 4), (clips[2], shapes[2], 7)]):
        now = slice(first, first + 3)
        assert torch.allclose(batch.rest[row, 0], dressed.rest(betas), atol=1e-6)
        assert torch.allclose(batch.transforms[row], dressed.transforms(motion.poses, betas)[now])
        assert torch.equal(batch.features[row], dressed.features(motion, SHAPED, betas)[now])


def test_files_that_are_no_models_are_named(tmp_path, monkeypatch):
    foreign, old = (tmp_path / f"{name}.safetensors" for name in ("foreign", "old"))
    save_file({"a": torch.zeros(2)}, foreign)
    monkeypatch.setattr(trained_model, "MODEL_FORMAT", "snug-model-5")
    random_model("pbns", tube_dress(), [swaying()], seed=0).save(old)
    monkeypatch.undo()
    with pytest.raises(TensorFileError, match="no model of this project"):
        TrainedModel.load(foreign)
    with pytest.raises(
        TensorFileError, match=r"old\.safetensors: format 'snug-model-5', this version reads"
    ):
        TrainedModel.load(old)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"kind": "supervised", "trajectories": None}, "needs trajectories"),
        ({"steps": 0}, "steps=0"),
        ({"motions": [swaying(30), swaying(30, fps=60.0)]}, "one frame rate"),
        ({"recipe": SUPERVISED}, "physics_weight=.*: snug learns no simulated vertices"),
        ({"kind": "gnn"}, r"'gnn'.*snug, pbns, supervised"),
    ],
)
def test_impossible_trainings_are_refused(given, message):
    with pytest.raises(ValueError, match=message):
        short(**given)


def test_paper_recipe_varies_the_body(monkeypatch):
    trainer, shapes = make_trainer(PAPER), []
    monkeypatch.setattr(
        trainer, "learn", lambda number, windows, betas, state: shapes.append(betas) or {}
    )
    for number in range(8):
        trainer.step(number)
    betas = np.concatenate(shapes)
    assert betas.shape == (8 * 16, 10) and 2.5 < betas.max() <= 3 and -3 <= betas.min() < -2.5


def test_test_clips_of_a_published_split_do_not_train(tmp_path, capsys):
    for name in ("01_01", "02_04", "05_16"):
        np.savez(tmp_path / f"{name}.npz", poses=np.zeros((12, 72)), trans=np.zeros((12, 3)), fps=30.0)
    [training] = choose_motions(parse_options(["--motions", f"{tmp_path},split=snug"]))
    assert training.name == "02_04"
    assert "54 of 56 clips are absent: 07_02, 55_27, 104_54, 02_05," in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "hint"),
    [
        ("-o {0}/file/model.safetensors", "file"),
        ("--seed -1", "seed=-1: give a number from 0"),
        ("--motions {0}/nowhere", "nowhere"),
    ],
)
def test_command_line_refuses_what_it_could_not_do(arguments, hint, refused, tmp_path):
    (tmp_path / "file").touch()
    options = ["-o", str(tmp_path / "model.safetensors"), "--vertices", "200"]
    refused(hint, main, [*options, *arguments.format(tmp_path).split()])
