"""Further baselines and ablations run when they are named or at a preset that holds them, never unasked."""

from __future__ import annotations

import pytest
import torch

from benchmarks.methods import METHODS
from benchmarks.methods.declared_networks import TRAININGS
from benchmarks.presets import PRESETS, find_preset
from benchmarks.results.run_folder import RunFolder, model_path
from benchmarks.runner.networks import train
from snug.kinds import KINDS
from snug.named_recipes import ABLATIONS, RECIPES
from snug.networks.trained_model import TrainedModel
from snug.recipe import TERMS
from tests.benchmarks.plan.planned import planned
from tests.benchmarks.runner.tasks_by_hand import assets_of, context, training
from tests.snug.training.dressing import swaying, tube_dress


def plan(*options):
    return planned("full:garments", *options)


@pytest.mark.parametrize("entry", [entry for entry in METHODS if entry.trained not in (None, "untrained")])
def test_every_trained_method_has_a_training_and_steps_in_each_preset(entry):
    kind = (entry.training or TRAININGS[entry.trained]).kind
    assert entry.seeded != KINDS[kind].fitted and entry.reporting.pairing_group
    assert all(preset.steps_of(entry.trained, kind) > 0 for preset in PRESETS)


def test_an_ablation_trains_as_long_as_the_whole():
    quick = find_preset("quick")

    def steps(name: str) -> int:
        return quick.steps_of(name, TRAININGS[name].kind if name in TRAININGS else name)

    assert steps("snug-no-bending") == steps("snug-springs") == quick.steps["snug"]
    assert steps("pbns-springs") == quick.steps["pbns"] and steps("untrained") == 0


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


def test_each_ablation_differs_from_the_default_in_what_its_name_says():
    changes = {
        recipe.name: {
            name: value for name, value in recipe.as_dict().items()
            if value != RECIPES["default"].as_dict()[name] and name != "name"
        }
        for recipe in ABLATIONS
    }  # fmt: skip
    assert changes["no-noise"] == {"h0_sigma": 0.0, "remembered": False} and changes["springs"] == {
        "material": "springs"
    }
    for term in ("bending", "strain", "gravity", "inertia"):
        assert set(TERMS) - set(changes[f"no-{term}"]["terms"]) == {term}
    for frames in (6, 12):
        changed = changes[f"window{frames}"]
        assert changed == {"window": frames, "batch": 48 // frames}
