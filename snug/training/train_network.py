"""Train a network, or make an untrained one. The command is snug.train.

Between the steps of a training come its log, validation, early stop and checkpoints.
"""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import torch
from torch import Tensor

from reference_sim.command_line import progress_bar
from snug.body.skinning import skin, unskin_damped
from snug.kinds import find_kind
from snug.motion.motion import Motion
from snug.networks.dressed_body import DressedBody
from snug.networks.garment_network import make_network
from snug.networks.tensor_file import select_tensors
from snug.networks.trained_model import TrainedModel, digest_of_triangles
from snug.recipe import Recipe
from snug.training.captured_step import CapturedTrainer
from snug.training.checkpoint import Checkpoint, describe_run
from snug.training.device import find_device
from snug.training.optimisation_step import Trainer, start_network
from snug.training.simulated_data import Trajectories, relative_vertices, vertex_loss
from snug.training.training_set import TrainingSet
from snug.training.validation import Validation, Validator

DAMPING = 0.01  # of the offsets that fitted networks learn, see unskin_damped
PIECE = 256  # frames whose loss is taken at once


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
        validation: Validation | None = None,
        setup_seconds: float = 0.0,
    ) -> None:
        self.trainer, self.log, self.every, self.checkpoint = trainer, log, every, checkpoint
        self.progress = progress
        self.patience = validation.patience if validation else 0
        self.validator = Validator(trainer, validation) if validation else None
        self.validated_every = validation.every if validation else 0
        self.setup_seconds, self.done, self.seconds = setup_seconds, 0, 0.0
        self.history: list[dict[str, float]] = []
        self.recent: list[dict[str, float]] = []
        self.best: dict[str, Tensor] = {}
        self.best_value, self.best_step, self.last_value = float("inf"), 0, float("nan")
        self._started = self._saved = time.perf_counter()

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
            while self.done < trainer.steps and not self._out_of_patience():
                self.recent.append(trainer.step(self.done))
                self.done += 1
                bar.update()
                self._between_steps(bar)
        return self.model()

    def _between_steps(self, bar: Any) -> None:
        last = self.done == self.trainer.steps
        if self.validator and (self.done % self.validated_every == 0 or last):
            self._validate(self.validator)
        if len(self.recent) == self.every or last or self._out_of_patience():
            row = self._row()
            self.history.append(row)
            bar.set_postfix(loss=f"{row['loss']:.4g}", refresh=False)
            if self.log:
                self.log(row)
        checkpoint = self.checkpoint
        if checkpoint and not last and 0 < 60 * checkpoint.minutes < time.perf_counter() - self._saved:
            self._save(checkpoint)

    def _row(self) -> dict[str, float]:
        """Return the row of the history over the recent steps, and begin the next."""
        row = {"step": self.done, "seconds": self.seconds + time.perf_counter() - self._started}
        row |= {name: float(np.mean([r[name] for r in self.recent])) for name in self.recent[0]}
        if not np.isnan(self.last_value):
            row["validation"], self.last_value = self.last_value, float("nan")
        self.recent = []
        return row

    def _validate(self, validator: Validator) -> None:
        self.last_value = validator.value()
        if self.last_value < self.best_value:
            self.best_value, self.best_step = self.last_value, self.done
            weights = self.trainer.network.state_dict()
            self.best = {name: tensor.clone() for name, tensor in weights.items()}

    def _out_of_patience(self) -> bool:
        waited = self.done - self.best_step
        return self.patience > 0 and waited >= self.patience * self.validated_every

    def _identity(self) -> dict[str, Any]:
        names = self.validator.data.names if self.validator else []
        watched = [names, self.validated_every, self.patience]
        return describe_run(self.trainer, self.validator, every=self.every, validation=watched)

    def _save(self, checkpoint: Checkpoint) -> None:
        tensors, facts = self.trainer.state()
        tensors.update({f"best.{name}": tensor for name, tensor in self.best.items()})
        state = {
            "done": self.done,
            "seconds": self.seconds + time.perf_counter() - self._started,
            "history": self.history,
            "recent": self.recent,
            "validation": [self.best_value, self.best_step, self.last_value],
            "trainer": facts,
        }
        checkpoint.write(self._identity(), tensors, state)
        self._saved = time.perf_counter()

    def _resume(self) -> None:
        if self.checkpoint is None or (stored := self.checkpoint.read(self._identity())) is None:
            return
        (tensors, state), device = stored, self.trainer.device
        self.trainer.resume(tensors, state["trainer"])
        self.best = {name: tensor.to(device) for name, tensor in select_tensors(tensors, "best").items()}
        self.best_value, self.best_step, self.last_value = state["validation"]
        self.done, self.seconds = state["done"], state["seconds"]
        self.history, self.recent = state["history"], state["recent"]

    def model(self) -> TrainedModel:
        """Return the model after the steps done so far, with the best weights if it was validated."""
        trainer = self.trainer
        summary = {
            **trainer.guard.summary,
            "epochs": trainer.epoch,
            "training_frames": trainer.data.frames,
        }
        if self.validator:
            if self.best:
                trainer.network.load_state_dict(self.best)
            summary["validation"] = {"motions": self.validator.data.names, "best": self.best_value,
                                     "best_step": self.best_step, "stopped_at": self.done}  # fmt: skip
        return TrainedModel(
            trainer.kind, trainer.network.cpu().eval(), trainer.recipe, seed=trainer.seed, steps=self.done,
            seconds=self.seconds + time.perf_counter() - self._started, setup_seconds=self.setup_seconds,
            history=self.history, summary=summary, unit=trainer.how.unit, fps=1.0 / trainer.data.dt,
            triangles=digest_of_triangles(trainer.dressed.garment.faces),
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
    log: Callable[[dict[str, float]], None] | None = None,
    progress: bool = True,
    every: int = 50,
    device: str = "cpu",
    kernels: bool | None = None,
    checkpoint: Checkpoint | None = None,
    validation: Validation | None = None,
) -> TrainedModel:
    """Train one network for a number of steps; on a CPU equal arguments give equal weights, bit for bit.

    Kinds that are fitted in one go (snug.networks.fitted) take no steps: of all that concerns steps,
    nothing is used.

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
        log: called with each row of the history, every `every` steps.
        progress: whether a bar is shown on standard error.
        every: steps between two rows of the history.
        device: `cpu` or `cuda`, for the whole step.
        kernels: closed forms in numba (the default on a CPU) or the definitions of the energies in torch
            (everywhere else).
        checkpoint: where checkpoints are written; the caller deletes it after storing the model.
        validation: held-out motions; the weights that do best on them are kept.

    Raises:
        ValueError: TrainingError, RecipeError, DeviceError or TensorFileError, naming what is
            missing or diverged.

    >>> model = train_network("snug", dressed, motions, steps=2000, seed=0)  # doctest: +SKIP
    """
    start = time.perf_counter()
    gc.collect()  # an earlier training refers to itself, and holds gigabytes
    recipe = recipe or find_kind(model_kind).recipe
    if find_kind(model_kind).fitted:
        return _fitted_model(model_kind, dressed, motions, trajectories, seed=seed, recipe=recipe)
    on = find_device(device)
    trainer = (CapturedTrainer if on.type == "cuda" else Trainer)(
        model_kind, dressed, motions, steps=steps, seed=seed, recipe=recipe, trajectories=trajectories,
        device=on, kernels=kernels,
    )  # fmt: skip
    loop = TrainingLoop(
        trainer, log=log, progress=progress, every=every, checkpoint=checkpoint, validation=validation,
        setup_seconds=time.perf_counter() - start,
    )  # fmt: skip
    return loop.run()


def _fitted_model(
    model_kind: str, dressed: DressedBody, motions: Sequence[Motion], trajectories: Trajectories | None, *,
    seed: int, recipe: Recipe,
) -> TrainedModel:  # fmt: skip
    """Fit a network to the offsets of simulated frames; its loss is that of the posed vertices."""
    begun = time.perf_counter()
    kind = find_kind(model_kind)
    kind.check(recipe)
    data = TrainingSet(dressed, motions, recipe, features=kind.network.feature_set, sequences=False)
    vertices = relative_vertices(dressed, motions, trajectories)
    weights = dressed.weights(recipe.smoothing)
    pins = dressed.garment.pins
    network = make_network(
        model_kind, data.features.shape[1], dressed.vertices, recipe, seed=seed, pins=pins
    )
    ready = time.perf_counter()
    network.learn(data.features, unskin_damped(vertices, data.rest, weights, data.transforms, DAMPING))
    seconds = time.perf_counter() - ready
    loss = 0.0
    with torch.no_grad():
        for rows in torch.arange(data.frames).split(PIECE):
            posed = skin(
                network(data.features[rows, None])[0][:, 0] + data.rest, weights, data.transforms[rows]
            )
            loss += float(vertex_loss(posed, vertices[rows]).sum()) / data.frames
    return TrainedModel(
        model_kind, network.eval(), recipe, seed=seed, steps=1, seconds=seconds, setup_seconds=ready - begun,
        history=[{"step": 1, "seconds": seconds, "loss": loss}],
        summary={"training_frames": data.frames}, unit=kind.unit, fps=1.0 / data.dt,
        triangles=digest_of_triangles(dressed.garment.faces),
    )  # fmt: skip


def untrained_model(
    model_kind: str,
    dressed: DressedBody,
    motions: Sequence[Motion],
    *,
    seed: int,
    recipe: Recipe | None = None,
) -> TrainedModel:
    """Return a network before any step, a row of the benchmark's tables.

    The default recipe starts at a zero last layer, where the untrained network is skinning alone. So this
    one keeps the random last layer of the recipe's rules: the answer of a network that has learned
    nothing. Input statistics are those of the training motions. Without a recipe it is the kind's.
    """
    kind = find_kind(model_kind)
    recipe = replace(recipe or kind.recipe, zero_last_layer=False)
    data = TrainingSet(
        dressed, motions, recipe, features=kind.network.feature_set, sequences=kind.network.sequential
    )
    network = start_network(model_kind, data, seed=seed)
    return TrainedModel(
        model_kind, network.eval(), recipe, seed=seed, unit=kind.unit, fps=1.0 / data.dt,
        triangles=digest_of_triangles(dressed.garment.faces),
    )  # fmt: skip
