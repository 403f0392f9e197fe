"""The command `python -m snug.train`: train garment networks and write each to a file."""

from __future__ import annotations

import argparse
import os
import signal
import sys
from collections.abc import Sequence
from pathlib import Path
from types import FrameType

from reference_sim.command_line import Parser, command
from snug.file_options import add_garment_options, add_motion_options
from snug.named_recipes import RECIPES

MODELS = (
    "snug", "pbns", "supervised", "santesteban2019", "tailornet", "ncs", "ncs-static", "handles-20",
    "handles-40", "handles-80", "handles-80-dynamic",
)  # fmt: skip
EXAMPLES = """examples:
  python -m snug.train                                   SNUG on the embedded motions, 1000 vertices
  python -m snug.train --garment tshirt --garment tunic  one network for each garment
  python -m snug.train --garment shirt.obj --body mine.npz    your own garment (see snug.check)
  python -m snug.train --model pbns --steps 8000         the static baseline
  python -m snug.train --motions clips/ --hold-out 01_01 -o clips.safetensors
  python -m snug.train --validation kick --patience 10   stop when a validation motion gets no better
  python -m snug.train --recipe paper --vertices 4400    the paper's text (see snug.named_recipes on contact)
  python -m snug.train --dataset motions.h5 --model supervised    learn from simulated motions
  python -m snug.train --resume                          go on where a killed run wrote its last checkpoint
  torchrun --nproc-per-node 2 -m snug.train              two processes share every batch

supervised, santesteban2019 and tailornet learn from simulated motions, which python -m benchmarks.export
GARMENT/training-motions writes; python -m benchmarks.run makes its own. With --dataset, name the --garment,
--vertices and --body that it was written with."""


def parse_options(arguments: Sequence[str] | None = None) -> argparse.Namespace:
    """Parse the command line; fill in the output file."""
    parser = Parser(
        prog="python -m snug.train",
        description="Train a garment network on a dressed body and write it to one file.",
        epilog=EXAMPLES,
    )
    add = parser.add_argument_group("model").add_argument
    add("--model", choices=MODELS, default="snug", help="network and loss (default: %(default)s)")
    add("--recipe", choices=tuple(RECIPES), help="named options (default: the model's own)")
    add("--steps", type=int, default=4000, help="updates (default: %(default)s)")
    add("--garment", metavar="NAME|FILE", action="append", default=[],
        help="tshirt, tunic, skirt, tank_top, long_sleeves, trousers, shorts, dress, or a mesh made for the "
        "body; repeat for one model each (default: tshirt)")  # fmt: skip
    add("--vertices", type=int, default=1000, help="of a garment (default: %(default)s)")
    add(
        "--body", metavar="FILE", help="your own body of SMPL's family, .npz or .pkl (default: the package's)"
    )
    add("--motions", metavar="PATH", help="a motion file or a folder of them (default: the embedded library)")
    add("--dataset", metavar="FILE", help="simulated motions, read from the file a few frames at a time")
    add_motion_options(add)
    add("--hold-out", metavar="NAME", action="append", default=[], help="leave a motion out; may be repeated")
    add("--seed", type=int, default=0, help="of everything random (default: %(default)s)")
    add("-o", "--out", metavar="FILE",
        help="file to write; of several garments each adds its name (default: by --model)")  # fmt: skip
    add = parser.add_argument_group("early stop").add_argument
    add("--validation", metavar="NAME", action="append", default=[],
        help="roll this motion out now and then: one held out of training, or of the library a validation "
        "motion or one without a role; may be repeated. The weights that do best are kept")  # fmt: skip
    add("--validate-every", metavar="STEPS", type=int, default=200, help="(default: %(default)s)")
    add("--patience", metavar="N", type=int, default=0,
        help="validations without a better value, after which training stops (default: never)")  # fmt: skip
    add = parser.add_argument_group("where and how long").add_argument
    add("--device", default="cpu", metavar="cpu|cuda", help="where the whole step runs (default: cpu)")
    add("--threads", type=int, default=1, help="of torch on the CPU (default: %(default)s)")
    add(
        "--checkpoint-minutes", metavar="M", type=float, default=5.0, help="0 for none (default: %(default)s)"
    )
    add("--checkpoint-steps", metavar="N", type=int, default=0, help="a checkpoint every N steps as well")
    add("--resume", action="store_true", help="go on from the last checkpoint, if there is one")
    add_garment_options(parser)
    options = parser.parse_args(arguments)
    options.out = options.out or f"{options.model}.safetensors"
    return options


SMALLEST = {
    "seed": 0,
    "threads": 1,
    "validate_every": 1,
    "patience": 0,
    "checkpoint_minutes": 0,
    "checkpoint_steps": 0,
    "steps": 1,
    "vertices": 1,
}


def _largest(name: str) -> int:
    """Return the largest value: more threads than cores only wait for each other; a seed has 63 bits."""
    return {"seed": (1 << 63) - 1, "threads": os.cpu_count() or 1}.get(name, 10**9)


def check_options(options: argparse.Namespace) -> None:
    """Raise ValueError for an option that is out of range, or means nothing without another."""
    from snug.training.kinds import find_kind  # loads torch

    for name, smallest in SMALLEST.items():
        value, largest = getattr(options, name), _largest(name)
        if not smallest <= value <= largest:
            limit = f"at most {largest}" if value > largest else f"at least {smallest}"
            raise ValueError(f"--{name.replace('_', '-')} {str(value)[:40]}: {limit}")
    if options.dataset and options.motions:
        raise ValueError(f"--dataset {options.dataset}: has motions of its own; leave out --motions")
    simulated = not find_kind(options.model).physics
    if simulated and not options.dataset:
        raise ValueError(f"--model {options.model}: learns from simulations; add --dataset FILE")
    if options.recipe and simulated:
        raise ValueError(f"--recipe {options.recipe}: {options.model} has its own; leave out --recipe")
    if options.patience and not options.validation:
        raise ValueError(f"--patience {options.patience}: add --validation NAME, a motion to stop by")


@command("snug.train", goes_on="--resume goes on from there")
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; return its exit status."""
    options = parse_options(arguments)
    # Not before: --help does without torch.
    import torch

    from snug.body.smpl_files import read_body
    from snug.training.device import find_device
    from snug.training.process_group import join_group, leave_group
    from snug.training.simulated_data import DataSet
    from snug.training.train_to_file import choose_garments, choose_motions, output_files, train_to_file
    from snug.training.training_loop import Interrupted

    check_options(options)
    garments = choose_garments(options)
    outputs = output_files(Path(options.out), garments)
    device = find_device(options.device)
    torch.set_num_threads(options.threads)
    data = DataSet.read(options.dataset) if options.dataset else None
    motions, held_out = choose_motions(options, data)
    stop = _StopRequest()
    group, device = join_group(device)
    if options.motions and group.writes:
        for motion in [*motions, *held_out]:
            print(f"motion {motion.name}: {motion.source}", file=sys.stderr)
    try:
        body = read_body(options.body)
        outputs[0].parent.mkdir(parents=True, exist_ok=True)
        for garment, output in zip(garments, outputs):
            train_to_file(
                options, body, garment, motions, held_out, data, output,
                device=str(device), group=group, stop=stop,
            )  # fmt: skip
    except Interrupted as interrupted:
        if group.writes:
            print(f"snug.train: {interrupted}; go on with --resume", file=sys.stderr)
        return 130
    finally:
        leave_group()
        stop.restore()
    return 0


class _StopRequest:
    """True once the process was asked to end; a second request ends it at once."""

    def __init__(self) -> None:
        self.received = False
        self._before = {n: signal.signal(n, self._receive) for n in (signal.SIGINT, signal.SIGTERM)}

    def _receive(self, number: int, frame: FrameType | None) -> None:
        self.received = True
        signal.signal(number, signal.SIG_DFL)

    def __call__(self) -> bool:
        return self.received

    def restore(self) -> None:
        """Put back the handlers that were there before: `main` may be called by a longer program."""
        for number, handler in self._before.items():
            signal.signal(number, handler)


if __name__ == "__main__":
    sys.exit(main())
