"""Train a network, with log and checkpoints between its steps. The command is snug.train."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from reference_sim.command_line import progress_bar
from snug.kinds import find_kind
from snug.motion.motion import Motion
from snug.networks.dressed_body import DressedBody
from snug.networks.trained_model import TrainedModel, digest_triangles
from snug.recipe import Recipe
from snug.training.captured_step import CapturedTrainer
from snug.training.checkpoint import Checkpoint, describe_run
from snug.training.device import find_device
from snug.training.optimisation_step import Trainer
from snug.training.simulated_data import Trajectories


class TrainingLoop:
    """One trainer taken through all its steps by `run`; options as `train_network` has them.

    setup_seconds: time [s] that making the trainer took.
    """

    def __init__(
        self,
        trainer: Trainer,
        *,
        log: Callable[[dict[str, float]], None] | None = None,
        progress: bool = False,
        every: int = 50,
        checkpoint: Checkpoint | None = None,
        setup_seconds: float = 0.0,
    ) -> None:
        self.trainer, self.log, self.every, self.checkpoint = trainer, log, every, checkpoint
        self.progress = progress
        # Once: it digests the whole training set.
        self.identity = describe_run(trainer, every=every) if checkpoint else {}
        self.setup_seconds, self.done, self.seconds = setup_seconds, 0, 0.0
        self.history: list[dict[str, float]] = []
        self.recent: list[dict[str, float]] = []
        self._started = self._saved = time.perf_counter()

    @property
    def elapsed(self) -> float:
        """Time [s] of all steps so far."""
        return self.seconds + time.perf_counter() - self._started

    def run(self) -> TrainedModel:
        """Take all steps, from the last checkpoint on if there is one; return the model.

        Raises:
            TrainingError: when training diverges.
            TensorFileError: for a checkpoint of another run.
        """
        trainer = self.trainer
        self._resume()
        self._started = self._saved = time.perf_counter()
        with progress_bar(
            total=trainer.steps, initial=self.done, desc=f"train {trainer.kind}", unit="step",
            disable=not self.progress,
        ) as bar:  # fmt: skip
            while self.done < trainer.steps:
                self.recent.append(trainer.step(self.done))
                self.done += 1
                bar.update()
                self._between_steps(bar)
        return self.model()

    def _between_steps(self, bar: Any) -> None:
        last = self.done == self.trainer.steps
        if len(self.recent) == self.every or last:
            row = {"step": self.done, "seconds": self.elapsed}
            for name in self.recent[0]:
                row[name] = float(np.mean([step[name] for step in self.recent]))
            self.recent = []
            self.history.append(row)
            bar.set_postfix(loss=f"{row['loss']:.4g}", refresh=False)
            if self.log:
                self.log(row)
        checkpoint = self.checkpoint
        if checkpoint and not last and 0 < 60 * checkpoint.minutes < time.perf_counter() - self._saved:
            self._save(checkpoint)

    def _save(self, checkpoint: Checkpoint) -> None:
        tensors, facts = self.trainer.state()
        state = {
            "done": self.done,
            "seconds": self.elapsed,
            "history": self.history,
            "recent": self.recent,
            "trainer": facts,
        }
        checkpoint.write(self.identity, tensors, state)
        self._saved = time.perf_counter()

    def _resume(self) -> None:
        if self.checkpoint and (stored := self.checkpoint.read(self.identity)):
            tensors, state = stored
            self.trainer.resume(tensors, state["trainer"])
            self.done, self.seconds = state["done"], state["seconds"]
            self.history, self.recent = state["history"], state["recent"]

    def model(self) -> TrainedModel:
        """Return the model after the steps done so far."""
        trainer = self.trainer
        summary = {
            **trainer.guard.summary,
            "epochs": trainer.epoch,
            "training_frames": trainer.data.frames,
        }
        return TrainedModel(
            trainer.kind, trainer.network.cpu().eval(), trainer.recipe, seed=trainer.seed, steps=self.done,
            seconds=self.elapsed, setup_seconds=self.setup_seconds,
            history=self.history, summary=summary, unit=trainer.spec.unit, fps=1.0 / trainer.data.dt,
            triangles=digest_triangles(trainer.dressed.garment.faces),
        )  # fmt: skip


def train_network(
    model_kind: str,
    dressed: DressedBody,
    motions: Sequence[Motion],
    *,
    steps: int,
    seed: int,
    trajectories: Trajectories | None = None,
    recipe: Recipe | None = None,
    progress: bool = True,
    every: int = 50,
    device: str = "cpu",
    kernels: bool | None = None,
    checkpoint: Checkpoint | None = None,
) -> TrainedModel:
    """Train one network for a number of steps; on a CPU equal arguments give equal weights, bit for bit.

    Args:
        model_kind: one of snug.kinds.KINDS, which says whether energies or simulated vertices
            teach it.
        dressed: a garment on a body.
        motions: training motions, all of one frame rate.
        steps: number of updates.
        seed: of everything random.
        trajectories: for kinds that learn from a simulation, motion name -> simulated world vertices
            (T, V, 3) [m].
        recipe: options of network and training; None: those of the kind.
        progress: whether a bar is shown on standard error.
        every: steps between two rows of the history.
        device: `cpu` or `cuda`, for the whole step.
        kernels: closed forms in numba (the default on a CPU) or the definitions of the energies in torch
            (everywhere else).
        checkpoint: where checkpoints are written; the caller deletes it after storing the model.

    Raises:
        ValueError: TrainingError or TensorFileError among them, naming what is missing or diverged.

    >>> model = train_network("snug", dressed, motions, steps=2000, seed=0)  # doctest: +SKIP
    """
    start = time.perf_counter()
    gc.collect()  # an earlier training refers to itself, and holds gigabytes
    recipe = recipe or find_kind(model_kind).recipe
    on = find_device(device)
    trainer = (CapturedTrainer if on.type == "cuda" else Trainer)(
        model_kind, dressed, motions, steps=steps, seed=seed, recipe=recipe, trajectories=trajectories,
        device=on, kernels=kernels,
    )  # fmt: skip
    loop = TrainingLoop(
        trainer, progress=progress, every=every, checkpoint=checkpoint,
        setup_seconds=time.perf_counter() - start,
    )  # fmt: skip
    return loop.run()
