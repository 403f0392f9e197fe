"""The package's networks give the numbers that are published of them."""

from __future__ import annotations

import json

import numpy as np
import pandas as pd
import pytest

from benchmarks.assets import make_motions, open_assets
from benchmarks.methods.networks import Network
from benchmarks.metrics.energy import energy_series
from benchmarks.presets import find_preset
from benchmarks.references import FOLDER, TRAINED
from benchmarks.scenes import GARMENT_SCENES
from reference_sim.files.array_file import read_arrays
from reports.statistics.outcomes import PUBLISHED

MOTIONS = ("07_02", "01_01_a", "02_07_a")


@pytest.fixture(scope="module")
def rows():
    published = pd.read_csv(PUBLISHED / "quick" / "results.csv.gz", low_memory=False)
    return published.query("seed == 0").set_index(["scene", "method", "metric"])["value"]


@pytest.mark.parametrize("motion", MOTIONS)
def test_a_network_of_the_package_has_the_published_and_the_shipped_energies(motion, rows):
    shipped = json.loads(str(read_arrays(FOLDER / f"tshirt-{motion}.npz")["facts"]))["metrics"]
    preset = find_preset("quick")
    assets = open_assets(preset, make_motions([motion]), ["tshirt"])
    scene = GARMENT_SCENES[0].scene(motion).at(preset).build(assets)
    for name in (*TRAINED, "supervised"):
        network = Network(f"{name}-tshirt")
        network.prepare(scene)
        (series,) = energy_series(scene, [network.run().positions])
        for term, values in series.items():
            energy, mean = f"energy/{term}", values[scene.warm_up :].mean()
            printed = [rows[f"tshirt/{motion}", name, energy]]
            printed += [shipped[name][energy]] if name in TRAINED else []
            np.testing.assert_allclose(printed, mean, rtol=2e-5, err_msg=name + term)
