"""The package's networks give the numbers that are published of them."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from benchmarks.assets import embedded_motions, open_assets
from benchmarks.methods.networks import Network
from benchmarks.metrics.energy import energy_series
from benchmarks.presets import find_preset
from benchmarks.scenes import GARMENT_SCENES
from reports.statistics.outcomes import PUBLISHED

MOTIONS = ("07_02", "01_01_a", "02_07_a")
SEED_0 = pd.read_csv(PUBLISHED / "quick" / "results.csv.gz", low_memory=False).query("seed == 0")


@pytest.mark.parametrize("motion", MOTIONS)
def test_a_network_of_the_package_has_the_published_energies(motion):
    preset = find_preset("quick")
    assets = open_assets(preset, embedded_motions([motion]), ["tshirt"])
    scene = GARMENT_SCENES[0].scene(motion).at(preset).build(assets)
    published = SEED_0[SEED_0["scene"] == f"tshirt/{motion}"].set_index(["method", "metric"])["value"]
    for name in ("snug", "pbns", "supervised"):
        network = Network(f"{name}-tshirt")
        network.prepare(scene)
        (series,) = energy_series(scene, [network.run().positions])
        for term, values in series.items():
            printed = published[name, f"energy/{term}"]
            np.testing.assert_allclose(
                values[scene.warm_up :].mean(), printed, rtol=2e-5, err_msg=name + term
            )
