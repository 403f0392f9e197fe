"""Networks from files in the place of trainings: which file, and whether a training here gives its bits.

A file says in its header what its training depended on, see benchmarks.tasks.training. Where recipe, steps,
seed, motions, body or garment differ, it is another network and is refused. Where processor, packages or
source differ, it is taken, and every row says so.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from benchmarks.fingerprint.digest import digest_of_file
from benchmarks.results.run_folder import RunFolder, model_path
from benchmarks.tasks.pretrained_network import TakeNetwork
from benchmarks.tasks.training import TrainNetwork
from snug.networks.tensor_file import TensorFileError, read_header
from snug.trained import SUFFIX, network_name

MACHINE = "machine"  # the input of a task that says where it runs
PACKAGE = "package "  # how the name of a package begins among the parts of a task
# Files of benchmarks that decide the bits of a network; others carry out, store and report.
DECIDING = ("benchmarks/assets/", "benchmarks/tasks/training.py")
MAKE = "python -m benchmarks.networks -o DIR trains it, --trained DIR takes it"

Parts = Mapping[str, str]  # name -> digest or version


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
        name=task.name, label=task.label, inputs=inputs, modules=("benchmarks.tasks.pretrained_network",),
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
