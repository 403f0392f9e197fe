"""Trained networks of the package: found by name, whole, small, and honest about their training."""

from __future__ import annotations

from pathlib import Path

import pytest

from snug import trained
from snug.networks.trained_model import TrainedModel

PACKAGE = Path(trained.FOLDER).parents[1]
LARGEST = 60e6  # bytes of the whole package
NETWORKS = sorted(trained.list_networks())


def test_the_package_has_the_networks_of_the_default_run_and_stays_small():
    assert {"snug-tshirt", "pbns-tshirt"} <= set(NETWORKS)
    layers = ("reference_sim", "snug", "benchmarks", "reports")
    files = [path for layer in layers for path in (PACKAGE / layer).rglob("*") if path.is_file()]
    paths = [path for path in files if "published" not in path.parts and "runs" not in path.parts]
    assert sum(path.stat().st_size for path in paths if "__pycache__" not in path.parts) < LARGEST


@pytest.mark.parametrize("name", NETWORKS)
def test_the_file_of_a_network_is_whole_and_names_its_training(name):
    model = TrainedModel.load(name)
    origin = model.origin
    assert trained.network_name(origin["network"], origin["garment"], model.seed) == name
    assert model.vertices == 1002 and len(origin["motions"]) == 34 and origin["left_out"] == []
    assert (
        bool(origin["simulated_by"])
        == origin["network"].startswith("supervised")
        == bool(origin["data_seconds"])
    )
    assert "+changes" not in origin["commit"] and origin["hardware"]["processor"]
    assert {"machine", "training", "seed", "steps", "motions"} <= set(origin["inputs"])
    assert origin["versions"]["torch"]
