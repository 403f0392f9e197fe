"""The trainings of a plan, carried out by its runner; comparison with the networks of the package."""

from __future__ import annotations

from pathlib import Path

from benchmarks.plan.plan import Plan
from benchmarks.tasks.training import TrainNetwork
from snug.trained import FOLDER, SUFFIX, network_name

KINDS = ("data", "clips", "network")  # of tasks: simulations to learn from, and trainings


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
