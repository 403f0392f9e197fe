"""Training of one network."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from benchmarks import provenance
from benchmarks.declarations import load
from benchmarks.plan.cell import TaskId
from benchmarks.provenance import digest
from benchmarks.results.run_folder import RunFolder, model_path
from benchmarks.runner.task import Context, Needed, Outcome
from reference_sim.files.atomic_files import replacing
from snug.kinds import KINDS
from snug.networks.tensor_file import TensorFileError, read_header
from snug.trained import FOLDER, SUFFIX, network_name

if TYPE_CHECKING:
    import numpy as np

    from benchmarks.assets import Assets
    from benchmarks.method import Training
    from benchmarks.plan.plan import Network
    from snug.motion.motion import Motion
    from snug.networks.trained_model import TrainedModel

EVERY = 20  # training steps between two rows of a model's history
# Of a training's summary: what its guard against divergence did, and its epochs.
INCIDENTS = ("high_windows", "skipped_updates", "restored", "epochs")
CHECKPOINT_MINUTES = 1.0  # between two checkpoints: what a kill loses at most


@dataclass(frozen=True, kw_only=True)
class NetworkTraining:
    """Training of a network.

    Attributes:
        network: its name, seed and garment.
        training: by the sizes of the run.
        steps: of the training.
        motions: what it learns from.
        reads: tasks that simulate motions and mixed clips, where it learns from simulations.
        device: cpu or cuda, for every part of a step.
        inputs: name -> digest of each input.
        key: digest of inputs, code and packages. With equal simulations, a training of the same key that
            was killed goes on from its last checkpoint, and ends as it would have.
    """

    network: Network
    training: Training
    steps: int
    motions: tuple[str, ...]
    reads: tuple[TaskId, ...] = ()
    device: str
    inputs: Mapping[str, str]
    key: str

    @property
    def work(self) -> float:
        """Expected duration, in steps of SNUG's network."""
        return self.steps * KINDS[self.training.kind].cost

    def path(self, folder: RunFolder) -> Path:
        """Return the path of the trained model."""
        return model_path(folder.models_of(self.network.garment), self.network.name, self.network.seed)

    def files(self, folder: RunFolder) -> tuple[str, ...]:
        """Return the name of the model's file in the folder; none of the package's."""
        return () if self.training.packaged else (folder.relative(self.path(folder)),)


def train(job: NetworkTraining, context: Context, outcomes: Needed) -> Outcome:
    """Train the network and write its model."""
    import torch

    from reference_sim.trajectory import Trajectory
    from snug.networks.dressed_body import DressedBody
    from snug.training.checkpoint import Checkpoint
    from snug.training.train_network import train_network

    torch.set_num_threads(1)
    network, training = job.network, job.training
    if network.declared_in:  # as of an energy of its recipe
        load(network.declared_in)
    assets, run = context.assets, context.folder
    assert assets is not None
    path = job.path(run)
    dressed = DressedBody(assets.body, assets.garments[job.network.garment])
    motions, targets = job.motions, None
    mixed: list[Motion] = []
    if job.reads:
        simulations = {o.result["motion"]: o for o in outcomes.values() if o.result.get("whole")}
        motions = tuple(motion for motion in job.motions if motion in simulations)
        targets = {m: Trajectory.load(run.path / o.files[0]).positions for m, o in simulations.items()}
        mixed, simulated = mix_clips(job, assets, run, outcomes)
        targets |= simulated
    checkpoint = Checkpoint(
        path=path.with_name(f".{path.stem}.checkpoint.safetensors"), minutes=CHECKPOINT_MINUTES,
        resume=True, key=digest([job.key, targets]),
    )  # fmt: skip
    model = train_network(
        training.kind, dressed, [*assets.pick(motions), *mixed], steps=job.steps, seed=network.seed,
        trajectories=targets, recipe=training.recipe, progress=False, every=EVERY, device=job.device,
        checkpoint=checkpoint,
    )  # fmt: skip
    model.origin = origin_of(job, outcomes, left_out=[m for m in job.motions if m not in motions])
    outcome = _outcome(model, job, run, {})
    checkpoint.delete()
    return outcome


def _outcome(model: TrainedModel, job: NetworkTraining, run: RunFolder, facts: dict[str, Any]) -> Outcome:
    """Write the model; the outcome says how, and on what machine, it was trained."""
    files = job.files(run)
    for name in files:
        model.save(run.path / name)
    result = {
        "recipe": model.recipe.name,
        "left_out": model.origin["left_out"],
        "clips_left_out": model.origin["clips_left_out"],
        "frames": model.summary.get("training_frames", 0),
        "seconds": model.seconds,
        "setup_seconds": model.setup_seconds,
        "megabytes": model.network.megabytes,
        "steps": model.steps,
        **{name: model.summary[name] for name in INCIDENTS if name in model.summary},
        "last": dict(model.history[-1]) if model.history else {},
    }
    origin = {"hardware": provenance.hardware_line(model.origin["hardware"])}
    return Outcome(result=result | facts, files=files, origin=origin)


def origin_of(job: NetworkTraining, outcomes: Needed, *, left_out: list[str]) -> dict[str, Any]:
    """Return what the model's file says of its training; left_out: motions not simulated."""
    simulated = job.training.simulated
    return {
        "network": job.network.name,
        "garment": job.network.garment,
        "motions": [name for name in job.motions if name not in left_out],
        "simulated_by": simulated.method if simulated else "",
        "clips_by": simulated.clips_by or simulated.method if simulated else "",
        "left_out": left_out,
        "clips_left_out": sum(len(outcome.result.get("left_out", ())) for outcome in outcomes.values()),
        "data_seconds": sum(outcome.seconds for outcome in outcomes.values()),
        "commit": provenance.commit(),
        "hardware": provenance.hardware(job.device),
        "versions": provenance.versions(),
        "digest": job.key,
        "inputs": dict(job.inputs),
    }


def mix_clips(
    job: NetworkTraining, assets: Assets, folder: RunFolder, outcomes: Needed
) -> tuple[list[Motion], dict[str, np.ndarray]]:
    """Return the simulated clips, and their vertices (T,V,3) [m] by name."""
    from reference_sim.files.array_file import read_arrays
    from snug.training.augmentation import make_shared_clips

    vertices_of: dict[str, np.ndarray] = {}
    parts = [id for id in job.reads if id[0] == "clips"]
    for outcome in (outcomes[id] for id in parts if id in outcomes):
        vertices_of |= read_arrays(folder.path / outcome.files[0])
    if twice := sorted(vertices_of.keys() & set(job.motions)):
        raise ValueError(f"training motion {twice[0]!r}: a mixed clip is called so: rename its file")
    vertices = len(assets.garments[job.network.garment].rest_positions)
    turns = job.training.simulated.turns if job.training.simulated else 1.0
    clips = make_shared_clips(assets.pick(job.motions), len(parts), turns=turns, vertices=vertices)
    return [clip for clip in clips if clip.name in vertices_of], vertices_of


NAME = "pretrained"  # in the result of a task: name of the file that its network is of
MACHINE = "machine"  # the input of a task that says where it runs
MAKE = "benchmarks.run -o DIR trains it, --trained DIR takes it"


def find_pretrained(job: NetworkTraining, folder: Path) -> tuple[Path | None, str]:
    """Return the file of a network in a folder of such, or of the run that trained it.

    Where there is none, or one of another training (if packaged: body or garment), why it is not taken.
    """
    packaged = job.training.packaged
    name = network_name(packaged or job.network.name, job.network.garment, job.network.seed)
    places = (folder / f"{name}{SUFFIX}", job.path(RunFolder(folder)))
    path = next((path for path in places if path.is_file()), None)
    if path is None:
        return None, f"no pretrained network {name}: {MAKE}"
    try:
        inputs = read_header(path)["origin"].get("inputs", {})
    except TensorFileError as error:
        return path, str(error)
    names = job.inputs.keys() | (inputs.keys() if not packaged else ())
    others = sorted(n for n in names if n != MACHINE and inputs.get(n) != job.inputs.get(n))
    return path, f"{path}: a network of another training ({', '.join(others)}): {MAKE}" if others else ""


def take(job: NetworkTraining, source: Path, context: Context, outcomes: Needed) -> Outcome:
    """Copy a network that is whole; one of the package is read from there."""
    from snug.networks.trained_model import TrainedModel

    model = TrainedModel.load(source)
    origin = model.origin
    facts = {NAME: source.stem, "trained_at": origin["commit"], "data_seconds": origin["data_seconds"]}
    return _outcome(model, job, context.folder, facts)


def put_into_package(run: str | Path, package: Path = FOLDER) -> list[str]:
    """Put the networks that a run has trained into the package; return their names."""
    names = []
    for path in sorted(RunFolder(run).models.rglob("*.safetensors")):
        header = read_header(path)
        origin = header["origin"]
        names.append(network_name(origin["network"], origin["garment"], header["seed"]))
        with replacing(package / f"{names[-1]}{SUFFIX}") as unfinished:
            shutil.copyfile(path, unfinished)
    return names
