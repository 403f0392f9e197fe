"""Training of SNUG and of the networks beside it: `train`, and the command `python -m snug.train`."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from snug.recipe import DEFAULT, RECIPES, TRAININGS, Recipe, find_recipe

if TYPE_CHECKING:
    from snug.dresser import DressedBody
    from snug.trained_model import TrainedModel


def train(
    model_kind: str,
    dressed: DressedBody,
    motions: Sequence[Any],
    *,
    steps: int,
    seed: int,
    trajectories: Mapping[str, np.ndarray] | None = None,
    recipe: Recipe | None = None,
    log: Callable[[dict[str, float]], None] | None = None,
    progress: bool = True,
    every: int = 50,
) -> TrainedModel:
    """Train one network for a number of steps; on a CPU equal arguments give equal weights, bit for bit.

    model_kind: one of snug.trained_model.KINDS; `snug` and `pbns` learn from the energies, the others from a
    simulation. trajectories: for those, motion name -> simulated world vertices (T, V, 3) [m].
    recipe: None takes the one of that name in TRAININGS.
    log: called with each row of the history, every `every` steps. progress: a bar on standard error.
    Raises ValueError (TrainingError, TargetError, RecipeError) naming what is missing or diverged.
    """
    from snug.trainer import Trainer

    if recipe is None:
        recipe = TRAININGS[model_kind].recipe if model_kind in TRAININGS else DEFAULT
    trainer = Trainer(
        model_kind, dressed, motions, steps=steps, seed=seed, recipe=recipe, trajectories=trajectories
    )
    return trainer.run(log=log, progress=progress, every=every)


def untrained_model(
    model_kind: str, dressed: DressedBody, motions: Sequence[Any], *, seed: int, recipe: Recipe = DEFAULT
) -> TrainedModel:
    """The network before any step, as a row of a table.

    The default recipe starts at a zero last layer, where the untrained network is skinning alone. So this one
    keeps PyTorch's own random last layer: it is what a network that has learned nothing really gives. Input
    statistics are those of the training motions.
    """
    from dataclasses import replace

    from snug.trained_model import TrainedModel, find_kind, make_network
    from snug.training_set import TrainingSet

    how = find_kind(model_kind)
    recipe = replace(recipe, zero_last_layer=False)
    data = TrainingSet(dressed, motions, recipe, features=how.features, sequences=how.sequences)
    network = make_network(model_kind, data.features.shape[1], dressed.vertices, recipe, seed=seed)
    network.normalise_by(*data.input_statistics())
    return TrainedModel(model_kind, network.eval(), recipe, seed=seed)


def parse(arguments: Sequence[str] | None = None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m snug.train",
        description="Train a garment network on a dressed body and write it to one file.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog="""examples:
  python -m snug.train                                   SNUG on the embedded motions, 1000 vertices
  python -m snug.train --model pbns --steps 8000         the static baseline
  python -m snug.train --motions clips/ --hold-out 01_01 -o clips.safetensors
  python -m snug.train --recipe paper --vertices 4400    the paper's text to the letter

The supervised model needs simulated motions: python -m benchmarks.run makes them and trains it.""",
    )
    add = parser.add_argument
    add("--model", choices=("snug", "pbns"), default="snug", help="network and loss (default: %(default)s)")
    add("--recipe", choices=tuple(RECIPES), default="default", help="named options (default: %(default)s)")
    add("--steps", type=int, default=4000, help="updates (default: %(default)s)")
    add("--vertices", type=int, default=1000, help="of the T-shirt (default: %(default)s)")
    add("--motions", metavar="PATH", help="a motion file or a folder of them (default: the embedded library)")
    add("--hold-out", metavar="NAME", action="append", default=[], help="leave a motion out; may be repeated")
    add("--seed", type=int, default=0, help="of everything random (default: %(default)s)")
    add("--threads", type=int, default=1, help="of torch on the CPU (default: %(default)s)")
    add("-o", "--out", default="snug.safetensors", help="file to write (default: %(default)s)")
    return parser.parse_args(arguments)


def main(arguments: Sequence[str] | None = None) -> int:
    options = parse(arguments)
    try:
        return _run(options)
    except ValueError as error:
        print(f"snug.train: {error}", file=sys.stderr)
        return 2


def _run(options: argparse.Namespace) -> int:
    import torch

    from snug.body import Body
    from snug.dresser import DressedBody
    from snug.garments import tailor_tshirt
    from snug.motion import TRAIN, load_motions, make_motion

    torch.set_num_threads(options.threads)
    motions = load_motions(options.motions) if options.motions else [make_motion(name) for name in TRAIN]
    unknown = set(options.hold_out) - {motion.name for motion in motions}
    if unknown:
        raise ValueError(f"--hold-out {sorted(unknown)[0]}: no such motion among {[m.name for m in motions]}")
    motions = [motion for motion in motions if motion.name not in options.hold_out]
    body = Body.load()
    dressed = DressedBody(body, tailor_tshirt(body, vertices=options.vertices))
    frames = sum(motion.frames for motion in motions)
    print(f"{len(motions)} motions, {frames} frames, {dressed.vertices} vertices, recipe {options.recipe}")
    model = train(
        options.model,
        dressed,
        motions,
        steps=options.steps,
        seed=options.seed,
        recipe=find_recipe(options.recipe),
    )
    last = {name: value for name, value in model.history[-1].items() if name not in ("step", "seconds")}
    print("last steps, J per frame: " + "  ".join(f"{name} {value:.4g}" for name, value in last.items()))
    for window in model.summary["named_windows"][:5]:
        print("step {step}: {window} at {joules} J, {action}".format(**window))
    print(f"{model.steps} steps in {model.seconds:.0f} s, {model.megabytes:.1f} MB")
    print(model.save(options.out))
    return 0


if __name__ == "__main__":
    sys.exit(main())
