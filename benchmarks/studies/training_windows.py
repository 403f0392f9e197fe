"""Does a network do in a whole roll-out what it was trained to do in windows of three frames?

A window starts from noise, added to what the window before left behind where the recipe remembers that (such
windows are close to a roll-out by the way they are trained); a roll-out carries one state from the first
frame of a motion on. Windows of every training motion are predicted both ways, and the training's own loss
judges both: the same frames and terms (a window of three has one inertia), contact searched anew for every
frame.

    train/window, train/roll_out   mean J per frame
    train/high_windows             windows above the recipe's limit once the training had settled
    train/step                     ms of one training step
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from snug.recipe import DEFAULT

from ..methods.networks import model_path
from ..results import Row, RunFolder
from .long_roll_outs import SUITE

if TYPE_CHECKING:
    from torch import Tensor

    from snug.dressed_body import DressedBody
    from snug.trained_model import TrainedModel
    from snug.training_set import Batch

    from ..plan import Plan
    from ..wardrobe import Wardrobe

SCENE = "training"
STRIDE = 18  # frames from one window that is looked at to the next: the searches for contact take the time


def rows(plan: Plan, folder: RunFolder, wardrobe: Wardrobe | None) -> list[Row]:
    """Those of every network of the run that has a past and learned from the energies alone."""
    from snug.dressed_body import DressedBody
    from snug.trained_model import TrainedModel, find_kind
    from snug.training_set import TrainingError

    if wardrobe is None or not plan.models:
        return []  # no network of the run: its training motions were not even loaded
    dressed, motions = DressedBody(wardrobe.body, wardrobe.garment), wardrobe.named(plan.train)
    found: list[Row] = []
    for name, seed in plan.models:
        path = model_path(folder.models, name, seed)
        if not path.is_file():
            continue  # its training has failed, and the run says so
        model = TrainedModel.load(path)
        how = find_kind(model.kind)
        if model.steps and how.physics and how.sequences and how.supervision is None:
            try:
                found += _judged(name, seed, model, dressed, motions)
            except TrainingError as error:  # no given motion has as many frames as a window of this one
                reason = " ".join(str(error).split())
                found.append(Row(SUITE, SCENE, name, seed, "train/window", "J", None, "skipped", reason))
    return found


def _judged(
    name: str, seed: int, model: TrainedModel, dressed: DressedBody, motions: Sequence[Any]
) -> Iterator[Row]:
    window, roll_out = both_losses(model, dressed, motions)
    numbers = {
        "train/window": (window, "J"),
        "train/roll_out": (roll_out, "J"),
        "train/step": (1e3 * model.seconds / model.steps, "ms"),
    }
    if model.recipe.spike == DEFAULT.spike:  # what is called high elsewhere is something else
        numbers["train/high_windows"] = (float(model.summary["high_windows"]), "1")
    for metric, (number, unit) in numbers.items():
        if math.isfinite(number):
            yield Row(SUITE, SCENE, name, seed, metric, unit, number, dtype="float32")
        else:
            reason = f"its mean is {number}"
            yield Row(SUITE, SCENE, name, seed, metric, unit, None, "diverged", reason, dtype="float32")


def both_losses(model: TrainedModel, dressed: DressedBody, motions: Sequence[Any]) -> tuple[float, float]:
    """Mean loss of windows as training starts them, and of the same frames of roll-outs [J per frame]."""
    import numpy as np
    import torch

    from snug.skinning import skin
    from snug.trainer import Trainer

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
