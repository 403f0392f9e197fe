"""Training of one network in a worker; see benchmarks.workers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from .results import RunFolder
from .wardrobe import Wardrobe

if TYPE_CHECKING:
    from .plan import Network
    from .workers import Tell

LOG_EVERY = 20  # training steps between two reports of progress
CHECKPOINT_MINUTES = 5.0  # between two checkpoints: a training of preset quick is over before the first


@dataclass(frozen=True)
class Trained:
    """A trained network: wall seconds of its steps, and of making ready what they need (setup_seconds), size
    [MB] and the means of its last logged steps.

    files: the model, in the run's folder.
    """

    name: str
    seed: int
    recipe: str
    seconds: float
    setup_seconds: float
    megabytes: float
    steps: int
    final: dict[str, float]
    files: tuple[str, ...]


def train_network(
    wardrobe: Wardrobe,
    tell: Tell,
    network: Network,
    steps: int,
    motions: Mapping[str, Path | None],
    folder: Path,
    device: str,
    key: str,
) -> Trained:
    """Train that network (or make an untrained one) and write it where its garment's networks lie.

    motions: name -> file of its simulation, which is read where the network learns from one. device: cpu or
    cuda, for every part of a step. key: of the work; a training of the same key that was killed goes on from
    its last checkpoint, and ends as it would have.
    """
    import torch

    from reference_sim.trajectory import Trajectory
    from snug.dressed_body import DressedBody
    from snug.recipe import TRAININGS
    from snug.train import train, untrained_model
    from snug.training_run import Saving

    from .methods.networks import model_path

    torch.set_num_threads(1)
    name, seed, run = network.name, network.seed, RunFolder(folder)
    path = model_path(run.models_of(network.garment), name, seed)
    path.unlink(missing_ok=True)  # if this training fails, no study is to take an earlier one's model for it
    checkpoint = path.with_name(f".{path.stem}.{key}.checkpoint.safetensors")
    for other in set(path.parent.glob(f".{path.stem}.*.checkpoint.safetensors")) - {checkpoint}:
        other.unlink()  # of a training that nobody asks for any more
    saving = Saving(path=checkpoint, minutes=CHECKPOINT_MINUTES, resume=True)
    dressed = DressedBody(wardrobe.body, wardrobe.garments[network.garment])
    clips = wardrobe.named(motions)
    if name == "untrained":
        model = untrained_model("snug", dressed, clips, seed=seed)
    else:
        training = TRAININGS[name]
        targets = None
        if training.simulated:
            targets = {m: Trajectory.load(path).positions for m, path in motions.items() if path}
        told = 0

        def log(row: dict[str, float]) -> None:
            nonlocal told
            tell(int(row["step"]) - told)
            told = int(row["step"])

        model = train(
            training.kind, dressed, clips, steps=steps, seed=seed, trajectories=targets,
            recipe=training.recipe, log=log, progress=False, every=LOG_EVERY, device=device,
            saving=saving,
        )  # fmt: skip
    model.save(path)
    saving.done()
    return Trained(
        name=name,
        seed=seed,
        recipe=model.recipe.name,
        seconds=model.seconds,
        setup_seconds=model.setup_seconds,
        megabytes=model.megabytes,
        steps=model.steps,
        final=dict(model.history[-1]) if model.history else {},
        files=(run.relative(path),),
    )
