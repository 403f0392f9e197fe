"""The package's networks give the numbers that are shipped of them."""

from __future__ import annotations

import json

import numpy as np
import pytest

from benchmarks.assets import embedded_motions, open_assets
from benchmarks.methods.networks import Network
from benchmarks.metrics.energy import energy_series
from benchmarks.presets import find_preset
from benchmarks.references import FOLDER, TRAINED
from benchmarks.scenes import GARMENT_SCENES
from reference_sim.files.array_file import read_arrays

MOTIONS = ("07_02", "01_01_a", "02_07_a")


@pytest.mark.parametrize("motion", MOTIONS)
def test_a_network_of_the_package_has_the_shipped_energies(motion):
    facts = json.loads(str(read_arrays(FOLDER / f"tshirt-{motion}.npz")["facts"]))
    preset = find_preset("quick")
    assets = open_assets(preset, embedded_motions([motion]), ["tshirt"])
    scene = GARMENT_SCENES[0].scene(motion).at(preset).build(assets)
    for name in TRAINED:
        network = Network(f"{name}-tshirt")
        network.prepare(scene)
        (series,) = energy_series(scene, [network.run().positions])
        for term, values in series.items():
            printed = facts["metrics"][name][f"energy/{term}"]
            np.testing.assert_allclose(
                values[scene.warm_up :].mean(), printed, rtol=2e-5, err_msg=name + term
            )
