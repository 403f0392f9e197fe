"""Training of one network."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from benchmarks import provenance
from benchmarks.declarations import load
from benchmarks.plan.cell import TaskId
from benchmarks.provenance import digest, digest_of_file
from benchmarks.results.run_folder import RunFolder, model_path
from benchmarks.runner.task import Context, Outcome, Task
from reference_sim.files.atomic_files import replacing
from snug.kinds import KINDS
from snug.networks.tensor_file import TensorFileError, read_header
from snug.trained import FOLDER, SUFFIX, network_name

if TYPE_CHECKING:
    import numpy as np

    from benchmarks.assets import Assets
    from benchmarks.training import Training
    from snug.motion.motion import Motion
    from snug.networks.trained_model import TrainedModel

LONGEST = 4  # times the steps of others: at most as many has a training that is to converge
VALIDATIONS = 25  # in the steps of others: after so many that were no better it has converged
PREPARATION = 25.0  # [s] expected before the first step: clips are mixed, bodies posed
LOG_EVERY = 20  # training steps between two reports of progress
# Of a training's summary: what its guard against divergence has done, and its epochs.
INCIDENTS = ("high_windows", "skipped_updates", "restored", "epochs")
CHECKPOINT_MINUTES = 1.0  # between two checkpoints: what a kill loses at most


@dataclass(frozen=True, kw_only=True, eq=False)
class TrainNetwork(Task):
    """A network, or an untrained one, in the folder of its garment's networks.

    training: its name; chosen: how it is trained, None: not at all; home: what has to be loaded before, as
    the file that declares an energy of its recipe. motions: what it learns from; held_out: motions that
    stop it, where it goes on until it has converged; simulated: motion -> the task that simulates it, where
    it learns from simulations; clips: those that simulate mixed clips. device: cpu or cuda, for every part of
    a step. parts: name -> digest or version of all that the network depends on: inputs, source files,
    packages, data, and as `simulations` the code and inputs of what simulates.
    """

    kind = "network"
    silent = True
    stage = "training"
    unit_seconds = 0.03
    training: str
    chosen: Training | None
    home: str = ""
    seed: int
    garment: str
    steps: int
    motions: tuple[str, ...]
    held_out: tuple[str, ...] = ()
    simulated: Mapping[str, TaskId]
    clips: tuple[TaskId, ...] = ()
    device: str
    parts: Mapping[str, str] = field(default_factory=dict)

    @property
    def expected_seconds(self) -> float:
        """Expected duration [s]."""
        if self.chosen is None:
            return 0.0
        return PREPARATION + super().expected_seconds * KINDS[self.chosen.kind].cost

    @property
    def key(self) -> str:
        """Digest of the parts.

        With equal simulations, a training of the same key that was killed goes on from its last checkpoint,
        and ends as it would have.
        """
        return digest(dict(self.parts))

    @property
    def split_parts(self) -> dict[str, dict[str, str]]:
        """The parts as `inputs` and as `software`: source, packages and data."""
        inputs = {name: part for name, part in self.parts.items() if name in self.inputs}
        software = {name: part for name, part in self.parts.items() if name not in inputs}
        return {"inputs": inputs, "software": software}

    def path(self, folder: RunFolder) -> Path:
        """Return the path of the trained model."""
        return model_path(folder.models_of(self.garment), self.training, self.seed)

    def clear(self, folder: RunFolder) -> None:
        """Remove the model of an earlier training."""
        self.path(folder).unlink(missing_ok=True)

    def run(self, context: Context, needed: Mapping[TaskId, Outcome]) -> Outcome:
        """Train the network and write its model."""
        import torch

        from reference_sim.trajectory import Trajectory
        from snug.networks.dressed_body import DressedBody
        from snug.training.checkpoint import Checkpoint
        from snug.training.train_network import train_network, untrained_model
        from snug.training.validation import Validation

        torch.set_num_threads(1)
        if self.home:
            load(self.home)
        assets, run = context.assets, context.folder
        assert assets is not None
        path = self.path(run)
        dressed = DressedBody(assets.body, assets.garments[self.garment])
        motions, targets = self.motions, None
        mixed: list[Motion] = []
        if self.simulated:
            whole = {m: needed[id] for m, id in self.simulated.items() if self._is_whole(needed.get(id))}
            motions = tuple(motion for motion in self.motions if motion in whole)
            targets = {m: Trajectory.load(run.path / o.files[0]).positions for m, o in whole.items()}
            mixed, simulated = self._mixed(assets, run, needed)
            targets |= simulated
        validation = None
        if self.held_out:
            every = max(1, self.steps // (LONGEST * VALIDATIONS))
            held_out = assets.named(self.held_out)
            validation = Validation(motions=held_out, every=every, patience=VALIDATIONS, trajectories=targets)
        checkpoint = Checkpoint(
            path=path.with_name(f".{path.stem}.checkpoint.safetensors"), minutes=CHECKPOINT_MINUTES,
            resume=True, key=digest([self.key, targets]),
        )  # fmt: skip
        reported, preparation = 0.0, PREPARATION / max(self.expected_seconds, PREPARATION)  # steps, share

        def log(row: dict[str, float]) -> None:
            nonlocal reported
            done = self.steps * preparation + row["step"] * (1.0 - preparation)
            context.tell(done - reported)
            reported = done

        if self.chosen is None:
            model = untrained_model("snug", dressed, assets.named(motions), seed=self.seed)
        else:
            model = train_network(
                self.chosen.kind, dressed, [*assets.named(motions), *mixed], steps=self.steps,
                seed=self.seed, trajectories=targets, recipe=self.chosen.recipe, log=log, progress=False,
                every=LOG_EVERY, device=self.device, checkpoint=checkpoint, validation=validation,
            )  # fmt: skip
        if reported < self.steps:  # it ended early
            context.tell(self.steps - reported)
        model.origin = self._origin(needed, left_out=[name for name in self.motions if name not in motions])
        path.parent.mkdir(parents=True, exist_ok=True)
        model.save(path)
        checkpoint.delete()
        return Outcome(result=facts_of(model), files=(run.relative(path),))

    def _origin(self, needed: Mapping[TaskId, Outcome], *, left_out: list[str]) -> dict[str, Any]:
        """Return what the file of the model says of its training; left_out: motions without simulation."""
        simulated = self.chosen.simulated if self.chosen else None
        return {
            "network": self.training,
            "garment": self.garment,
            "motions": [name for name in self.motions if name not in left_out],
            "held_out": list(self.held_out),
            "simulated_by": simulated.method if simulated else "",
            "left_out": left_out,
            "clips_left_out": sum(len(needed[id].result["left_out"]) for id in self.clips if id in needed),
            "data_seconds": sum(needed[id].seconds for id in self.reads if id in needed),
            "commit": provenance.commit(),
            "hardware": provenance.hardware(self.device),
            "versions": provenance.versions(),
            "digest": self.key,
            **self.split_parts,
        }

    def _mixed(
        self, assets: Assets, folder: RunFolder, needed: Mapping[TaskId, Outcome]
    ) -> tuple[list[Motion], dict[str, np.ndarray]]:
        """Return the augmented clips that were simulated, and their vertices (T,V,3) [m] by name."""
        from reference_sim.files.array_file import read_arrays
        from snug.training.augmentation import make_shared_clips

        vertices_of: dict[str, np.ndarray] = {}
        for id in self.clips:
            if id in needed:
                vertices_of |= read_arrays(folder.path / needed[id].files[0])
        if twice := sorted(vertices_of.keys() & set(self.motions)):
            raise ValueError(f"training motion {twice[0]!r}: a mixed clip is called so: rename its file")
        vertices = len(assets.garments[self.garment].rest_positions)
        simulated = self.chosen.simulated if self.chosen else None
        clips = make_shared_clips(
            assets.named(self.motions), len(self.clips), vertices=vertices,
            swinging=simulated is not None and simulated.swinging,
        )  # fmt: skip
        return [clip for clip in clips if clip.name in vertices_of], vertices_of

    @staticmethod
    def _is_whole(outcome: Outcome | None) -> bool:
        return outcome is not None and bool(outcome.result["whole"])


def facts_of(model: TrainedModel) -> dict[str, Any]:
    """Return the result of the task that trained a model, or took it from a file."""
    return {
        "recipe": model.recipe.name,
        "left_out": model.origin["left_out"],
        "clips_left_out": model.origin["clips_left_out"],
        "frames": model.summary.get("training_frames", 0),
        "seconds": model.seconds,
        "setup_seconds": model.setup_seconds,
        "megabytes": model.megabytes,
        "steps": model.steps,
        **{name: model.summary[name] for name in INCIDENTS if name in model.summary},
        "validation": model.summary.get("validation", {}),
        "last": dict(model.history[-1]) if model.history else {},
    }


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
        code=("benchmarks/runner/networks.py", "snug/networks"), instead_of=task, source=path,
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
