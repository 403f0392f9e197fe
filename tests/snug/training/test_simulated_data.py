"""Networks learn from a file of simulated motions as from simulations in memory."""

from __future__ import annotations

import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest

from snug import train
from snug.motion.library import make_motion
from snug.motion.motion import Motion
from snug.training.simulated_data import read_data_set, write_data_set
from tests.snug.training.dressing import tube_dress

FRAMES = 18  # two windows of the supervised network
NAMES = ("07_01", "02_01", "02_02")


def simulations() -> list[tuple[Motion, np.ndarray]]:
    """In place of simulations: the tube skinned to the body."""
    motions = [make_motion(name).cut(0, FRAMES) for name in NAMES]
    return [(motion, np.asarray(tube_dress().skin(motion), dtype=float)) for motion in motions]


@pytest.fixture(scope="module")
def built(tmp_path_factory) -> Path:
    path, dressed = tmp_path_factory.mktemp("data") / "three.h5", tube_dress()
    write_data_set(path, dressed.body, dressed.garment, simulations())
    return path


def read(path: Path) -> tuple[list[Motion], dict[str, np.ndarray]]:
    return read_data_set(path, tube_dress().body, tube_dress().garment)


def test_the_file_holds_motions_and_what_was_simulated(built):
    """From the pelvis, where networks learn, the vertices are those in memory to the bits of a float32."""
    motions, trajectories = read(built)
    for motion, (stored_motion, positions) in zip(motions, simulations(), strict=True):
        assert motion.name == stored_motion.name and np.array_equal(motion.poses, stored_motion.poses)
        pelvis = tube_dress().pelvis(stored_motion)[:, None]
        moved, stored = ((x - pelvis).astype(np.float32) for x in (positions, trajectories[motion.name]))
        assert np.array_equal(moved, stored)


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda file: file.attrs.update(format=9), "format 9; this version reads 2"),
        (lambda file: file.attrs.update(settings="[]"), "another garment: None there"),
    ],
)
def test_a_file_that_is_not_as_it_was_written_is_named(built, tmp_path, damage, message):
    path = Path(shutil.copy(built, tmp_path / "mine.h5"))
    with h5py.File(path, "a") as file:
        damage(file)
    with pytest.raises(ValueError, match=message) as caught:
        read(path)
    assert "\n" not in str(caught.value)


def test_the_command_learns_from_the_file(built, tmp_path, capsys, refused, monkeypatch):
    out = tmp_path / "m.safetensors"
    words = ["--dataset", str(built), "--steps", "2", "-o", str(out), "--model", "supervised"]
    refused("garment: tube there, tshirt here", train.main, [*words, "--vertices", "300"])
    monkeypatch.setattr(train, "choose_garment", lambda options, body: tube_dress().garment)
    assert train.main(words) == 0
    output = capsys.readouterr().out
    assert out.is_file() and "3 motions" in output and "recipe supervised, 54 frames" in output
    text = tmp_path / "text.h5"
    text.write_text("no HDF5")
    for options, message in (
        (["--model", "supervised"], "learns from simulations; add --dataset FILE"),
        (["--dataset", "x", "--motions", "y"], "leave out --motions"),
        (["--dataset", str(text)], "no file of simulated motions"),
    ):
        refused(message, train.main, options)
