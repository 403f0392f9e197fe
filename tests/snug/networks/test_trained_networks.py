"""Trained networks of the package: found by name, whole, small, and honest about their training."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from snug import trained
from snug.networks.garment_network import make_network
from snug.networks.tensor_file import read_header
from snug.networks.trained_model import TrainedModel
from snug.recipe import DEFAULT

PACKAGE = Path(trained.FOLDER).parents[1]
LARGEST = 60e6  # bytes of the whole package
NETWORKS = sorted(trained.trained_networks())


@pytest.fixture
def packaged(tmp_path, monkeypatch) -> TrainedModel:
    """A tiny network, as the one that the package has."""
    monkeypatch.setattr(trained, "FOLDER", tmp_path)
    model = TrainedModel("pbns", make_network("pbns", 141, 4, DEFAULT, seed=3), DEFAULT, seed=3)
    model = replace(model, origin={"commit": "0123456789"})
    model.save(tmp_path / "pbns-tube.safetensors")
    return model


def test_a_network_is_loaded_by_its_name_with_its_origin(packaged, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path.parent)
    loaded = TrainedModel.load("pbns-tube")
    assert (loaded.seed, loaded.origin) == (3, packaged.origin)
    assert read_header(tmp_path / "pbns-tube.safetensors")["origin"] == packaged.origin


def test_the_package_has_the_networks_of_the_default_run_and_stays_small():
    assert {"snug-tshirt", "pbns-tshirt", "supervised-tshirt"} <= set(NETWORKS)
    layers = ("reference_sim", "snug", "benchmarks", "reports")
    files = [path for layer in layers for path in (PACKAGE / layer).rglob("*") if path.is_file()]
    kept = [path for path in files if "published" not in path.parts and "runs" not in path.parts]
    assert sum(path.stat().st_size for path in kept if "__pycache__" not in path.parts) < LARGEST


@pytest.mark.parametrize("name", NETWORKS)
def test_the_file_of_a_network_is_whole_and_names_its_training(name):
    model = TrainedModel.load(name)
    origin = model.origin
    assert trained.network_name(origin["network"], origin["garment"], model.seed) == name
    assert model.vertices == 1002 and len(origin["motions"]) == 34 and origin["left_out"] == []
    assert bool(origin["simulated_by"]) == (origin["network"] == "supervised") == bool(origin["data_seconds"])
    assert "+changes" not in origin["commit"] and origin["hardware"]["processor"]
    assert {"machine", "training", "seed", "steps", "motions"} <= set(origin["inputs"])
    assert origin["versions"]["torch"]
