"""SNUG by the paper's text, trained with several contacts: excess in training, by each one's energies.

    python docs/notebook/contact_swap.py DIR
    python docs/notebook/contact_swap.py DIR --steps 5000 --recipes paper paper-nearest-vertex

trains each recipe (T-shirt of 1002 vertices, the 34 recorded training clips, seed 0; by default for 22,000
steps the recipe of the paper's text, and the same with the simulator's contact), keeps the weights on the
way, rolls them out and prints, for each motion and set of weights, the excess of the total energy over the
converged simulation as a share of skinning's [%], by the energies of each recipe against the simulation
that has them; and the network's terms [J a frame] by these energies. All simulations have the same start.
What lies in DIR already is not computed again. The numbers are those of training.md#the-swap-of-contact.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch

from benchmarks.assets import make_motions, open_assets
from benchmarks.methods.networks import Network
from benchmarks.methods.reference_variants import swap_energies
from benchmarks.methods.simulation import Simulation
from benchmarks.metrics.energy import energy_series
from benchmarks.presets import find_preset
from benchmarks.scene import BuiltScene
from benchmarks.scenes import GARMENT_SCENES
from snug.motion.library import TRAIN
from snug.named_recipes import PAPER, PAPER_NEAREST_VERTEX, PAPERS
from snug.networks.dressed_body import DressedBody
from snug.recipe import DEFAULT, Recipe
from snug.training.optimisation_step import Trainer
from snug.training.train_network import TrainingLoop

KEPT = (1000, 2000, 3000, 4000, 5000, 6000, 8000, 10_000, 12_000, 17_000, 22_000)  # steps
MARGIN_OF_TEXT = replace(
    PAPER_NEAREST_VERTEX, name="paper-nearest-vertex-2mm", contact_margin=PAPER.contact_margin
)
RECIPES = {recipe.name: recipe for recipe in (*PAPERS, MARGIN_OF_TEXT)}
MOTIONS = ("07_02", "01_01_a", "02_07_a", "push_recovery", "07_01", "06_05")  # the last two of training


def main() -> None:
    """Train, simulate, roll out and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--recipes", nargs="+", choices=RECIPES, default=["paper", "paper-contact"])
    parser.add_argument("--motions", nargs="+", default=MOTIONS)
    parser.add_argument("--steps", type=int, default=KEPT[-1])
    options = parser.parse_args()
    folder: Path = options.folder
    folder.mkdir(exist_ok=True)
    torch.set_num_threads(1)
    preset = find_preset("quick")
    assets = open_assets(preset, make_motions(options.motions), ["tshirt"])
    dressed = DressedBody(assets.body, assets.garments["tshirt"])
    recipes = [RECIPES[name] for name in options.recipes]
    lengths = [steps for steps in KEPT if steps <= options.steps]
    for recipe in recipes:
        train(dressed, recipe, lengths, folder)
    for motion in options.motions:
        scene = GARMENT_SCENES[0].scene(motion).at(preset).build(assets)
        compare(scene, motion, recipes, lengths, folder)


def weights_file(folder: Path, recipe: str, steps: int) -> Path:
    """Return the file of a recipe's network after so many steps."""
    return folder / f"{recipe}-{steps}.safetensors"


def train(dressed: DressedBody, recipe: Recipe, kept: list[int], folder: Path) -> None:
    """Train by the recipe and keep the weights after each of `kept` steps, unless the last are there."""
    if weights_file(folder, recipe.name, kept[-1]).exists():
        return
    motions = make_motions(TRAIN)
    trainer = Trainer("snug", dressed, motions, steps=kept[-1], seed=0, recipe=recipe)

    def keep(row: dict[str, float]) -> None:
        if row["step"] in kept:
            loop.model().save(weights_file(folder, recipe.name, int(row["step"])))
            trainer.network.train()

    loop = TrainingLoop(trainer, every=1000, log=keep, progress=True)
    loop.run()


def compare(scene: BuiltScene, motion: str, recipes: list[Recipe], kept: list[int], folder: Path) -> None:
    """Print excess and terms of all simulations and all sets of weights, by the energies of each recipe."""
    scenes = {recipe.name: swap_energies(scene, recipe) for recipe in recipes}
    dressed = DressedBody(scene.dressed.body, scene.dressed.garment)
    positions = {"skinning": dressed.skin(scene.dressed.motion, smoothing=DEFAULT.smoothing)}
    for name, variant in scenes.items():
        path = folder / f"{motion}-{name}.npy"
        if not path.exists():
            np.save(path, simulated(variant))
        positions[f"simulation, {name}"] = np.load(path)
        for steps in kept:
            network = Network(weights_file(folder, name, steps))
            network.prepare(scene)
            positions[f"{name}, {steps} steps"] = network.run().positions
    for name, variant in scenes.items():
        series = energy_series(variant, list(positions.values()))
        means = {
            key: {term: float(values[variant.warm_up :].mean()) for term, values in of.items()}
            for key, of in zip(positions, series)
        }
        zero, full = means[f"simulation, {name}"]["total"], means["skinning"]["total"]
        for key, terms in means.items():
            excess = 100 * (terms["total"] - zero) / (full - zero)
            joules = ", ".join(f"{term} {value:.4f}" for term, value in terms.items())
            print(f"{motion}; by {name}; {key}; {excess:.2f}; {joules}", flush=True)


def simulated(scene: BuiltScene) -> np.ndarray:
    """Return positions (T, V, 3) [m] of the converged simulation."""
    simulation = Simulation()
    simulation.prepare(scene)
    return simulation.run().positions


if __name__ == "__main__":
    main()
