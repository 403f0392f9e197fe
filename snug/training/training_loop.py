"""The loop over all steps of a training run: log, validation, early stop and checkpoints between steps."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
from torch import Tensor

from reference_sim.command_line import progress_bar
from snug.networks.tensor_file import TensorFileError, select_tensors
from snug.networks.trained_model import TrainedModel, digest_of_triangles
from snug.training.checkpoint import Checkpoint, describe_run
from snug.training.optimisation_step import Trainer
from snug.training.validation import Validation, Validator

Log = Callable[[dict[str, float]], None]


class TrainingLoop:
    """One trainer taken through all its steps by `run`.

    Args:
        trainer: takes one optimisation step at a time.
        log: gets each row of the history, every `every` steps.
        progress: whether a bar is shown on standard error.
        every: steps between two rows of the history.
        checkpoint: file and times of checkpoints; None writes none.
        validation: held-out motions; None validates with none.
        setup_seconds: time [s] that making the trainer took; its pretraining counts as training.
    """

    def __init__(
        self,
        trainer: Trainer,
        *,
        log: Log | None = None,
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
        self.setup_seconds = setup_seconds - trainer.pretraining_seconds
        self.done, self.seconds = 0, trainer.pretraining_seconds
        self.history: list[dict[str, float]] = []
        self.recent: list[dict[str, float]] = []
        self.best: dict[str, Tensor] = {}
        self.best_value, self.best_step, self.last_value = float("inf"), 0, float("nan")
        self._validating = 0.0
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
        return self._finished()

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
        if self.checkpoint and not last and self.checkpoint.is_due(time.perf_counter() - self._saved):
            self._save(self.checkpoint)

    def _row(self) -> dict[str, float]:
        """Return the row of the history over the recent steps, and begin the next."""
        row = {"step": self.done, "seconds": self.seconds + time.perf_counter() - self._started}
        row |= {name: float(np.mean([r[name] for r in self.recent])) for name in self.recent[0]}
        if not np.isnan(self.last_value):
            row["validation"], self.last_value = self.last_value, float("nan")
        row |= {f"seconds/{part}": taken for part, taken in self.trainer.clock.taken().items()}
        if self._validating:
            row["seconds/validation"] = self._validating / len(self.recent)
        self.recent, self._validating = [], 0.0
        return row

    def _validate(self, validator: Validator) -> None:
        clock = time.perf_counter()
        self.last_value = validator.value()
        self._validating += time.perf_counter() - clock
        if self.last_value < self.best_value:
            self.best_value, self.best_step = self.last_value, self.done
            weights = self.trainer.network.state_dict()
            self.best = {name: tensor.clone() for name, tensor in weights.items()}

    def _out_of_patience(self) -> bool:
        waited = self.done - self.best_step
        return self.patience > 0 and waited >= self.patience * self.validated_every

    def _identity(self) -> dict[str, Any]:
        names = self.validator.data.names if self.validator else []
        return describe_run(
            self.trainer, self.validator, every=self.every,
            validation=[names, self.validated_every, self.patience],
        )  # fmt: skip

    def _save(self, checkpoint: Checkpoint) -> None:
        tensors, facts = self.trainer.state()
        tensors.update({f"best.{name}": tensor for name, tensor in self.best.items()})
        state = {
            "done": self.done,
            "seconds": self.seconds + time.perf_counter() - self._started,
            "history": self.history,
            "recent": self.recent,
            "validation": [self.best_value, self.best_step, self.last_value, self._validating],
            "trainer": facts,
        }
        checkpoint.write(self._identity(), tensors, state)
        self._saved = time.perf_counter()

    def _resume(self) -> None:
        if self.checkpoint is None or not self.checkpoint.resumable:
            return
        if (stored := self.checkpoint.read(self._identity())) is None:
            return
        tensors, state = stored
        try:
            self.trainer.resume(tensors, state["trainer"])
            device = self.trainer.device
            self.best = {name: tensor.to(device) for name, tensor in select_tensors(tensors, "best").items()}
            self.best_value, self.best_step, self.last_value, self._validating = state["validation"]
            self.done, self.seconds = state["done"], state["seconds"]
            self.history, self.recent = state["history"], state["recent"]
        except (KeyError, RuntimeError, TypeError, ValueError, AttributeError, IndexError) as error:
            path = self.checkpoint.path
            raise TensorFileError(f"{path}: broken checkpoint ({error}); delete it to start anew") from error

    def _finished(self) -> TrainedModel:
        trainer = self.trainer
        summary = {**trainer.guard.summary, "epochs": trainer.epoch, "training_frames": trainer.data.frames}
        if self.validator:
            if self.best:
                trainer.network.load_state_dict(self.best)
            summary["validation"] = {"motions": self.validator.data.names, "best": self.best_value,
                                     "best_step": self.best_step, "stopped_at": self.done}  # fmt: skip
        return TrainedModel(
            trainer.kind,
            trainer.network.cpu().eval(),
            trainer.recipe,
            seed=trainer.seed,
            steps=self.done,
            seconds=self.seconds + time.perf_counter() - self._started,
            setup_seconds=self.setup_seconds,
            history=self.history,
            summary=summary,
            unit=trainer.how.unit,
            fps=1.0 / trainer.data.dt,
            triangles=digest_of_triangles(trainer.dressed.garment.faces),
        )
