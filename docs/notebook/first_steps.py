"""Loss of the recipe `paper` in its first steps, from random weights by the rules of Keras and of torch.

    python docs/notebook/first_steps.py --vertices 4400 --steps 2000 --rules keras torch

prints one line for each step of the table in training.md#the-start-of-the-papers-recipe: rules, step,
loss and its terms [J a frame]; then the largest loss after step 200, and the largest rise: a loss over
the smallest mean of 20 steps before it. One seed a process, as trainings leave memory behind.
"""

from __future__ import annotations

import argparse
from dataclasses import replace

import numpy as np

from snug.body.parametric_body import Body
from snug.garments.templates import find_template
from snug.motion.library import TRAIN, make_motion
from snug.named_recipes import PAPER
from snug.networks.dressed_body import DressedBody
from snug.training.optimisation_step import Trainer

SHOWN = (1, 20, 100, 280, 300, 1000, 2000, 3000, 4000, 5000, 5300)
SETTLED = 200  # steps after which a jump of the loss is counted
MEAN_OF = 20  # steps whose mean loss a rise is measured from


def main() -> None:
    """Train by each of the rules named and print as it goes."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--vertices", type=int, default=4400)
    parser.add_argument("--steps", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--rate", type=float, default=PAPER.learning_rate, help="of the first ten epochs")
    parser.add_argument("--rules", nargs="+", default=["keras", "torch"])
    options = parser.parse_args()
    body = Body.load()
    dressed = DressedBody(body, find_template("tshirt").tailor(body, vertices=options.vertices))
    motions = [make_motion(name) for name in TRAIN]
    frames = sum(motion.frames for motion in motions)
    print(f"{dressed.vertices} vertices, {len(motions)} motions, {frames} frames")
    print(f"seed {options.seed}, rate {options.rate:g}")
    for rules in options.rules:
        recipe = replace(PAPER, initialisation=rules, learning_rate=options.rate)
        trainer = Trainer("snug", dressed, motions, steps=options.steps, seed=options.seed, recipe=recipe)
        losses = []
        for step in range(1, options.steps + 1):
            terms = trainer.step(step - 1)
            losses.append(terms["loss"])
            if step in SHOWN:
                print(rules, step, *(f"{name} {value:.4g}" for name, value in terms.items()), flush=True)
        largest, rise = max(losses[SETTLED:]), largest_rise(losses)
        print(f"{rules}: largest loss after step {SETTLED}: {largest:.4g} J, largest rise: {rise:.3g}")


def largest_rise(losses: list[float]) -> float:
    """Return the largest loss after step SETTLED over the smallest mean of MEAN_OF steps before it."""
    means = np.convolve(losses, np.full(MEAN_OF, 1 / MEAN_OF), mode="valid")
    lowest = np.minimum.accumulate(means)  # the first is of the steps before step MEAN_OF
    return float(np.max(losses[SETTLED:] / lowest[SETTLED - MEAN_OF : -1]))


if __name__ == "__main__":
    main()
