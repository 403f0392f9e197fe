"""Networks learn from a data set without having it in memory."""

from __future__ import annotations

import dataclasses
import signal
from pathlib import Path

import numpy as np
import pytest

from reference_sim.trajectory import Trajectory
from snug import train as train_command
from snug.networks.tensor_file import TensorFileError
from snug.recipes.named import RECIPE_OF_KIND
from snug.training.checkpoint import Checkpoint
from snug.training.losses.vertex_targets import TargetError
from snug.training.simulated_data import DataSet, settings_of
from snug.training.train_network import train_network
from snug.training.training_loop import Interrupted
from tests.benchmarks.datasets.data_by_hand import changed_index
from tests.snug.training.dressing import tube_dress


def taught(built: Path, kind: str, *, stored: bool, steps: int = 3, **options):
    """A network of the data set, from the files or from memory."""
    data_set = DataSet.read(built)
    trajectories: dict = data_set.targets()
    if not stored:
        trajectories = {
            line.name: Trajectory.load(built / line.trajectory).positions for line in data_set.sequences
        }
    return train_network(
        kind, tube_dress(), data_set.motions(), steps=steps, seed=0, recipe=RECIPE_OF_KIND[kind],
        trajectories=trajectories, progress=False, every=1, **options,
    )  # fmt: skip


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
    changed_index(mine, lambda i: i["sequences"][0]["digests"].update({i["sequences"][0]["vertices"]: "0"}))
    with pytest.raises(TensorFileError, match="another data"):
        taught(mine, "supervised", stored=True, steps=4, checkpoint=checkpoint)
    resumed = taught(built, "supervised", stored=True, steps=4, checkpoint=checkpoint)
    for name, tensor in whole.network.state_dict().items():
        assert tensor.equal(resumed.network.state_dict()[name]), name


@pytest.mark.parametrize(
    ("kind", "damage", "message"),
    [
        ("supervised", lambda x: x.__setitem__((5, 7, 1), np.nan) or x, "'02_01' is not finite at frame 5"),
        ("supervised", lambda x: x[:-1], "expected \\(18, 150, 3\\) of float32"),
        ("supervised", lambda x: x.astype(float), "of float64, expected"),
        ("supervised", lambda x: np.array(["a", None], dtype=object), "02_01"),
        ("supervised", lambda x: None, "02_01"),
        ("tailornet", lambda x: x.__setitem__((5, 7, 1), np.nan) or x, "'02_01' is not finite at frame 5"),
    ],
)
def test_vertices_that_are_not_as_the_index_says_are_named(mine, kind, damage, message):
    path = mine / DataSet.read(mine).sequences[1].vertices
    vertices = damage(np.load(path))
    path.write_bytes(path.read_bytes()[:-9]) if vertices is None else np.save(path, vertices)
    with pytest.raises(TargetError, match=message):
        taught(mine, kind, stored=True)


def test_the_command_learns_from_a_data_set(built, tube, tmp_path, capsys, refused):
    out = tmp_path / "m.safetensors"
    given = ["--dataset", str(built), "--steps", "2", "-o", str(out)]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(signal, "signal", lambda *_: None)
        assert train_command.main([*given, "--model", "supervised", "--garment", str(tube)]) == 0
        assert out.is_file() and "3 motions, 54 frames, recipe supervised" in capsys.readouterr().out
        refused("garment: tube there, tshirt here", train_command.main, [*given, "--vertices", "300"])
    for options, message in (
        (["--model", "supervised"], "learns from simulations; add --dataset DIR"),
        (["--dataset", "x", "--motions", "y"], "leave out --motions"),
        (["--dataset", "x", "--model", "tailornet", "--recipe", "paper"], "leave out --recipe"),
        (["--dataset", str(tmp_path)], "no such file"),
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
