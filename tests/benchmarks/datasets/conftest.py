"""The tube as a file, a data set of it, and a command that neither simulates nor begins a process."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from benchmarks import dataset
from benchmarks.datasets import build as build_dataset
from benchmarks.tasks import ground_truth
from tests.benchmarks.datasets.data_by_hand import Here, draped, make_once, words
from tests.snug.training.dressing import tube_dress


@pytest.fixture(scope="session")
def tube(tmp_path_factory) -> Path:
    """The tube of the other tests as a garment of one's own."""
    path = tmp_path_factory.mktemp("garment") / "tube.obj"
    garment = tube_dress().garment
    lines = ["v {!r} {!r} {!r}".format(*map(float, point)) for point in garment.rest_positions]
    lines += ["f {} {} {}".format(*face) for face in garment.faces + 1]
    path.write_text("\n".join(lines))
    np.savez(path.with_name("tube.weights.npz"), weights=garment.skinning_weights)
    return path


@pytest.fixture
def here(monkeypatch):
    """No processes and no simulation."""
    monkeypatch.setattr(build_dataset, "executor_of", Here)
    monkeypatch.setattr(ground_truth, "simulated", draped)
    monkeypatch.setattr(build_dataset, "embedded_motions", lambda names: [*map(make_once, names)])
    monkeypatch.setattr(Here, "done", 0)
    return Here


@pytest.fixture(scope="session")
def built(tube, tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("data") / "three"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(build_dataset, "executor_of", Here)
        patch.setattr(ground_truth, "simulated", draped)
        assert dataset.main(words(tube, out)) == 0
    return out


@pytest.fixture
def mine(built, tmp_path) -> Path:
    """A copy to damage."""
    return Path(shutil.copytree(built, tmp_path / "mine"))
