"""Training of SNUG and of the networks beside it; the command is snug.train."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

from snug.recipes.recipe import DEFAULT, Recipe

if TYPE_CHECKING:
    from snug.motion.motion import Motion
    from snug.networks.dressed_body import DressedBody
    from snug.networks.trained_model import TrainedModel
    from snug.training.process_group import Group
    from snug.training.run import Saving
    from snug.training.validation import Validation
    from snug.training.vertex_targets import Targets


def train(
    model_kind: str,
    dressed: DressedBody,
    motions: Sequence[Motion],
    *,
    steps: int,
    seed: int,
    trajectories: Mapping[str, Targets] | None = None,
    recipe: Recipe = DEFAULT,
    log: Callable[[dict[str, float]], None] | None = None,
    progress: bool = True,
    every: int = 50,
    device: str = "cpu",
    kernels: bool | None = None,
    saving: Saving | None = None,
    validation: Validation | None = None,
    group: Group | None = None,
    stop: Callable[[], bool] = lambda: False,
) -> TrainedModel:
    """Train one network for a number of steps; on a CPU equal arguments give equal weights, bit for bit.

    model_kind: one of snug.networks.trained_model.KINDS; `snug` and `pbns` learn from the energies, the others from a
    simulation. trajectories: for those, motion name -> simulated world vertices (T, V, 3) [m].
    log: called with each row of the history, every `every` steps. progress: a bar on standard error.
    device: `cpu` or `cuda`, for the whole step. kernels: closed forms in numba (the default on a CPU) or the
    definitions of the energies in torch (everywhere else).
    saving: checkpoints; a run resumed from one ends, on a CPU, with the bits of an unbroken run. The last one
    is there until the caller, who has the model by then, says saving.done().
    validation: held-out motions; the weights that do best on them are kept.
    group: processes of torchrun that share the batch. stop: asked after each step; True writes a checkpoint
    and raises snug.training.run.Interrupted.
    Raises ValueError (TrainingError, TargetError, RecipeError, DeviceError, TensorFileError) naming what is
    missing or diverged.
    """
    from snug.training.device import find_device
    from snug.training.process_group import ALONE
    from snug.training.run import TrainingRun
    from snug.training.trainer import Trainer

    start = time.perf_counter()
    trainer = Trainer(
        model_kind, dressed, motions, steps=steps, seed=seed, recipe=recipe, trajectories=trajectories,
        device=find_device(device), kernels=kernels, group=group or ALONE,
    )  # fmt: skip
    run = TrainingRun(
        trainer, log=log, progress=progress, every=every, saving=saving, validation=validation, stop=stop,
        setup_seconds=time.perf_counter() - start,
    )  # fmt: skip
    return run.go()


def untrained_model(
    model_kind: str, dressed: DressedBody, motions: Sequence[Motion], *, seed: int, recipe: Recipe = DEFAULT
) -> TrainedModel:
    """The network before any step, as a row of a table.

    The default recipe starts at a zero last layer, where the untrained network is skinning alone. So this one
    keeps PyTorch's own random last layer: it is what a network that has learned nothing really gives. Input
    statistics are those of the training motions.
    """
    from dataclasses import replace

    from snug.networks.trained_model import TrainedModel, find_kind, make_network
    from snug.training.training_set import TrainingSet

    how = find_kind(model_kind)
    recipe = replace(recipe, zero_last_layer=False)
    data = TrainingSet(dressed, motions, recipe, features=how.features, sequences=how.sequences)
    pins = dressed.garment.pins
    network = make_network(model_kind, data.features.shape[1], dressed.vertices, recipe, seed=seed, pins=pins)
    network.normalise_by(*data.input_statistics())
    return TrainedModel(model_kind, network.eval(), recipe, seed=seed)
