"""Further baselines and ablations run when they are named or at a preset that holds them, never unasked."""

from __future__ import annotations

import pytest
import torch
from benchmarks.methods.networks import model_path
from benchmarks.training import train_network
from benchmarks.wardrobe import Wardrobe
from dressing import swaying, tube_dress

from benchmarks import training
from benchmarks.methods import METHODS, find_method
from benchmarks.methods.learned import LEARNED
from benchmarks.plan import Network
from benchmarks.presets import PRESETS, find_preset
from benchmarks.results import RunFolder
from benchmarks.run import make_parser, make_plan
from benchmarks.suites import garments
from snug.recipe import ABLATIONS, RECIPES, TERMS, TRAININGS
from snug.trained_model import TrainedModel


def plan(*words):
    return make_plan(make_parser().parse_args(["--suite", "garments", *words]), words)


def methods(*words):
    return {cell.method for cell in plan(*words).cells}


def test_they_run_when_named_and_not_otherwise(tmp_path):
    further = {entry.name for entry in LEARNED}
    out = ("-o", str(tmp_path))
    assert further <= set(garments.FURTHER) and not further & methods(*out)
    assert further < methods(*out, "--methods", "*")
    named = methods(*out, "--methods", "snug-no-*")
    assert named == {
        "snug-no-bending",
        "snug-no-strain",
        "snug-no-gravity",
        "snug-no-inertia",
        "snug-no-noise",
    }
    assert further < methods(*out, "--preset", "paper")


@pytest.mark.parametrize("entry", [entry for entry in METHODS if entry.trained not in (None, "untrained")])
def test_every_trained_method_has_a_training_and_steps_in_each_preset(entry):
    assert entry.trained in TRAININGS and entry.seeded
    assert all(preset.steps_of(entry.trained) > 0 for preset in PRESETS)


def test_an_ablation_trains_as_long_as_the_whole():
    quick = find_preset("quick")
    assert quick.steps_of("snug-no-bending") == quick.steps_of("snug-springs") == quick.steps["snug"]
    assert quick.steps_of("pbns-springs") == quick.steps["pbns"] and quick.steps_of("untrained") == 0


def test_what_is_cleaned_up_is_a_row_of_its_own_over_the_same_network(tmp_path):
    cleaned = find_method("snug+cleanup")
    assert cleaned.trained == find_method("snug").trained
    chosen = plan("-o", str(tmp_path), "--methods", "snug,snug+cleanup", "--seeds", "0,1")
    assert chosen.models == (("snug", 0), ("snug", 1))


def test_a_training_that_was_killed_goes_on_where_it_was(tmp_path, monkeypatch):
    monkeypatch.setattr(training, "CHECKPOINT_MINUTES", 1e-9)
    dressed = tube_dress()
    wardrobe = Wardrobe(dressed.body, {"tshirt": dressed.garment}, {"sway": swaying(30)})

    def trained(folder, key, tell):
        return train_network(wardrobe, tell, Network("snug", 0), 60, {"sway": None}, folder, "cpu", key)

    def killed(steps):
        told.append(steps)
        if len(told) == 2:
            raise KeyboardInterrupt

    told, went_on = [], []
    models = RunFolder(tmp_path).models
    for key in ("before", "now"):  # the first is another training: of other inputs, or of other code
        told.clear()
        with pytest.raises(KeyboardInterrupt):
            trained(tmp_path, key, killed)
        assert [path.name for path in models.iterdir()] == [f".snug-seed0.{key}.checkpoint.safetensors"]
    result = trained(tmp_path, "now", went_on.append)
    assert sum(went_on) == result.steps == 60 and len(went_on) < 3  # of three reports
    trained(tmp_path / "unbroken", "now", print)
    one, other = (
        TrainedModel.load(model_path(RunFolder(folder).models, "snug", 0)).network.state_dict()
        for folder in (tmp_path, tmp_path / "unbroken")
    )
    assert all(torch.equal(one[name], other[name]) for name in one)
    assert [path.name for path in models.iterdir()] == ["snug-seed0.safetensors"]


def test_a_training_that_fails_leaves_no_earlier_model_behind(tmp_path):
    folder = RunFolder(tmp_path)
    folder.models.mkdir()
    path = model_path(folder.models, "snug", 0)
    path.touch()
    with pytest.raises(AttributeError):
        train_network(
            None, print, Network("snug", 0), 2, {}, tmp_path, "cpu", "0"
        )  # there is no body to dress
    assert not path.exists()


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
