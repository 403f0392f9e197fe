"""python -m benchmarks.check: does a file of your own keep the contract? What is wrong, and the remedy."""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from benchmarks.contract.check_files import SECONDS, check_files, read_files
from benchmarks.declarations import DeclarationError
from benchmarks.process.timing import one_thread
from reference_sim.command.command_line import Parser, command

PROGRAM = "benchmarks.check"
DESCRIPTION = """Call everything that the benchmark would call, on tiny scenes, and say what is wrong:
methods (shapes, start, pins, times, the clock, the same answer twice, the scene left as it was, no
connections), scenes (built alike twice, parts, derivatives of their own energies, a simulation) and metrics
(declared, finite, the same twice)."""
EXAMPLES = """examples:
  python -m benchmarks.check mine.py            all that METHODS, SCENES and METRICS of the file declare
  python -m benchmarks.check mine.py my_scene.py
  python -m benchmarks.check mine.py --seconds 300

exit status: 0 when nothing is wrong; 1 when something is, a line for each; 2 when a file cannot be read."""


def make_parser() -> argparse.ArgumentParser:
    """Return the parser of the command."""
    parser = Parser(prog=f"python -m {PROGRAM}", description=DESCRIPTION, epilog=EXAMPLES)
    parser.add_argument("what", nargs="+", metavar="FILE", help="a file")
    parser.add_argument("--seconds", type=float, default=SECONDS,
        help=f"after which one method in one scene is ended (default {SECONDS:g})")  # fmt: skip
    return parser


@command(PROGRAM)
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; return its exit status."""
    one_thread()
    options = make_parser().parse_args(arguments)
    if not options.seconds > 0.0:
        raise DeclarationError(f"--seconds {options.seconds:g}: give a positive number")
    declared, wrong = read_files(options.what), 0
    with tempfile.TemporaryDirectory() as folder:
        for line, fine in check_files(declared, Path(folder), options.seconds):
            print(line, flush=True)
            wrong += not fine
    print("nothing is wrong" if not wrong else f"{wrong} to mend")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
