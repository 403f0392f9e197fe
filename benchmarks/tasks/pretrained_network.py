"""A trained network from a file, in the place of its training: which file, and is it the same training?

A file says in its header what its training depended on, see benchmarks.tasks.training. Where recipe, steps,
seed, motions, body or garment differ, it is another network and is refused. Where processor, packages or
source differ, it is taken, and every row says so.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks import provenance
from benchmarks.cell import TaskId
from benchmarks.fingerprint.digest import digest_of_file
from benchmarks.results.run_folder import RunFolder, model_path
from benchmarks.tasks.task import Context, Outcome, Task
from benchmarks.tasks.training import TrainNetwork, facts_of
from snug.networks.tensor_file import TensorFileError, read_header
from snug.trained import SUFFIX, network_name

NAME = "pretrained"  # in the result of a task: name of the file that its network is of
MACHINE = "machine"  # the input of a task that says where it runs
PACKAGE = "package "  # how the name of a package begins among the parts of a task
# Files of benchmarks that decide the bits of a network; others carry out, store and report.
DECIDING = ("benchmarks/assets/", "benchmarks/tasks/training.py")
MAKE = "python -m benchmarks.networks -o DIR trains it, --trained DIR takes it"

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
        name=task.name, label=task.label, inputs=inputs, modules=(__name__,),
        instead_of=task, source=path, refusal=refusal, differing=differing,
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
    deciding = [dict(filter(_decides, parts.items())) for parts in (software, here["software"])]
    return (*different(*machines), *different(*deciding)), ""


def different(one: Parts, other: Parts) -> tuple[str, ...]:
    """Return the names, sorted, of what two trainings do not share.

    >>> different({"a": "1", "b": "2"}, {"a": "1", "c": "2"})
    ('b', 'c')
    """
    return tuple(sorted(name for name in one.keys() | other.keys() if one.get(name) != other.get(name)))


def _mapping(value: object) -> dict[str, Any]:
    return dict(value) if isinstance(value, dict) else {}


def without_machine(parts: Parts) -> dict[str, str]:
    """Return the deciding parts of a task without the machine and the versions of packages."""
    return {
        name: part
        for name, part in parts.items()
        if name != MACHINE and not name.startswith(PACKAGE) and _decides((name, part))
    }


def _decides(part: tuple[str, str]) -> bool:
    name, _ = part
    return not name.startswith("benchmarks/") or name.startswith(DECIDING)
