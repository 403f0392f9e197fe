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
) -> Trained:
    """Train that network (or make an untrained one) and write it where its garment's networks lie.

    motions: name -> file of its simulation, which is read where the network learns from one. device: cpu or
    cuda, for every part of a step.
    """
    import torch

    from reference_sim.trajectory import Trajectory
    from snug.dresser import DressedBody
    from snug.recipe import TRAININGS
    from snug.train import train, untrained_model

    from .methods.networks import model_path

    torch.set_num_threads(1)
    name, seed, run = network.name, network.seed, RunFolder(folder)
    path = model_path(run.models_of(network.garment), name, seed)
    path.unlink(missing_ok=True)  # if this training fails, no study is to take an earlier one's model for it
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
        )  # fmt: skip
    model.save(path)
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
