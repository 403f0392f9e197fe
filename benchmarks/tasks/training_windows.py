"""Does a network do in a whole roll-out what it was trained to do in windows of three frames?

A window starts from noise, added to what the window before left behind where the recipe remembers that (such
windows are close to a roll-out by the way they are trained); a roll-out carries one state from the first
frame of a motion on. Windows of every training motion are predicted both ways, and the training's own loss
judges both: the same frames and terms (a window of three has one inertia), contact searched anew for every
frame.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from benchmarks.method import MethodEntry
from benchmarks.process.errors import one_line
from benchmarks.registry import load
from benchmarks.results.run_folder import Row
from benchmarks.tasks.task import Context, Outcome, Task, TaskId
from benchmarks.tasks.training import TrainNetwork
from snug.recipes.recipe import DEFAULT

if TYPE_CHECKING:
    from torch import Tensor

    from snug.networks.dressed_body import DressedBody
    from snug.networks.trained_model import TrainedModel
    from snug.training.training_set import Batch

SUITE, SCENE = "garments", "training"
STRIDE = 18  # frames from one window that is looked at to the next: the searches for contact take the time


@dataclass(frozen=True, kw_only=True, eq=False)
class CompareWindows(Task):
    """Metrics train/* of a network that has a past and learned from the energies alone."""

    kind = "windows"
    stage = "training windows"
    unit_seconds = 3.0
    training: TrainNetwork
    entry: MethodEntry

    def run(self, context: Context, needed: Mapping[TaskId, Outcome]) -> Outcome:
        from snug.networks.dressed_body import DressedBody
        from snug.networks.trained_model import TrainedModel, find_kind
        from snug.training.training_set import TrainingError

        training, assets = self.training, context.assets
        assert assets is not None
        if training.home:
            load(training.home)
        model = TrainedModel.load(training.path(context.folder))
        how = find_kind(model.kind)
        context.tell(self.units)
        if not (model.steps and how.physics and how.sequences):
            return Outcome()
        dressed = DressedBody(assets.body, assets.garments[training.garment])
        try:
            window, roll_out = both_losses(model, dressed, assets.named(training.motions))
        except TrainingError as error:  # no given motion has as many frames as a window of this one
            return Outcome(result={"train/window": None}, reason=one_line(error))
        found = {
            "train/window": window,
            "train/roll_out": roll_out,
            "train/step": 1e3 * model.seconds / model.steps,
        }
        if model.recipe.spike == DEFAULT.spike:  # what is called high elsewhere is something else
            found["train/high_windows"] = float(model.summary["high_windows"])
        return Outcome(result=found)

    def rows(self, outcome: Outcome) -> list[Row]:
        """One for each metric; one that failed, or of which there was nothing to compare, says why."""
        if outcome.failed:
            return [self._row("train/window", None, outcome.status, outcome.reason)]
        return [self._row(name, value, "skipped", outcome.reason) for name, value in outcome.result.items()]

    def _row(self, metric: str, value: float | None, status: str, reason: str) -> Row:
        training, entry = self.training, self.entry
        if value is not None:
            finite = math.isfinite(value)
            status, reason = ("ok", "") if finite else ("diverged", f"its mean is {value}")
            value = value if finite else None
        return Row(
            suite=SUITE, scene=SCENE, method=entry.name, seed=training.seed, metric=metric,
            unit="", value=value, status=status, reason=reason, dtype=entry.dtype,
            garment=training.garment, family=entry.family or entry.name, role=entry.role, base=entry.base,
            seeded=entry.seeded, pairing_group=entry.pairing_group,
        )  # fmt: skip


def both_losses(model: TrainedModel, dressed: DressedBody, motions: Sequence[Any]) -> tuple[float, float]:
    """Mean loss of windows as training starts them, and of the same frames of roll-outs [J per frame]."""
    import numpy as np
    import torch

    from snug.body.skinning import skin
    from snug.training.trainer import Trainer

    # Mixed motions, and bodies of other shapes, are no motions that were given.
    window = model.recipe.window
    recipe = replace(model.recipe, mixed=0.0, window_stride=window, shape_range=0.0)
    trainer = Trainer(model.kind, dressed, motions, steps=1, seed=model.seed, recipe=recipe)
    trainer.network = model.network
    data = trainer.data
    with torch.no_grad():
        chosen = np.arange(0, len(data.starts), max(1, STRIDE // window))
        batch = data.batch(chosen, None)
        offsets = torch.cat([_offsets(trainer, number) for number in range(len(data.starts))])[chosen]
        windows = skin(batch.rest + offsets, trainer.weights, batch.transforms)
        whole = []
        for first, end in zip(data.first[:-1], data.first[1:]):
            offsets, _ = model.network(data.features[None, first:end], None)
            whole.append(skin(data.rest + offsets[0], trainer.weights, data.transforms[first:end]))
        roll_outs = torch.cat(whole)[torch.as_tensor(batch.frames)]
        return _loss(trainer, batch, windows), _loss(trainer, batch, roll_outs)


def _offsets(trainer: Any, number: int) -> Tensor:
    """Offsets (1, T, V, 3) [m] of one window, after which the next one begins."""
    import numpy as np

    batch = trainer.data.batch(np.array([number]), None)
    offsets, state = trainer.network(batch.features, trainer.start_state(1, slice(None), batch))
    if trainer.hidden_states:
        trainer.hidden_states.keep(batch.frames[:, -1], state)
    return offsets


def _loss(trainer: Any, batch: Batch, x: Tensor) -> float:
    """Mean of the loss over windows x (N, T, V, 3) [m], with contact searched at x [J per frame]."""
    import numpy as np
    import torch

    if not torch.isfinite(x).all():
        return math.nan  # such vertices have no closest points
    planes = None
    if trainer.contact:
        posed = trainer.contact.posed(batch)
        everywhere = np.arange(batch.frames.size)
        trainer.contact.search(everywhere, batch.frames, posed, x, exact=True)
        planes = trainer.contact.planes(batch, posed)
    terms = trainer.loss(x, batch.ahead, planes)
    return float(torch.stack(list(terms.values())).sum(0).mean())
