"""python -m benchmarks.networks: train the networks that a run would train, and make those of the package."""

from __future__ import annotations

import argparse
import shlex
import shutil
import sys
from collections.abc import Sequence
from pathlib import Path

from benchmarks.plan.make_plan import make_plan
from benchmarks.plan.options import add_scene_options, parse_seeds, scene_fields, split
from benchmarks.plan.plan import Plan
from benchmarks.plan.request import Request
from benchmarks.process.timing import one_thread
from benchmarks.results.run_folder import RunFolder
from benchmarks.tasks.training import TrainNetwork
from reference_sim.command.command_line import Parser, command
from reference_sim.files.atomic_files import replacing
from snug.trained import FOLDER, SUFFIX, network_name

PROGRAM = "benchmarks.networks"
METHODS = "snug,supervised,pbns"  # those that a run without options trains
OUT = Path("reports/runs/networks")
KINDS = ("data", "clips", "network")  # of tasks: simulations to learn from, and trainings
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
        **scene_fields(options),
    )
    plan = make_plan(request)
    folder, (trained, failures) = RunFolder(plan.folder), train(plan)
    for task in trained:
        path, packaged = task.path(folder), packaged_file(task)
        print(f"{path}: {path.stat().st_size / 1e6:.2f} MB; {compared(path, packaged)}")
        if options.into_package:
            with replacing(packaged) as unfinished:
                shutil.copyfile(path, unfinished)
    for line in failures:
        print(line, file=sys.stderr)
    return 1 if failures else 0


def train(plan: Plan) -> tuple[list[TrainNetwork], list[str]]:
    """Train the networks of a plan that its folder lacks; return their tasks, and a line for each failure."""
    from benchmarks.runner.execute_plan import executor_of
    from benchmarks.runner.lock import held
    from benchmarks.runner.loop import Runner
    from benchmarks.runner.run_json import RunLog
    from benchmarks.runner.schedule import tasks_of

    tasks = [task for task in tasks_of(plan) if task.kind in KINDS]
    with held(plan.folder):
        log = RunLog(plan)
        runner = Runner(tasks, log.cache)
        runner.run(executor_of(plan, log.folder, log.open_assets()), log)
    failures = [f"{label}: {reason}" for label, reason in runner.broken().items()]
    trainings = [task for task in tasks if isinstance(task, TrainNetwork) and task.chosen]
    return [task for task in trainings if not runner.outcomes[task.id].failed], failures


def packaged_file(task: TrainNetwork) -> Path:
    """Return the path of the package's network of that training, whether or not it is there."""
    return FOLDER / f"{network_name(task.training, task.garment, task.seed)}{SUFFIX}"


def compared(path: Path, packaged: Path) -> str:
    """Return in words how the weights in a file differ from those in the package's."""
    from snug.networks.trained_model import TrainedModel

    if not packaged.is_file():
        return "the package has none"
    weights, other = (TrainedModel.load(file).network.state_dict() for file in (path, packaged))
    if weights.keys() != other.keys() or any(weights[n].shape != other[n].shape for n in weights):
        return "the package's has another architecture"
    largest = max(float((weights[name] - other[name]).abs().max()) for name in weights)
    return f"differs from the package's by up to {largest:.2g}" if largest else "the bits of the package's"


if __name__ == "__main__":
    sys.exit(main())
