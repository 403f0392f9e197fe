"""python -m benchmarks.networks: train the networks that a run would train, and make those of the package."""

from __future__ import annotations

import argparse
import shlex
import shutil
import sys
from collections.abc import Sequence
from pathlib import Path

from benchmarks.networks.training_run import compared, packaged_file, train
from benchmarks.plan.make_plan import make_plan
from benchmarks.plan.options import add_scene_options, parse_seeds, scene_fields, split
from benchmarks.plan.plan import STATES, PlanError
from benchmarks.plan.request import Request
from benchmarks.process.timing import one_thread
from benchmarks.results.run_folder import RunFolder
from benchmarks.tasks.task import RunStopped
from reference_sim.command_line import Parser, command
from reference_sim.files.atomic_files import replacing

PROGRAM = "benchmarks.networks"
METHODS = "snug,supervised,pbns"  # those that a run without options trains
PRESET = "quick"  # of the package's networks
OUT = Path("reports/runs/networks")
EXAMPLES = """examples:
  python -m benchmarks.networks                               the package's networks again
  python -m benchmarks.networks --seeds 0,1,2 -o nets         further seeds
  python -m benchmarks.networks --methods tailornet,santesteban2019 -o nets
  python -m benchmarks.run --trained nets --seeds 0,1,2       measures them without training

The folder is that of a run: what is finished there for the same inputs and code is taken as it is, and a
  training that was killed goes on from its last checkpoint. Each network is compared with the package's.
exit status: 0 all are trained; 1 a training failed; 2 the request cannot be met: one line says why; 130
  interrupted: the same command goes on from there."""


def make_parser() -> argparse.ArgumentParser:
    """Return the parser of the command."""
    parser = Parser(
        prog=f"python -m {PROGRAM}",
        description="Train the networks that benchmarks.run would train, without measuring them.",
        epilog=EXAMPLES,
    )
    add_scene_options(parser)
    add = parser.add_argument
    add("--methods", action="append", default=[], metavar="NAME,...",
        help=f"methods whose networks are trained (default {METHODS})")  # fmt: skip
    add("--seeds", default="0", metavar="N,...", help="seeds of training (default 0)")
    add("--workers", type=int, metavar="N", help="processes side by side (default 2, or the cores there are)")
    add("-o", "--out", metavar="DIR", default=OUT, help=f"folder of the run (default {OUT})")
    add("--into-package", action="store_true", help="put the networks into the package, in place of its own")
    return parser


@command(PROGRAM, goes_on="the same command goes on from there")
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; return its exit status."""
    command_line = list(sys.argv[1:] if arguments is None else arguments)
    one_thread()
    options = make_parser().parse_args(command_line)
    request = Request(
        command=shlex.join(["python", "-m", PROGRAM, *command_line]),
        suites=("garments",),
        methods=split(options.methods) or split([METHODS]),
        seeds=parse_seeds(options.seeds),
        folder=Path(options.out),
        workers=options.workers,
        only=STATES[1:],  # a training whose process was killed is done again too
        **scene_fields(options),
    )
    own = (request.motions, request.body, request.garment, request.self_contact)
    other_data = any((*own, request.test_motions, request.validation_motions))
    if options.into_package and (other_data or options.preset != PRESET):
        what = f"preset {PRESET}, its own body, garments and motions, without self-contact"
        raise PlanError(f"--into-package: the package has networks of {what}")
    plan = make_plan(request)
    try:
        folder, (trained, failures) = RunFolder(plan.folder), train(plan)
    except RunStopped as error:  # as of a full disk
        print(f"{PROGRAM}: {error}; the same command goes on from there", file=sys.stderr)
        return 1
    for task in trained:
        path, packaged = task.path(folder), packaged_file(task)
        print(f"{path}: {path.stat().st_size / 1e6:.2f} MB; {compared(path, packaged)}")
        if options.into_package:
            with replacing(packaged) as unfinished:
                shutil.copyfile(path, unfinished)
    for line in failures:
        print(line, file=sys.stderr)
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
