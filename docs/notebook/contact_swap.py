"""SNUG by the paper's text, trained with the contact of the recipe and of the simulator: excess in training.

    python docs/notebook/contact_swap.py DIR

trains both for 22,000 steps (T-shirt of 1002 vertices, the 34 recorded training clips, seed 0), keeps the
weights on the way, rolls them out and prints, for each motion and set of weights, the excess of the total
energy over the converged simulation as a share of skinning's [%]: by the energies with the simulator's
contact, each against the simulation with it, and by those with the recipe's contact, against the
simulation with that one. Both simulations have the same start. What lies in DIR already is not computed
again. The numbers are those of training.md#the-swap-of-contact.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import torch

from benchmarks.assets import embedded_motions, open_assets
from benchmarks.methods.networks import Network
from benchmarks.methods.reference_variants import of_own_energies
from benchmarks.methods.simulation import Simulation
from benchmarks.metrics.energy import energy_series
from benchmarks.presets import find_preset
from benchmarks.scene import BuiltScene
from benchmarks.scenes import GARMENT_SCENES
from snug.motion.library import TRAIN
from snug.named_recipes import PAPER, PAPER_CONTACT
from snug.networks.dressed_body import DressedBody
from snug.recipe import DEFAULT
from snug.training.optimisation_step import Trainer
from snug.training.train_network import TrainingLoop

KEPT = (1000, 2000, 3000, 4000, 6000, 8000, 10_000, 12_000, 17_000, 22_000)  # steps
RECIPES = {"recipe's contact": PAPER, "simulator's contact": PAPER_CONTACT}
TEST, TRAINING = ("07_02", "01_01_a", "02_07_a", "push_recovery"), ("07_01", "06_05")


def main() -> None:
    """Train, simulate, roll out and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("folder", type=Path)
    folder: Path = parser.parse_args().folder
    folder.mkdir(exist_ok=True)
    torch.set_num_threads(1)
    preset = find_preset("quick")
    assets = open_assets(preset, embedded_motions([*TEST, *TRAINING]), ["tshirt"])
    dressed = DressedBody(assets.body, assets.garments["tshirt"])
    for recipe in RECIPES.values():
        train(dressed, recipe, folder)
    for motion in (*TEST, *TRAINING):
        scene = GARMENT_SCENES[0].scene(motion).at(preset).build(assets)
        compare(scene, motion, folder)


def weights_file(folder: Path, recipe: str, steps: int) -> Path:
    """Return the file of a recipe's network after so many steps."""
    return folder / f"{recipe}-{steps}.safetensors"


def train(dressed: DressedBody, recipe, folder: Path) -> None:
    """Train by the recipe and keep the weights after each of KEPT, unless the last are there."""
    if weights_file(folder, recipe.name, KEPT[-1]).exists():
        return
    motions = embedded_motions(TRAIN)
    trainer = Trainer("snug", dressed, motions, steps=KEPT[-1], seed=0, recipe=recipe)

    def keep(row: dict[str, float]) -> None:
        if row["step"] in KEPT:
            loop.model().save(weights_file(folder, recipe.name, int(row["step"])))
            trainer.network.train()

    loop = TrainingLoop(trainer, every=1000, log=keep, progress=True)
    loop.run()


def compare(scene: BuiltScene, motion: str, folder: Path) -> None:
    """Print the excess of both simulations and of every set of weights, by both sets of energies."""
    scenes = dict(zip(RECIPES, (of_own_energies(scene, PAPER), scene)))
    path = folder / f"{motion}.npz"
    if not path.exists():
        found = [simulated(one) for one in scenes.values()]
        np.savez(path, **dict(zip(RECIPES, found)))
    dressed = DressedBody(scene.dressed.body, scene.dressed.garment)
    positions = {f"simulation, {name}": x for name, x in np.load(path).items()}
    positions["skinning"] = dressed.skinned(scene.dressed.motion, smoothing=DEFAULT.smoothing)
    for recipe in RECIPES.values():
        for steps in KEPT:
            network = Network(weights_file(folder, recipe.name, steps))
            network.prepare(scene)
            positions[f"{recipe.name}, {steps} steps"] = network.run().positions
    for name, one in scenes.items():
        series = energy_series(one, list(positions.values()))
        totals = {key: float(of["total"][one.warm_up :].mean()) for key, of in zip(positions, series)}
        zero, full = totals[f"simulation, {name}"], totals["skinning"]
        for key, total in totals.items():
            print(f"{motion}; by {name}; {key}; {100 * (total - zero) / (full - zero):.2f}", flush=True)


def simulated(scene: BuiltScene) -> np.ndarray:
    """Return positions (T, V, 3) [m] of the converged simulation."""
    simulation = Simulation()
    simulation.prepare(scene)
    return simulation.run().positions


if __name__ == "__main__":
    main()
