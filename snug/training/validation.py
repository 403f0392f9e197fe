"""Validation on motions held out of training: full roll-outs from a state of zero.

Windows see three frames at a time; a user sees roll-outs. So held-out motions are rolled out whole, and
their mean energy a frame is the value that early stopping watches. Contact anchors are searched anew at
every validation: those of an earlier one claim contacts that are none, by up to a fifth of the value, and
the first validation, which has none, would look best. Nothing is random.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import torch
from torch import Tensor

from snug.body.skinning import skin
from snug.motion.motion import Motion
from snug.training.simulated_data import TARGETS
from snug.training.training_set import Batch, TrainingError, TrainingSet

if TYPE_CHECKING:
    from snug.training.optimisation_step import Trainer
    from snug.training.simulated_data import Trajectories


@dataclass(frozen=True, kw_only=True)
class Validation:
    """When to validate, every so many steps, and with which motions: none of training, none of the tests.

    Training stops after `patience` validations without a better value, with 0 never.
    """

    motions: Sequence[Motion]
    every: int = 200
    patience: int = 10
    trajectories: Trajectories | None = None


class Validator:
    """The validation of one trainer's network. Raises TrainingError for motions that do not fit it."""

    def __init__(self, trainer: Trainer, validation: Validation) -> None:
        names = {motion.name for motion in validation.motions} & set(trainer.data.names)
        if names:
            raise TrainingError(
                f"motion {sorted(names)[0]!r} cannot both train and validate: leave it out"
            )
        if validation.every < 1 or validation.patience < 0:
            raise TrainingError("validation needs every >= 1 step and patience >= 0")
        self.trainer = trainer
        how, motions = trainer.how, validation.motions
        self.data = TrainingSet(
            trainer.dressed, motions, trainer.recipe, features=how.network.feature_set,
            sequences=how.network.sequential, device=trainer.device,
        )  # fmt: skip
        if self.data.dt != trainer.data.dt:
            validating, training = 1 / self.data.dt, 1 / trainer.data.dt
            raise TrainingError(
                f"validation has {validating:g} frames a second, training {training:g}: resample them"
            )
        self.contact = trainer.contact_of(self.data)
        self.targets = None
        if not how.physics:
            self.targets = TARGETS[how.targets](
                self.data, motions, validation.trajectories, trainer.weights
            )

    @torch.no_grad()
    def value(self) -> float:
        """Return the loss, mean over all frames, in the unit of the kind."""
        total = 0.0
        for first, end in zip(self.data.first[:-1], self.data.first[1:]):
            # One long window, or, for a static network, windows of one frame: it has no inertia.
            rows = np.arange(first, end).reshape(
                (1, -1) if self.trainer.how.network.sequential else (-1, 1)
            )
            terms = self.trainer.weighed(self._terms(self.data.at(rows)))
            total += float(torch.stack(list(terms.values())).sum())
        return total / self.data.frames

    def _terms(self, batch: Batch) -> dict[str, Tensor]:
        trainer = self.trainer
        if trainer.loss is None:
            assert self.targets is not None
            return self.targets.terms(trainer.network, batch, None)
        offsets, _ = trainer.network(batch.features, None)
        x = skin(batch.rest + offsets, trainer.weights, batch.transforms)
        planes = None
        if self.contact:
            posed = self.contact.bodies.posed(batch)
            self.contact.search(np.arange(batch.frames.size), batch.frames, posed, x, exact=True)
            planes = self.contact.planes(batch, posed)
        elif trainer.nearest:
            planes = trainer.nearest.planes(batch, x)
        distances = self.targets.distances(x, batch) if self.targets else {}
        return distances | trainer.loss(x, batch.ahead, planes, behind=batch.behind)
