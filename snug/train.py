"""The command `python -m snug.train`: train a garment network and write it to a file."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from reference_sim.command_line import Parser, command
from reference_sim.files.atomic_files import demand_writable_folder
from snug.file_options import (
    GARMENT_WORDS,
    MOTION_WORDS,
    is_garment_file,
    parse_garment_file,
    parse_motion_files,
)
from snug.garments.templates import GARMENT_TEMPLATES, TSHIRT, find_template
from snug.kinds import KINDS
from snug.named_recipes import RECIPES

if TYPE_CHECKING:
    from snug.body.parametric_body import Body
    from snug.garments.garment import Garment
    from snug.motion.motion import Motion
    from snug.networks.trained_model import TrainedModel

CHECKPOINT_MINUTES = 1.0  # between two checkpoints: what a kill loses at most
SIMULATED = [name for name in KINDS if not KINDS[name].physics]
EXAMPLES = f"""examples:
  python -m snug.train                                   SNUG on the embedded motions, 1000 vertices
  python -m snug.train --garment shirt.obj,units=cm --body mine.npz    your own garment (see snug.check)
  python -m snug.train --model pbns --steps 8000         the static baseline
  python -m snug.train --motions clips/ -o clips.safetensors
  python -m snug.train --recipe paper --vertices 4400    the paper's text (see snug.named_recipes on contact)
  python -m snug.train --dataset motions.h5 --model supervised    learn from simulated motions
  python -m snug.train --resume                          go on where a killed run wrote its last checkpoint

{", ".join(SIMULATED)} learn from simulated motions, which python -m benchmarks.export
GARMENT/training-motions writes; python -m benchmarks.run makes its own. With --dataset, name the --garment,
--vertices and --body that it was written with."""


def parse_options(arguments: Sequence[str] | None = None) -> argparse.Namespace:
    """Parse the command line; fill in the output file."""
    parser = Parser(
        prog="python -m snug.train",
        description="Train a garment network on a dressed body and write it to one file.",
        epilog="\n\n".join((EXAMPLES, GARMENT_WORDS, MOTION_WORDS)),
    )
    add, garments = parser.add_argument, ", ".join(template.name for template in GARMENT_TEMPLATES)
    add("--model", choices=tuple(KINDS), default="snug", help="network and loss (default: %(default)s)")
    add("--recipe", choices=tuple(RECIPES), help="named options (default: the model's own)")
    add("--steps", type=int, default=4000, help="updates (default: %(default)s)")
    add("--garment", metavar="NAME|FILE", default=TSHIRT,
        help=f"{garments}, or a mesh made for the body (default: %(default)s)")  # fmt: skip
    add("--vertices", type=int, help="of a garment that is tailored (default: 1000)")
    add("--body", metavar="FILE", help="your own body of SMPL's family, .npz or .pkl")
    add("--motions", metavar="PATH",
        help="a motion file or a folder of them (default: the embedded library)")  # fmt: skip
    add("--dataset", metavar="FILE", help="a file of simulated motions")
    add("--seed", type=int, default=0, help="of everything random (default: %(default)s)")
    add("--device", default="cpu", metavar="cpu|cuda", help="where the whole step runs (default: cpu)")
    add("--resume", action="store_true", help="go on from the last checkpoint, if there is one")
    add("-o", "--out", metavar="FILE", help="file to write (default: by --model)")
    options = parser.parse_args(arguments)
    options.out = Path(options.out or f"{options.model}.safetensors")
    return options


def check_options(options: argparse.Namespace) -> None:
    """Raise ValueError for an option that needs another, or a file that cannot be written."""
    if options.dataset and options.motions:
        raise ValueError(f"--dataset {options.dataset}: has motions of its own; leave out --motions")
    simulated = not KINDS[options.model].physics
    if simulated and not options.dataset:
        raise ValueError(f"--model {options.model}: learns from simulations; add --dataset FILE")
    if options.recipe and simulated:
        raise ValueError(f"--recipe {options.recipe}: {options.model} has its own; leave out --recipe")
    if options.out.is_dir():
        raise ValueError(f"--out {options.out}: is a folder; name a file")
    try:
        demand_writable_folder(options.out.parent)
    except ValueError as error:
        raise ValueError(f"--out {options.out}: {error}") from None


def choose_garment(options: argparse.Namespace, body: Body) -> Garment:
    """Return the garment to train for, tailored or read. Raises ValueError."""
    if not is_garment_file(options.garment):
        return find_template(options.garment).tailor(
            body, vertices=1000 if options.vertices is None else options.vertices
        )
    if options.vertices is not None:
        raise ValueError(f"--vertices {options.vertices}: a mesh file has its own; leave it out")
    from snug.garments.reading import read_garment  # a tailored garment needs no reader of meshes

    return read_garment(parse_garment_file(options.garment), body)


def choose_motions(options: argparse.Namespace, simulated: Sequence[Motion] = ()) -> list[Motion]:
    """Return the motions to train on.

    The simulated motions of a data set take the place of the library's. Test clips of a published split
    are left out.
    """
    from snug.motion.files import load_motions
    from snug.motion.library import TRAIN, make_motion

    motions = list(simulated) or [make_motion(name) for name in TRAIN]
    if options.motions:
        path, reading = parse_motion_files(options.motions)
        file_motions = load_motions(path, options=reading)
        motions = [motion for motion in file_motions if motion.name not in reading.clips("test")]
        if absent := reading.absent([motion.name for motion in file_motions]):
            print(absent, file=sys.stderr)
    return motions


@command("snug.train", goes_on="--resume goes on from there")
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; return its exit status."""
    options = parse_options(arguments)
    # Not before: --help does without torch.
    import torch

    from snug.body.smpl_files import read_body
    from snug.networks.dressed_body import DressedBody
    from snug.networks.trained_model import TrainedModel
    from snug.training.checkpoint import Checkpoint
    from snug.training.simulated_data import read_data_set
    from snug.training.train_network import train_network

    check_options(options)
    torch.set_num_threads(1)
    body = read_body(options.body)
    dressed = DressedBody(body, choose_garment(options, body))
    simulated: list[Motion] = []
    trajectories = None
    if options.dataset:
        simulated, trajectories = read_data_set(Path(options.dataset), body, dressed.garment)
    motions = choose_motions(options, simulated)
    for motion in motions if options.motions else ():
        print(f"motion {motion.name}: {motion.source}", file=sys.stderr)
    out = options.out
    checkpoint = Checkpoint(
        path=out.with_name(f"{out.name.removesuffix('.safetensors')}.checkpoint.safetensors"),
        minutes=CHECKPOINT_MINUTES, resume=options.resume,
    )  # fmt: skip
    if options.resume and out.is_file() and not checkpoint.path.is_file():
        model = TrainedModel.load(out)
        if (model.kind, model.seed, model.steps) != (options.model, options.seed, options.steps):
            raise ValueError(f"{out}: is of another training; delete it, or leave out --resume")
        print(f"{out}: is there, and no checkpoint beside it; nothing to resume")
        return 0
    model = train_network(
        options.model, dressed, motions, steps=options.steps, seed=options.seed,
        recipe=RECIPES.get(options.recipe), trajectories=trajectories, device=options.device,
        checkpoint=checkpoint,
    )  # fmt: skip
    print(f"{dressed.garment.name}: {dressed.vertices} vertices, {len(motions)} motions")
    print_summary(model)
    print(model.save(out))
    checkpoint.delete()
    return 0


def print_summary(model: TrainedModel) -> None:
    """Print the last losses, high windows and the size of a model."""
    terms = [f"{name} {value:.4g}" for name, value in model.history[-1].items()
             if name not in ("step", "seconds")]  # fmt: skip
    print(f"recipe {model.recipe.name}, {model.summary['training_frames']} frames")
    print(f"last steps, {model.unit} (energies J), mean over frames: " + "  ".join(terms))
    windows = [w for w in model.summary["named_windows"] if w["action"] != "gradient clipped"]
    for window in windows[:5]:  # to clip is part of the recipe
        print("step {step}: {window} at {joules} {unit}, {action}".format(**window, unit=model.unit))
    print(f"{model.steps} steps in {model.seconds:.0f} s after {model.setup_seconds:.0f} s of preparation, "
          f"{model.network.megabytes:.1f} MB")  # fmt: skip


if __name__ == "__main__":
    sys.exit(main())
