"""Loss of networks before their first step, and on held-out motions during training.

    python docs/notebook/held_out.py --first
    python docs/notebook/held_out.py --networks snug pbns --steps 5300 --every 530

Without --first it prints, for each validation, the step, the mean loss of the last 50 steps on training
windows and the loss of whole roll-outs of the ten validation motions [J a frame]. T-shirt of 1002
vertices, seed 0.
"""

from __future__ import annotations

import argparse
import gc

from benchmarks.methods.declared_networks import TRAININGS
from snug.body.parametric_body import Body
from snug.garments.templates import find_template
from snug.motion.library import TRAIN, VALIDATION, make_motion
from snug.networks.dressed_body import DressedBody
from snug.training.optimisation_step import Trainer
from snug.training.train_network import train_network
from snug.training.validation import Validation


def main() -> None:
    """Print the table that is asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--first", action="store_true")
    parser.add_argument("--networks", nargs="+", default=["snug", "pbns"])
    parser.add_argument("--steps", type=int, default=5300)
    parser.add_argument("--every", type=int, default=530)
    options = parser.parse_args()
    body = Body.load()
    dressed = DressedBody(body, find_template("tshirt").tailor(body, vertices=1000))
    motions = [make_motion(name) for name in TRAIN]
    if options.first:
        print_first(dressed, motions)
        return
    held_out = Validation(
        motions=[make_motion(name) for name in VALIDATION], every=options.every, patience=0
    )
    for name in options.networks:
        training = TRAININGS[name]

        def log(row: dict[str, float], name: str = name) -> None:
            if row.get("validation", float("nan")) == row.get("validation"):
                print(name, int(row["step"]), f"{row['loss']:.4g} {row['validation']:.4g}", flush=True)

        train_network(
            training.kind, dressed, motions, steps=options.steps, seed=0, recipe=training.recipe, log=log,
            validation=held_out,
        )  # fmt: skip


def print_first(dressed: DressedBody, motions: list) -> None:
    """Print loss and strain of the first batch, before any update, of networks that learn by energies."""
    for name, training in TRAININGS.items():
        if training.simulated is not None:
            continue
        gc.collect()  # a trainer refers to itself, and holds a gigabyte
        trainer = Trainer(training.kind, dressed, motions, steps=2000, seed=0, recipe=training.recipe)
        terms = trainer.step(0)
        print(name, f"{terms['loss']:.4g} {terms.get('strain', float('nan')):.4g}", flush=True)


if __name__ == "__main__":
    main()
