"""Each deviation of the default recipe from the paper's text, measured on the validation motions.

    python -m benchmarks.run --methods 'snug,snug-paper,snug-without-*,snug-paper-with-*' -o nets
    python docs/notebook/deviations.py nets

prints a line for each network in the folder: relative excess of its total energy [%], typical and on the
worst motion, strain and total [J a frame]. The table is training.md#what-each-deviation-does. 05_02_b is left
out, where the reference gives up.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from benchmarks.assets import embedded_motions, open_assets
from benchmarks.methods import find_method
from benchmarks.metrics.energy import energy_series
from benchmarks.presets import find_preset
from benchmarks.scenes import of_garment
from snug.motion.library import VALIDATION
from snug.networks.dressed_body import DressedBody
from snug.networks.roll_out import roll_out
from snug.networks.trained_model import TrainedModel


def main() -> None:
    """Roll all networks out on each motion, beside the simulation and skinning."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("networks", type=Path)
    parser.add_argument("--leave-out", action="append", default=["05_02_b"], help="a motion not to measure")
    options = parser.parse_args()
    preset = find_preset("quick")
    names = [name for name in VALIDATION if name not in options.leave_out]
    assets = open_assets(preset, embedded_motions(names), ["tshirt"])
    files = sorted(options.networks.rglob("snug*.safetensors"))
    models = {path.stem: TrainedModel.load(path) for path in files}
    found = {name: ([], [], []) for name in models}  # excess, strain, total of each motion
    for name in names:
        scene = of_garment("tshirt").scene(name).at(preset).build(assets)
        dressed = DressedBody(assets.body, assets.garments["tshirt"])
        references = []
        for method in ("simulation", "skinning"):
            reference = find_method(method).make(models=Path(), seed=0)
            reference.prepare(scene)
            references.append(reference.run())
            assert references[-1].status == "ok", f"{name}: {method} has status {references[-1].status}"
        rolled = [roll_out(model, dressed, assets.motions[name]) for model in models.values()]
        positions = [np.asarray(t.positions) for t in (*references, *rolled)]
        energies = energy_series(scene, positions)
        judged = slice(scene.warm_up, None)
        totals = [series["total"][judged].mean() for series in energies]
        print(f"{name}: simulation {totals[0]:.4g} J, skinning {totals[1]:.4g} J", flush=True)
        for model, series, total in zip(models, energies[2:], totals[2:]):
            excess, strain, whole = found[model]
            excess.append(100 * (total - totals[0]) / (totals[1] - totals[0]))
            strain.append(series["strain"][judged].mean())
            whole.append(total)
    for model, (excess, strain, whole) in found.items():
        typical = np.sinh(np.arcsinh(excess).mean())
        numbers = (typical, max(excess), np.mean(strain), np.mean(whole))
        print("|", model, "|", " | ".join(f"{number:.3g}" for number in numbers), "|")


if __name__ == "__main__":
    main()
