"""python -m benchmarks.dataset: simulated motions in many files with an index, for training to read from."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING

from benchmarks.process.timing import one_thread
from reference_sim.command_line import Parser, command
from snug.garments.options import add_garment_options
from snug.motion.options import add_motion_options

if TYPE_CHECKING:
    from snug.training.simulated_data import DataSet

PROGRAM = "benchmarks.dataset"
EXAMPLES = """examples:
  python -m benchmarks.dataset build -o data/walks                     the library's training motions
  python -m benchmarks.dataset build --sequences 1000 --vertices 4400 -o data/thousand
  python -m benchmarks.dataset build --motions clips/ --garment shirt.obj --body mine.npz -o data/mine
  python -m snug.train --dataset data/thousand --model supervised      training reads windows from the files

sequences: the motions as given, in order, and then mixed clips of 60 frames made from them, always the same
  ones, until there are as many as asked for. Test and validation motions of the library are never among
  them. A folder that holds a data set of the same garment is gone on with: what is there for the same inputs
  and code is kept, the rest is simulated; so is what was killed, or is damaged.

exit status: 0 all is there; 1 a sequence failed, is damaged or not there yet: a line says which, and the
  rest went on; 2 the request cannot be met: one line says why and nothing is written; 130 interrupted: what
  had ended is kept, and the same command goes on from there."""


def make_parser() -> argparse.ArgumentParser:
    """Return the parser of the command."""
    parser = Parser(
        prog=f"python -m {PROGRAM}",
        description="Data sets of simulated motions: many files, an index, checksums.",
        epilog=EXAMPLES,
    )
    actions = parser.add_subparsers(dest="action", required=True, metavar="build")
    add_build_options(actions.add_parser("build", help="simulate what is not there yet", epilog=EXAMPLES))
    return parser


def add_build_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of what is simulated, and where."""
    add = parser.add_argument
    add(
        "--motions",
        action="append",
        default=[],
        metavar="PATH",
        help="motion file (.npz, .bvh, .amc with .asf), folder, or library (default); repeatable",
    )
    add_motion_options(add)
    add("--sequences", type=int, metavar="N", help="how many: the first motions, or all and mixed clips "
        "beside them (default: the motions)")  # fmt: skip
    add("--from", type=int, default=0, metavar="N", dest="first",
        help="leave out the first N of them (default 0)")  # fmt: skip
    add("--frames", type=int, metavar="N", help="of a sequence at most (default: all)")
    add("--garment", default="tshirt", metavar="NAME|FILE", help="what is worn (default tshirt)")
    add("--vertices", type=int, default=1000, metavar="N", help="of a tailored garment (default 1000)")
    add("--body", metavar="FILE", help="an own body of SMPL's family (default: the package's)")
    add("--settle", type=int, default=30, metavar="N",
        help="frames in which the body goes from the T-pose into the first pose (default 30)")  # fmt: skip
    add("--method", default="simulation", metavar="NAME",
        help="what simulates: a solver of benchmarks.run --list (default simulation, converged)")  # fmt: skip
    add("-o", "--out", metavar="DIR", required=True, help="a new folder, or one to go on with")
    add("--only", action="append", default=[], metavar="STATE,...",
        help="do again what is failed, stale or missing (default stale,missing)")  # fmt: skip
    add("--workers", type=int, metavar="N", help="processes side by side (default 2, or the cores there are)")
    add("--scheduler", metavar="ADDRESS", help="a cluster that simulates instead, see docs/scale.md")
    add_garment_options(parser)


@command(PROGRAM, goes_on="the same command goes on from there")
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; returns its exit status."""
    command_line = list(sys.argv[1:] if arguments is None else arguments)
    one_thread()
    options = make_parser().parse_args(command_line)
    from benchmarks.datasets.build import build_data_set  # loads the simulator
    from benchmarks.tasks.task import RunStopped

    try:
        return _report(build_data_set(options, command_line))
    except RunStopped as error:  # as of a full disk
        print(f"{PROGRAM}: {error}; the same command goes on from there", file=sys.stderr)
        return 1


def _report(data: DataSet) -> int:
    """Print the contents in a line, and on standard error what is left out; return the exit status."""
    for line in data.sequences:
        if not line.usable:
            why = ": ".join(filter(None, (line.status, line.reason)))
            print(f"{line.name}: left out: {why}", file=sys.stderr)
    frames = sum(line.frames for line in data.usable)
    files = [data.folder / name for line in data.sequences for name in line.digests]
    size = sum(path.stat().st_size for path in files if path.is_file())
    seconds = sum(line.seconds for line in data.sequences)
    print(f"{len(data.usable)} of {len(data.sequences)} sequences to learn from, {frames} frames, "
          f"{size / 1e6:.1f} MB, {seconds:.0f} s of simulation in {data.folder}")  # fmt: skip
    return 0 if len(data.usable) == len(data.sequences) else 1


if __name__ == "__main__":
    sys.exit(main())
