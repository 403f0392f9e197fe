"""A trained network from a file, in the place of its training: which file, and is it the same training?

A file says in its header what its training depended on, see benchmarks.tasks.training. Where recipe, steps,
seed, motions, body or garment differ, it is another network and is refused. Where processor, packages or
source differ, it is taken, and every row says so.
"""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from benchmarks import provenance
from benchmarks.fingerprint.digest import digest_of_file
from benchmarks.plan.plan import TaskId
from benchmarks.results.run_folder import RunFolder, model_path
from benchmarks.tasks.task import Context, Outcome, Task
from benchmarks.tasks.training import TrainNetwork, facts_of
from reference_sim.files.atomic_files import replacing
from snug.networks.tensor_file import TensorFileError, read_header
from snug.trained import FOLDER, SUFFIX, network_name

if TYPE_CHECKING:
    from snug.networks.trained_model import TrainedModel

NAME = "pretrained"  # in the result of a task: name of the file that its network is of
MACHINE = "machine"  # the input of a task that says where it runs
PACKAGE = "package "  # how the name of a package begins among the parts of a task
MAKE = "benchmarks.run -o DIR trains it, --trained DIR takes it"
PRESET = "quick"  # of the package's networks

Parts = Mapping[str, str]  # name -> digest or version


@dataclass(frozen=True, kw_only=True, eq=False)
class TakeNetwork(Task):
    """Copy of a trained network into the run's folder, under the name that its training gives it.

    instead_of: that training. source: the file; None without one. refusal: why the file is not taken, or why
    there is none. differing: names of what a training here depends on and that the file was trained with in
    another version; none where a training here gives the same bits.
    """

    kind = "network"
    silent = True
    stage = "pretrained networks"
    instead_of: TrainNetwork
    source: Path | None = None
    refusal: str = ""
    differing: tuple[str, ...] = ()

    def skip(self, needed: Mapping[TaskId, Outcome]) -> str:
        """Return why the network is not taken, or empty."""
        return self.refusal

    def clear(self, folder: RunFolder) -> None:
        """Remove the model of an earlier training."""
        self.instead_of.clear(folder)

    def run(self, context: Context, needed: Mapping[TaskId, Outcome]) -> Outcome:
        """Copy the file, once it is known to be whole. The outcome names the machine that trained it."""
        from snug.networks.trained_model import TrainedModel

        assert self.source is not None
        model, path = TrainedModel.load(self.source), self.instead_of.path(context.folder)
        path.parent.mkdir(parents=True, exist_ok=True)
        model.save(path)
        facts = {
            NAME: self.source.stem,
            "trained_at": model.origin["commit"],
            "differing": list(self.differing),
            "data_seconds": model.origin["data_seconds"],
        }
        return Outcome(
            result=facts_of(model) | facts,
            files=(context.folder.relative(path),),
            origin={"hardware": provenance.hardware_line(model.origin["hardware"])},
        )


def find_file(task: TrainNetwork, folder: Path) -> Path | None:
    """Return the file of a network in a folder of such files, or in the folder of the run that trained it."""
    named = folder / f"{network_name(task.training, task.garment, task.seed)}{SUFFIX}"
    trained = model_path(RunFolder(folder).models_of(task.garment), task.training, task.seed)
    return next((path for path in (named, trained) if path.is_file()), None)


def take_network(task: TrainNetwork, folder: Path) -> TakeNetwork:
    """Return the task that takes a network from a file of the folder, in the place of its training."""
    path = find_file(task, folder)
    name = network_name(task.training, task.garment, task.seed)
    differing: tuple[str, ...] = ()
    refusal = f"no pretrained network {name}: {MAKE}"
    if path is not None:
        differing, refusal = compare(path, task)
    inputs = {"file": digest_of_file(path) if path else "", "differing": differing}
    return TakeNetwork(
        name=task.name, label=task.label, inputs=inputs,
        code=("benchmarks/tasks/pretrained_network.py", "snug/networks"), instead_of=task, source=path,
        refusal=refusal, differing=differing,
    )  # fmt: skip


def compare(path: Path, task: TrainNetwork) -> tuple[tuple[str, ...], str]:
    """Return how the training in a file differs from one here, and why it cannot take its place, or empty."""
    try:
        origin = read_header(path).get("origin")
    except TensorFileError as error:
        return (), str(error)
    inputs, software = (_mapping(_mapping(origin).get(part)) for part in ("inputs", "software"))
    if not inputs:
        return (), f"{path}: says nothing of its training: {MAKE}"
    here = task.split_parts
    machines = [{MACHINE: parts.pop(MACHINE, "")} for parts in (inputs, here["inputs"])]
    if others := different(inputs, here["inputs"]):
        return (), f"{path}: a network of another training ({', '.join(others)}): {MAKE}"
    return (*different(*machines), *different(software, here["software"])), ""


def different(one: Parts, other: Parts) -> tuple[str, ...]:
    """Return the names, sorted, of what two trainings do not share.

    >>> different({"a": "1", "b": "2"}, {"a": "1", "c": "2"})
    ('b', 'c')
    """
    return tuple(sorted(name for name in one.keys() | other.keys() if one.get(name) != other.get(name)))


def _mapping(value: object) -> dict[str, Any]:
    return dict(value) if isinstance(value, dict) else {}


def without_machine(parts: Parts) -> dict[str, str]:
    """Return the parts of a task without the machine and the versions of packages."""
    return {name: part for name, part in parts.items() if name != MACHINE and not name.startswith(PACKAGE)}


def put_into_package(run: str | Path, package: Path = FOLDER) -> list[str]:
    """Put the networks that a run has trained into the package, in place of those of the same names.

    Args:
        run: folder of a run of preset quick with the package's body, garments and motions.
        package: where they are put.

    Returns:
        A line on each network: its name, and how its weights differ from those that were there.

    Raises:
        ValueError: the run is of another preset, or of other data.
    """
    from snug.motion.library import TRAIN
    from snug.networks.trained_model import TrainedModel

    folder = RunFolder(run)
    config, lines = folder.read_config(), list[str]()
    expected = {"preset": PRESET, "body": "of the package", "garment": "tailored", "pretrained": None}
    for name, value in expected.items():
        if config.get(name) != value:
            raise ValueError(f"{run}: its {name} is {config.get(name)}; the package has networks of {value}")
    for path in sorted(folder.models.rglob("*.safetensors")):
        model = TrainedModel.load(path)
        if model.origin["motions"] != list(TRAIN):
            raise ValueError(f"{path}: learned from other motions than the library's")
        if not model.steps:  # untrained
            continue
        name = network_name(model.origin["network"], model.origin["garment"], model.seed)
        target = package / f"{name}{SUFFIX}"
        lines.append(f"{target.stem}: {_compared(model, target)}")
        with replacing(target) as unfinished:
            shutil.copyfile(path, unfinished)
    return lines


def _compared(model: TrainedModel, packaged: Path) -> str:
    """Return in words how the weights of a model differ from those in a file of the package."""
    from snug.networks.trained_model import TrainedModel

    if not packaged.is_file():
        return "the package had none"
    weights, other = (m.network.state_dict() for m in (model, TrainedModel.load(packaged)))
    if weights.keys() != other.keys() or any(weights[n].shape != other[n].shape for n in weights):
        return "the package's had another architecture"
    largest = max(float((weights[name] - other[name]).abs().max()) for name in weights)
    return f"differs from the package's by up to {largest:.2g}" if largest else "the bits of the package's"
