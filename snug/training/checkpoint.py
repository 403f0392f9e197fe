"""Checkpoints: a file from which a stopped training run resumes with the bits of an unbroken one."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from snug.networks.tensor_file import TensorFileError, read_tensors, write_tensors
from snug.training.optimisation_step import Trainer
from snug.training.validation import Validator

CHECKPOINT_FORMAT = "snug-checkpoint-8"
# Facts of a run that are short enough to be named in a message.
NAMED_FACTS = ("kind", "seed", "steps", "threads", "vertices", "every")


@dataclass(frozen=True, kw_only=True)
class Checkpoint:
    """File of a run's checkpoints, and how often one is written.

    When a checkpoint is written changes no number, so minutes of a clock do no harm. The file stays until
    `delete`: until the caller has written the finished model, the checkpoint is all there is.

    Attributes:
        path: the file.
        minutes: after so many minutes; 0 for never.
        resume: continue from the file, if there is one.
        key: further facts that the run depends on, as the version of the code. A checkpoint that has another
            key, or cannot be read, is then replaced; without a key it is refused.
    """

    path: Path
    minutes: float = 5.0
    resume: bool = False
    key: str = ""

    def delete(self) -> None:
        """Delete the file, if there is one."""
        self.path.unlink(missing_ok=True)

    @property
    def resumable(self) -> bool:
        """True if there is a file to continue from, and that is wanted."""
        return self.resume and self.path.is_file()

    def is_due(self, seconds: float) -> bool:
        """Return whether to write one `seconds` [s] after the last."""
        return 0 < 60 * self.minutes < seconds

    def write(
        self, identity: Mapping[str, Any], tensors: Mapping[str, Tensor], state: Mapping[str, Any]
    ) -> None:
        """Write tensors and state of the run of that identity, whole or not at all."""
        header = {"format": CHECKPOINT_FORMAT, "key": self.key, "of": identity, **state}
        write_tensors(self.path, tensors, header)

    def read(self, identity: Mapping[str, Any]) -> tuple[dict[str, Tensor], dict[str, Any]] | None:
        """Return tensors and state of the run of that identity; None for a file that is to be replaced.

        Raises:
            TensorFileError: for a file of another run or format, or one that cannot be read.
        """
        try:
            tensors, header = read_tensors(self.path)
        except TensorFileError:
            if self.key:
                return None
            raise
        if self.key and header.get("key") != self.key:
            return None
        if header.get("format") != CHECKPOINT_FORMAT:
            raise TensorFileError(
                f"{self.path}: no checkpoint of this version, give another name or delete it"
            )
        stored = header.get("of")
        if not isinstance(stored, dict):
            raise TensorFileError(f"{self.path}: broken checkpoint; delete it to start anew")
        for name, value in identity.items():
            if stored.get(name) != value:
                differing = f"another {name}"
                if name in NAMED_FACTS:
                    differing = f"{name} {stored.get(name)} there, {value} here"
                raise TensorFileError(
                    f"{self.path}: checkpoint of another run ({differing}); delete it to start anew"
                )
        return tensors, header


def describe_run(trainer: Trainer, validator: Validator | None, **facts: Any) -> dict[str, Any]:
    """Return the facts that must be equal for two runs to be the same run."""
    digest = hashlib.sha256()
    targets = _bytes(trainer.targets.vertices if trainer.targets else trainer.data.ahead)
    data, weights = trainer.data, trainer.dressed.weights(trainer.recipe.smoothing)
    sets = [data, validator.data] if validator else [data]
    seen = [_bytes(part) for of in sets for part in (of.features, of.transforms, of.ahead)]
    body = trainer.dressed.body
    shape = (body.template, body.faces, body.shape_directions, body.joint_directions)
    arrays = [array.tobytes() for array in shape]
    for part in (*seen, _bytes(data.rest), targets, _bytes(weights), *arrays):
        digest.update(part)
    digest.update(trainer.dressed.cloth.Dm_inverse.tobytes())
    return {
        "kind": trainer.kind,
        "recipe": trainer.recipe.as_dict() | {"terms": list(trainer.recipe.terms)},
        "seed": trainer.seed,
        "steps": trainer.steps,
        # They change the order of sums, and so the last bits.
        "threads": torch.get_num_threads(),
        "vertices": trainer.dressed.vertices,
        "data": digest.hexdigest(),
        "material": asdict(trainer.dressed.cloth.material),
        **facts,
    }


def _bytes(tensor: Tensor) -> bytes:
    return tensor.cpu().numpy().tobytes()
