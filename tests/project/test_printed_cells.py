"""The package's networks give the numbers that the published run has of them."""

from __future__ import annotations

import csv

import numpy as np
import pytest

from benchmarks.assets import embedded_motions, open_assets
from benchmarks.methods.networks import Network
from benchmarks.metrics.energy import energy_series
from benchmarks.presets import find_preset
from benchmarks.scenes import GARMENT_SCENES
from tests.project.test_layers import ROOT

PUBLISHED = ROOT / "reports" / "published" / "quick" / "results.csv"
MOTIONS = ("07_02", "01_01_a", "02_07_a")
# The run is of protocol 1.0, which calls the network of vertices alone supervised.
NETWORKS = {"snug": "snug", "pbns": "pbns", "supervised-vertices": "supervised"}


@pytest.fixture(scope="module")
def published() -> dict[tuple[str, str, str], float]:
    """Energies of seed 0, by scene, method and metric."""
    with PUBLISHED.open(encoding="utf-8", newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["metric"].startswith("energy/")]
    return {
        (row["scene"], row["method"], row["metric"]): float(row["value"])
        for row in rows
        if row["seed"] == "0" and row["part"] == "whole" and row["value"]
    }


@pytest.mark.parametrize("motion", MOTIONS)
def test_a_network_of_the_package_has_the_published_energies(motion, published):
    preset = find_preset("quick")
    assets = open_assets(preset, embedded_motions([motion]), ["tshirt"])
    scene = GARMENT_SCENES[0].scene(motion).at(preset).build(assets)
    for ours, theirs in NETWORKS.items():
        network = Network(f"{ours}-tshirt")
        network.prepare(scene)
        (series,) = energy_series(scene, [network.run().positions])
        for term, values in series.items():
            printed = published[f"tshirt/{motion}", theirs, f"energy/{term}"]
            np.testing.assert_allclose(
                values[scene.warm_up :].mean(), printed, rtol=2e-5, err_msg=ours + term
            )
