"""All steps of a training run, and what happens between them: log, checkpoints, validation, early stop."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from reference_sim.progress import progress_bar
from snug.networks.tensor_file import TensorFileError, read_tensors, write_tensors
from snug.networks.trained_model import TrainedModel
from snug.training.trainer import Trainer, part_of
from snug.training.validation import Validation, Validator

FORMAT = "snug-checkpoint-7"
Log = Callable[[dict[str, float]], None]


@dataclass(frozen=True, kw_only=True)
class Saving:
    """Where checkpoints go and how often: after `steps` steps or `minutes` minutes, 0 for never.

    resume: go on from the file, when there is one. key: what else a caller knows that the run depends on, as
    the version of the code: a checkpoint that has another key, or cannot be read, is then replaced. Whoever
    has written the finished model down calls `done`: until then the checkpoint is all there is. When a
    checkpoint is written changes no number, so minutes of a clock do no harm.
    """

    path: Path
    steps: int = 0
    minutes: float = 5.0
    resume: bool = False
    key: str = ""

    def done(self) -> None:
        """Delete the checkpoint, if there is one."""
        self.path.unlink(missing_ok=True)


class Interrupted(Exception):
    """Training was asked to stop, and has written where it was; the message says where."""


class TrainingRun:
    """One trainer taken through all its steps by `go`.

    log gets each row of the history, every `every` steps; progress: a bar on standard error; stop: asked
    after each step. setup_seconds: what making the trainer took; of that, the pretraining counts as training.
    """

    def __init__(
        self,
        trainer: Trainer,
        *,
        log: Log | None = None,
        progress: bool = False,
        every: int = 50,
        saving: Saving | None = None,
        validation: Validation | None = None,
        stop: Callable[[], bool] = lambda: False,
        setup_seconds: float = 0.0,
    ) -> None:
        self.trainer, self.log, self.every, self.saving, self.stop = trainer, log, every, saving, stop
        self.progress = progress and trainer.group.writes
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

    def go(self) -> TrainedModel:
        """Raises TrainingError when training diverges, TensorFileError for a checkpoint of another run, and
        Interrupted when asked to stop.
        """
        trainer = self.trainer
        if self.saving and self.saving.resume and self.saving.path.is_file():
            self._resume(self.saving)
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
        if self.validator and (self.done % self.validated_every == 0 or self.done == self.trainer.steps):
            self._validate(self.validator)
        if len(self.recent) == self.every or self.done == self.trainer.steps or self._out_of_patience():
            row = self._row()
            self.history.append(row)
            bar.set_postfix(loss=f"{row['loss']:.4g}", refresh=False)
            if self.log and self.trainer.group.writes:
                self.log(row)
        asked = self.trainer.group.agreed(float(self.stop())) > 0
        if asked or self._checkpoint_due():
            self._save()
        if asked:
            where = f", checkpoint {self.saving.path}" if self.saving else ", no checkpoint was asked for"
            raise Interrupted(f"stopped after step {self.done} of {self.trainer.steps}{where}")

    def _row(self) -> dict[str, float]:
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

    def _checkpoint_due(self) -> bool:
        saving, group = self.saving, self.trainer.group
        if saving is None or not group.writes or self.done == self.trainer.steps:
            return False
        if saving.steps and self.done % saving.steps == 0:
            return True
        return saving.minutes > 0 and time.perf_counter() - self._saved > 60 * saving.minutes

    def _save(self) -> None:
        if self.saving is None or not self.trainer.group.writes:
            return
        tensors, facts = self.trainer.state()
        tensors.update({f"best.{name}": tensor for name, tensor in self.best.items()})
        header = {
            "format": FORMAT,
            "key": self.saving.key,
            "of": self._identity(),
            "done": self.done,
            "seconds": self.seconds + time.perf_counter() - self._started,
            "history": self.history,
            "recent": self.recent,
            "validation": [self.best_value, self.best_step, self.last_value, self._validating],
            "trainer": facts,
        }
        write_tensors(self.saving.path, tensors, header)
        self._saved = time.perf_counter()

    def _identity(self) -> dict[str, Any]:
        """What must be the same for a run to be the same run."""
        trainer, digest = self.trainer, hashlib.sha256()
        taught = trainer.targets.fingerprint() if trainer.targets else _bytes(trainer.data.ahead)
        past = [_bytes(trainer.past.frames)] if trainer.past else []
        data, weights = trainer.data, trainer.dressed.weights(trainer.recipe.smoothing)
        held_out = [self.validator.data] if self.validator else []
        seen = [_bytes(part) for of in (data, *held_out) for part in (of.features, of.transforms, of.ahead)]
        body = trainer.dressed.body
        of_body = (body.template, body.faces, body.shape_directions, body.joint_directions)
        skin = [array.tobytes() for array in of_body]
        for part in (*seen, _bytes(data.rest), taught, _bytes(weights), *past, *skin):
            digest.update(part)
        digest.update(trainer.dressed.cloth.Dm_inverse.tobytes())
        return {
            "kind": trainer.kind,
            "recipe": trainer.recipe.as_dict() | {"terms": list(trainer.recipe.terms)},
            "seed": trainer.seed,
            "steps": trainer.steps,
            # Both change the order of sums, and so the last bits.
            "threads": torch.get_num_threads(),
            "processes": trainer.group.size,
            "vertices": trainer.dressed.vertices,
            "data": digest.hexdigest(),
            "material": asdict(trainer.dressed.cloth.material),
            "every": self.every,
            "validation": [
                self.validator.data.names if self.validator else [],
                self.validated_every,
                self.patience,
            ],
        }

    def _resume(self, saving: Saving) -> None:
        path = saving.path
        try:
            tensors, header = read_tensors(path)
        except TensorFileError:
            if saving.key:
                return
            raise
        if saving.key and header.get("key") != saving.key:
            return
        if header.get("format") != FORMAT:
            raise TensorFileError(f"{path}: no checkpoint of this version, give another name or delete it")
        mine, there = self._identity(), header.get("of")
        if not isinstance(there, dict):
            raise TensorFileError(f"{path}: broken checkpoint; delete it to start anew")
        for name, value in mine.items():
            if there.get(name) != value:
                named = (
                    f"{name} {there.get(name)} there, {value} here" if name in SHORT else f"another {name}"
                )
                raise TensorFileError(f"{path}: checkpoint of another run ({named}); delete it to start anew")
        try:
            self.trainer.resume(tensors, header["trainer"])
            device = self.trainer.device
            self.best = {name: tensor.to(device) for name, tensor in part_of(tensors, "best").items()}
            self.best_value, self.best_step, self.last_value, self._validating = header["validation"]
            self.done, self.seconds = header["done"], header["seconds"]
            self.history, self.recent = header["history"], header["recent"]
        except (KeyError, RuntimeError, TypeError, ValueError, AttributeError, IndexError) as error:
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
        )


def _bytes(tensor: Tensor) -> bytes:
    return tensor.cpu().numpy().tobytes()


SHORT = ("kind", "seed", "steps", "threads", "processes", "vertices", "every")  # worth naming in one line
