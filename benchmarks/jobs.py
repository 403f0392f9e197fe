"""The jobs of the workers: settle a garment, simulate a training motion, train a network."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from .presets import Preset
from .results import RunFolder, replacing
from .scenes import PREFIX, dressed_scene
from .wardrobe import Wardrobe

Tell = Callable[[int], None]
LOG_EVERY = 20  # training steps between two reports of progress


@dataclass(frozen=True)
class Simulated:
    """A simulated training motion: seconds of wall time, settling included, and how it ended."""

    motion: str
    seconds: float
    frames: int
    whole: bool
    status: str
    reason: str


@dataclass(frozen=True)
class Trained:
    """A trained network: wall seconds of training, size [MB] and the means of its last logged steps."""

    kind: str
    seed: int
    recipe: str
    seconds: float
    megabytes: float
    steps: int
    final: dict[str, float]


def start_path(run: RunFolder, scene: str) -> Path:
    """Where the settled start of a scene lies."""
    return run.trajectory_path(scene, "settled").with_suffix(".npy")


def settle(wardrobe: Wardrobe, tell: Tell, scene: str, preset: Preset, folder: Path) -> float:
    """Settle the garment of a dressed scene, write the start, give the seconds it took."""
    import numpy as np

    clock = time.perf_counter()
    built = dressed_scene(scene.removeprefix(PREFIX)).build(preset, wardrobe)
    start = built.start
    with replacing(start_path(RunFolder(folder), scene)) as temporary:
        np.save(temporary, start)
    tell(preset.settle_frames)
    return time.perf_counter() - clock


def simulate_motion(wardrobe: Wardrobe, tell: Tell, motion: str, preset: Preset, folder: Path) -> Simulated:
    """Settle and simulate one training motion, write its trajectory."""
    from reference_sim import simulate

    clock = time.perf_counter()
    scene = PREFIX + motion
    built = dressed_scene(motion).build(preset, wardrobe)
    start = built.start
    tell(preset.settle_frames)
    trajectory = simulate(
        built.cloth, built.energies, dt=built.dt, frames=built.frames, obstacle=built.obstacle, start=start
    )
    seconds = time.perf_counter() - clock
    path = RunFolder(folder).trajectory_path(scene, "simulation")
    path.parent.mkdir(parents=True, exist_ok=True)
    trajectory.save(path)
    tell(built.frames)
    whole = trajectory.frames == built.frames
    return Simulated(motion, seconds, trajectory.frames, whole, trajectory.status, trajectory.reason)


def train_network(
    wardrobe: Wardrobe,
    tell: Tell,
    kind: str,
    seed: int,
    steps: int,
    motions: Sequence[str],
    folder: Path,
    device: str,
) -> Trained:
    """Train one network (or make an untrained one) and write it to models/."""
    import torch

    from reference_sim import Trajectory
    from snug.dresser import DressedBody
    from snug.recipe import TRAININGS
    from snug.train import train, untrained_model

    from .methods.networks import model_path

    torch.set_num_threads(1)
    run = RunFolder(folder)
    dressed = DressedBody(wardrobe.body, wardrobe.garment)
    clips = wardrobe.named(motions)
    if kind == "untrained":
        model = untrained_model("snug", dressed, clips, seed=seed)
    else:
        targets = None
        training = TRAININGS[kind]
        if training.simulated:
            paths = {m: run.trajectory_path(PREFIX + m, "simulation") for m in motions}
            targets = {m: Trajectory.load(path).positions for m, path in paths.items()}
        told = 0

        def log(row: dict[str, float]) -> None:
            nonlocal told
            tell(int(row["step"]) - told)
            told = int(row["step"])

        model = train(
            training.kind, dressed, clips, steps=steps, seed=seed, trajectories=targets,
            recipe=training.recipe, log=log, progress=False, every=LOG_EVERY,
        )  # fmt: skip
    model.save(model_path(run.models, kind, seed))
    final = model.history[-1] if model.history else {}
    return Trained(kind, seed, model.recipe.name, model.seconds, model.megabytes, model.steps, dict(final))
