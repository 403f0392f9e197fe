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
from snug.training.simulated_data import settings_of

CHECKPOINT_FORMAT = "snug-checkpoint-9"


@dataclass(frozen=True, kw_only=True)
class Checkpoint:
    """File of a run's checkpoints, and how often one is written.

    Attributes:
        path: the file.
        minutes: after so many minutes; 0 for never.
        resume: continue from the file, if there is one.
        key: further facts that the run depends on, as the version of the code. A checkpoint that has
            another key, or cannot be read, is then replaced; without a key it is refused.
    """

    path: Path
    minutes: float = 5.0
    resume: bool = False
    key: str = ""

    def delete(self) -> None:
        """Delete the file, if there is one."""
        self.path.unlink(missing_ok=True)

    def write(
        self, identity: Mapping[str, Any], tensors: Mapping[str, Tensor], state: Mapping[str, Any]
    ) -> None:
        """Write tensors and state of the run of that identity, whole or not at all."""
        header = {"format": CHECKPOINT_FORMAT, "key": self.key, "of": identity, **state}
        write_tensors(self.path, tensors, header)

    def read(self, identity: Mapping[str, Any]) -> tuple[dict[str, Tensor], dict[str, Any]] | None:
        """Return tensors and state of the run of that identity; None where there is nothing to go on from.

        Raises:
            TensorFileError: for a file of another run or format, or one that cannot be read.
        """
        if not (self.resume and self.path.is_file()):
            return None
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
        for name, value in identity.items():
            if not isinstance(stored, dict) or stored.get(name) != value:
                raise TensorFileError(
                    f"{self.path}: checkpoint of another run (another {name}); delete it to start anew"
                )
        return tensors, header


def describe_run(trainer: Trainer, **facts: Any) -> dict[str, Any]:
    """Return the facts that must be equal for two runs to be the same run."""
    digest, data = hashlib.sha256(), trainer.data
    tensors = [data.features, data.transforms, data.lead, data.rest, trainer.weights]
    tensors += [trainer.targets.vertices] if trainer.targets else []
    body, garment = trainer.dressed.body, trainer.dressed.garment
    for array in (
        *(tensor.cpu().numpy() for tensor in tensors),
        body.shape_directions,
        body.joint_directions,
    ):
        digest.update(array.tobytes())
    return {
        "kind": trainer.kind,
        "recipe": asdict(trainer.recipe) | {"terms": list(trainer.recipe.terms)},
        "seed": trainer.seed,
        "steps": trainer.steps,
        # These change the order of sums, and so the last bits.
        "threads": torch.get_num_threads(),
        "device": trainer.device.type,
        "kernels": trainer.kernels,
        "data": digest.hexdigest(),
        **settings_of(body, garment),
        **facts,
    }
