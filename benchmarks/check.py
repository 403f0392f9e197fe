"""python -m benchmarks.check: does a file of your own keep the contract? What is wrong, and the remedy."""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from benchmarks.contract.check_files import SECONDS, check_files, read_files
from benchmarks.declarations import DeclarationError
from benchmarks.plan.options import add_scene_options
from benchmarks.plan.plan_scene import plan_scene
from benchmarks.process.timing import one_thread
from reference_sim.command_line import Parser, command

PROGRAM = "benchmarks.check"
DESCRIPTION = """Call everything that the benchmark would call, on tiny scenes, and say what is wrong:
methods (shapes, start, pins, times, the clock, the same answer twice, the scene left as it was, no
connections), scenes (built alike twice, parts, derivatives of their own energies, a simulation) and metrics
(declared, finite, the same twice)."""
EXAMPLES = """examples:
  python -m benchmarks.check mine.py            all that METHODS, SCENES and METRICS of the file declare
  python -m benchmarks.check mine.py my_scene.py
  python -m benchmarks.check mine.py --seconds 300
  python -m benchmarks.check mine.py --scene tshirt/kick --preset smoke    methods in a scene of that size
  python -m benchmarks.check mine.py --scene shirt/kick --garment shirt.obj

exit status: 0 when nothing is wrong; 1 when something is, a line for each; 2 when a file cannot be read."""


def make_parser() -> argparse.ArgumentParser:
    """Return the parser of the command."""
    parser = Parser(prog=f"python -m {PROGRAM}", description=DESCRIPTION, epilog=EXAMPLES)
    parser.add_argument("what", nargs="+", metavar="FILE", help="a file")
    parser.add_argument("--scene", metavar="SCENE",
        help="check the methods in this scene of benchmarks.run --list, in place of the tiny ones: for "
        "networks that are bound to a garment or a mesh")  # fmt: skip
    parser.add_argument("--seconds", type=float, default=SECONDS,
        help=f"after which one method in one scene is ended (default {SECONDS:g})")  # fmt: skip
    add_scene_options(parser)
    return parser


@command(PROGRAM)
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; return its exit status."""
    one_thread()
    options = make_parser().parse_args(arguments)
    if not options.seconds > 0.0:
        raise DeclarationError(f"--seconds {options.seconds:g}: give a positive number")
    declared, wrong = read_files(options.what), 0
    scene_plan = None
    if options.scene:
        if not declared.methods:
            raise DeclarationError(f"--scene {options.scene}: {', '.join(options.what)} declares no METHODS")
        scene_plan = plan_scene(options.scene, options)
    with tempfile.TemporaryDirectory() as folder:
        for line, fine in check_files(declared, Path(folder), options.seconds, scene_plan):
            print(line, flush=True)
            wrong += not fine
    print("nothing is wrong" if not wrong else f"{wrong} to mend")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
