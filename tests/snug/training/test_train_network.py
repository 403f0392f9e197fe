"""Training lowers the physics, repeats bit for bit, survives files, and names what goes wrong."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from safetensors.torch import save_file

from snug.kinds import KINDS
from snug.named_recipes import PAPER
from snug.networks import trained_model
from snug.networks.roll_out import roll_out
from snug.networks.trained_model import ModelFileError, TrainedModel
from snug.recipe import DEFAULT
from snug.training.augmentation import augment
from snug.training.optimisation_step import Trainer
from snug.training.train_network import train_network, untrained_model
from snug.training.training_set import TrainingSet
from tests.snug.training.dressing import PLAIN, leaning, make_trainer, swaying, tube_dress


def short(kind="snug", *, steps=60, seed=0, recipe=PLAIN, motions=None, **options):
    clips = motions or [swaying(30)]
    options = {"progress": False, "every": 10, **options}
    return train_network(kind, tube_dress(), clips, steps=steps, seed=seed, recipe=recipe, **options)


def test_training_lowers_the_potential():
    trained = short(steps=100)
    first, last = trained.history[0], trained.history[-1]
    assert last["loss"] < 0.9 * first["loss"] and last["strain"] < first["strain"]
    parts = sum(last[term] for term in DEFAULT.terms)
    assert last["loss"] == pytest.approx(parts, rel=1e-6) and last["step"] == 100


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
        return Trainer("snug", tube_dress(), [swaying(30)], steps=1, seed=seed, recipe=SHAPED).data

    mine, dressed = data(0), tube_dress()
    drawn = mine.shapes[1:]
    assert not mine.shapes[0].any() and len(drawn) == 6 and len(np.unique(drawn)) == drawn.size
    assert 2.5 < np.abs(drawn).max() <= 3.0 and 0.2 < (drawn > 0).mean() < 0.8
    assert np.array_equal(data(0).shapes, mine.shapes) and not np.isin(data(1).shapes[1:], drawn).any()
    clips = augment([swaying(30)], SHAPED, vertices=dressed.vertices, seed=0)
    windows = np.array([4, np.flatnonzero(mine.starts == mine.first[3] + 7)[0]])
    batch = mine.batch(windows)
    for row, (motion, betas, first) in enumerate([(swaying(30), None, 4), (clips[2], drawn[2], 7)]):
        now = slice(first, first + 3)
        assert torch.allclose(batch.rest[row, 0], dressed.rest(betas), atol=1e-6)
        assert torch.allclose(batch.transforms[row], dressed.transforms(motion.poses, betas)[now])
        assert torch.equal(batch.features[row], dressed.features(motion, SHAPED, betas)[now])


def test_other_skeletons_pose_as_the_body_does():
    dressed, motion = tube_dress(), leaning(swaying(12))
    data = TrainingSet(dressed, [motion], PLAIN, features="motion", sequences=True)
    betas = np.random.default_rng(0).uniform(-3, 3, (2, 10))
    batch = data.batch(np.array([1, 5]), betas)
    assert torch.allclose(batch.transforms[1], dressed.transforms(motion.poses[5:8], betas[1]), atol=1e-5)
    assert torch.allclose(batch.rest[1, 0], dressed.rest(betas[1]))
    assert torch.allclose(batch.features[1], dressed.features(motion, PLAIN, betas[1])[5:8], atol=1e-6)


def test_untrained_is_not_skinning_alone():
    dressed, motion = tube_dress(), swaying()
    model = untrained_model("snug", dressed, [motion], seed=0)
    gap = roll_out(model, dressed, motion).positions - dressed.skinned(motion, smoothing=20)
    assert 1e-3 < np.abs(gap).max() < 0.1 and model.steps == 0


def test_without_a_recipe_the_kinds_own_is_taken():
    kind = "pbns"
    model = train_network(kind, tube_dress(), [swaying(30)], steps=1, seed=0, progress=False)
    assert model.recipe == KINDS[kind].recipe
    untrained = untrained_model(kind, tube_dress(), [swaying(30)], seed=0)
    assert untrained.recipe == replace(KINDS[kind].recipe, zero_last_layer=False)


def test_files_that_are_no_models_are_named(tmp_path, monkeypatch):
    save_file({"a": torch.zeros(2)}, tmp_path / "foreign.safetensors")
    monkeypatch.setattr(trained_model, "MODEL_FORMAT", "snug-model-5")
    untrained_model("pbns", tube_dress(), [swaying()], seed=0).save(tmp_path / "old.safetensors")
    monkeypatch.undo()
    for name, message in (
        ("none", "no such model"),
        ("foreign", "no model of this project"),
        ("old", r"old\.safetensors: format 'snug-model-5', this version reads"),
    ):
        with pytest.raises(ModelFileError, match=message):
            TrainedModel.load(tmp_path / f"{name}.safetensors")


GOOD = tube_dress().skinned(swaying(30))
BROKEN = np.where(np.arange(30)[:, None, None] == 17, np.nan, GOOD)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"kind": "supervised"}, "needs trajectories"),
        ({"kind": "supervised", "trajectories": {"walk": GOOD}}, "'sway'"),
        ({"kind": "supervised", "trajectories": {"sway": GOOD[:-1]}}, r"\(29, 150, 3\), expected \(30, 150"),
        ({"kind": "supervised", "trajectories": {"sway": BROKEN}}, "frame 17"),
        ({"steps": 0}, "steps=0"),
        ({"motions": [swaying(2)]}, "has 3 frames"),
        ({"motions": [swaying(30), swaying(30, fps=60.0)]}, "one frame rate"),
        ({"kind": "gnn"}, r"'gnn'.*snug, pbns, supervised"),
    ],
)
def test_impossible_trainings_are_refused(given, message):
    with pytest.raises(ValueError, match=message):
        short(**given)


def test_paper_recipe_varies_the_body(monkeypatch):
    trainer, shapes = make_trainer(PAPER), []
    monkeypatch.setattr(trainer, "learn", lambda number, windows, betas, state: shapes.append(betas) or {})
    for number in range(8):
        trainer.step(number)
    betas = np.concatenate(shapes)
    assert betas.shape == (8 * 16, 10) and 2.5 < betas.max() <= 3 and -3 <= betas.min() < -2.5
