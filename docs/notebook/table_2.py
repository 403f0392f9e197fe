"""Table 2 of the paper on the paper's mesh: SNUG by its text, and with one term of the loss left out.

    python docs/notebook/table_2.py DIR

trains the recipe of the paper's text with all terms (seeds 0, 1, 2), without bending, strain, gravity and
inertia (seed 0; T-shirt of 4378 vertices, the 34 recorded training clips, 22,000 steps each), simulates the
motions of TEST (of FINER with four time steps a frame too), rolls the networks out and prints, for each
motion, the distance of the distributions of mean curvature from the simulation's, the error of the same
vertices, and the means [1/m]. What lies in DIR already is not computed again. The numbers are those of
training.md#table-2-on-the-papers-mesh.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch

from benchmarks.assets import make_motions, open_assets
from benchmarks.methods.networks import Network
from benchmarks.methods.simulation import Simulation
from benchmarks.metrics.curvature import curvature_error, curvature_series, histogram_distance
from benchmarks.metrics.energy import energy_series
from benchmarks.presets import find_preset
from benchmarks.scene import BuiltScene
from benchmarks.scenes import GARMENT_SCENES
from snug.motion.library import TRAIN
from snug.named_recipes import PAPER
from snug.networks.dressed_body import DressedBody
from snug.recipe import DEFAULT, TERMS
from snug.training.optimisation_step import Trainer
from snug.training.train_network import TrainingLoop

STEPS = 22_000
NETWORKS = {  # term left out, and seed
    "full": ("", 0), "full-1": ("", 1), "full-2": ("", 2), "no-bending": ("bending", 0),
    "no-strain": ("strain", 0), "no-gravity": ("gravity", 0), "no-inertia": ("inertia", 0),
}  # fmt: skip
TEST = ("07_02", *(f"01_01_{part}" for part in "abcdefg"))
FINER = ("07_02", "01_01_a")


def main() -> None:
    """Train, simulate, roll out and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("folder", type=Path)
    folder: Path = parser.parse_args().folder
    folder.mkdir(exist_ok=True)
    torch.set_num_threads(1)
    preset = find_preset("paper")
    assets = open_assets(preset, make_motions(TEST), ["tshirt"])
    dressed = DressedBody(assets.body, assets.garments["tshirt"])
    for name in NETWORKS:
        train(dressed, name, folder)
    for motion in TEST:
        compare(GARMENT_SCENES[0].scene(motion).at(preset).build(assets), motion, folder)


def train(dressed: DressedBody, name: str, folder: Path) -> None:
    """Train the network of that name, unless it is there."""
    path = folder / f"{name}.safetensors"
    if not path.exists():
        left_out, seed = NETWORKS[name]
        recipe = replace(PAPER, name=name, terms=tuple(term for term in TERMS if term != left_out))
        trainer = Trainer("snug", dressed, make_motions(TRAIN), steps=STEPS, seed=seed, recipe=recipe)
        TrainingLoop(trainer, every=1000, progress=True).run().save(path)


def compare(scene: BuiltScene, motion: str, folder: Path) -> None:
    """Print curvature and energies of each network and of the finer simulation beside the simulation's."""
    path = folder / f"{motion}.npz"
    if not path.exists():
        finer = {"finer": simulated(scene, 4)} if motion in FINER else {}
        np.savez(path, simulation=simulated(scene), **finer)
    positions = dict(np.load(path))
    dressed = DressedBody(scene.dressed.body, scene.dressed.garment)
    positions["skinning"] = dressed.skin(scene.dressed.motion, smoothing=DEFAULT.smoothing)
    for name in NETWORKS:
        network = Network(folder / f"{name}.safetensors")
        network.prepare(scene)
        positions[name] = network.run().positions
    frames = slice(scene.warm_up, None)
    curvature = {name: curvature_series(x[frames], scene.cloth.faces) for name, x in positions.items()}
    energies = energy_series(scene, list(positions.values()))
    for (name, series), terms in zip(curvature.items(), energies):
        of = (histogram_distance, curvature_error)
        distances = [float(one(series, curvature["simulation"]).mean()) for one in of]
        means = [float(terms[term][frames].mean()) for term in ("strain", "bending", "inertia", "total")]
        numbers = [*distances, float(series.means().mean()), *means]
        print(
            motion,
            len(series.curvature),
            name,
            *(f"{number:.4g}" for number in numbers),
            sep="; ",
            flush=True,
        )


def simulated(scene: BuiltScene, substeps: int = 1) -> np.ndarray:
    """Return positions (T, V, 3) [m] of the converged simulation with so many steps a frame."""
    simulation = Simulation({"substeps": substeps})
    simulation.prepare(scene)
    return simulation.run().positions


if __name__ == "__main__":
    main()
