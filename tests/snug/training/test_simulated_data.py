"""Networks learn from a file of simulated motions without having it in memory."""

from __future__ import annotations

import dataclasses
import shutil
import signal
from pathlib import Path

import h5py
import numpy as np
import pytest

from snug import train as train_command
from snug.motion.library import make_motion
from snug.motion.motion import Motion
from snug.named_recipes import RECIPE_OF_KIND
from snug.networks.tensor_file import TensorFileError
from snug.training import train_to_file
from snug.training.checkpoint import Checkpoint
from snug.training.simulated_data import DataSet, settings_of, write_data_set
from snug.training.train_network import train_network
from snug.training.training_loop import Interrupted
from tests.snug.training.dressing import tube_dress

FRAMES = 18  # two windows of the supervised network
NAMES = ("07_01", "02_01", "02_02")


def simulations() -> list[tuple[Motion, np.ndarray]]:
    """In place of simulations: the tube skinned to the body."""
    motions = [make_motion(name).cut(0, FRAMES) for name in NAMES]
    return [(motion, np.asarray(tube_dress().skinned(motion), dtype=float)) for motion in motions]


@pytest.fixture(scope="module")
def built(tmp_path_factory) -> Path:
    path, dressed = tmp_path_factory.mktemp("data") / "three.h5", tube_dress()
    write_data_set(path, dressed.body, dressed.garment, simulations())
    return path


@pytest.fixture
def mine(built, tmp_path) -> Path:
    """A copy to damage."""
    return Path(shutil.copy(built, tmp_path / "mine.h5"))


def taught(built: Path, kind: str, *, stored: bool, steps: int = 3, **options):
    """A network of the file, from it or from memory."""
    data_set = DataSet.read(built)
    trajectories = data_set.targets if stored else {motion.name: x for motion, x in simulations()}
    return train_network(
        kind, tube_dress(), data_set.motions, steps=steps, seed=0, recipe=RECIPE_OF_KIND[kind],
        trajectories=trajectories, progress=False, every=1, **options,
    )  # fmt: skip


def test_the_file_holds_motions_and_what_was_simulated(built):
    data_set = DataSet.read(built)
    for motion, (given, positions) in zip(data_set.motions, simulations(), strict=True):
        assert motion.name == given.name and np.array_equal(motion.poses, given.poses)
        seen = positions[3:7] - tube_dress().pelvis(given)[3:7, None]
        stored = data_set.targets[motion.name]
        assert np.array_equal(stored.read(slice(3, 7), ""), seen.astype(np.float32))


@pytest.mark.parametrize("kind", ["supervised", "tailornet"])
def test_files_teach_the_same_as_memory_to_the_last_bit(built, kind, narrow):
    memory_model, stored = (taught(built, kind, stored=stored) for stored in (False, True))
    for name, tensor in memory_model.network.state_dict().items():
        assert tensor.equal(stored.network.state_dict()[name]), name
    assert [row["loss"] for row in memory_model.history] == [row["loss"] for row in stored.history]


def test_a_training_from_files_goes_on_only_with_the_same_files(built, mine, tmp_path):
    checkpoint = Checkpoint(path=tmp_path / "c.safetensors", resume=True)
    count = iter(range(10))
    with pytest.raises(Interrupted):
        taught(
            built, "supervised", stored=True, steps=4, checkpoint=checkpoint, stop=lambda: next(count) == 1
        )
    whole, resumed = taught(built, "supervised", stored=True, steps=4), None
    with h5py.File(mine, "a") as file:
        file["0"].attrs["digest"] = "0"
    with pytest.raises(TensorFileError, match="another data"):
        taught(mine, "supervised", stored=True, steps=4, checkpoint=checkpoint)
    resumed = taught(built, "supervised", stored=True, steps=4, checkpoint=checkpoint)
    for name, tensor in whole.network.state_dict().items():
        assert tensor.equal(resumed.network.state_dict()[name]), name


def _not_finite(file):
    file["1/vertices"][5, 7, 1] = np.nan


def _replace(value):
    def damage(file):
        del file["1/vertices"]
        if value is not None:
            file["1/vertices"] = value

    return damage


@pytest.mark.parametrize(
    ("kind", "damage", "message"),
    [
        ("supervised", _not_finite, "'02_01' is not finite at frame 5"),
        ("tailornet", _not_finite, "'02_01' is not finite at frame 5"),
        ("supervised", _replace(np.zeros((17, 150, 3), np.float32)), "expected \\(18, 150, 3\\) of float32"),
        ("supervised", _replace(np.zeros((18, 150, 3))), "of float64, expected"),
        ("supervised", _replace(None), "02_01"),
        ("supervised", lambda file: file.attrs.update(format=9), "format 9; this version reads 2"),
        ("supervised", lambda file: file.attrs.update(settings="[]"), "no file of simulated motions"),
        ("supervised", lambda file: file["0"].attrs.pop("fps"), "no file of simulated motions"),
    ],
)
def test_a_file_that_is_not_as_it_was_written_is_named(mine, kind, damage, message):
    with h5py.File(mine, "a") as file:
        damage(file)
    with pytest.raises(ValueError, match=message) as caught:
        taught(mine, kind, stored=True)
    assert "\n" not in str(caught.value)


def test_the_command_learns_from_the_file(built, tmp_path, capsys, refused, monkeypatch):
    out = tmp_path / "m.safetensors"
    given = ["--dataset", str(built), "--steps", "2", "-o", str(out), "--model", "supervised"]
    monkeypatch.setattr(signal, "signal", lambda *_: None)
    refused("garment: tube there, tshirt here", train_command.main, [*given, "--vertices", "300"])
    monkeypatch.setattr(train_to_file, "_tailored_garment", lambda name: train_to_file.ChosenGarment(
        "tube", "a tube", lambda body, vertices: tube_dress().garment))  # fmt: skip
    assert train_command.main(given) == 0
    assert out.is_file() and "3 motions, 54 frames, recipe supervised" in capsys.readouterr().out
    text = tmp_path / "text.h5"
    text.write_text("no HDF5")
    for options, message in (
        (["--model", "supervised"], "learns from simulations; add --dataset FILE"),
        (["--dataset", "x", "--motions", "y"], "leave out --motions"),
        (["--dataset", "x", "--model", "tailornet", "--recipe", "paper"], "leave out --recipe"),
        (["--dataset", str(tmp_path)], "no such file"),
        (["--dataset", str(text)], "no file of simulated motions"),
    ):
        refused(message, train_command.main, options)


def test_settings_tell_garments_and_bodies_apart():
    dressed = tube_dress()
    settings = settings_of(dressed.body, dressed.garment)
    moved = dressed.garment.rest_positions.copy()
    moved[3, 1] += 1e-5
    larger = dataclasses.replace(dressed.body, template=1.01 * dressed.body.template)
    others = {
        "mesh": settings_of(dressed.body, dataclasses.replace(dressed.garment, rest_positions=moved)),
        "body": settings_of(larger, dressed.garment),
    }
    for name, other in others.items():
        assert [key for key in settings if settings[key] != other[key]] == [name]
    rounded = dataclasses.replace(dressed.garment, rest_positions=dressed.garment.rest_positions + 1e-12)
    assert settings_of(dressed.body, rounded) == settings
