"""Train a network, or make an untrained one. The command is snug.train."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Sequence
from dataclasses import replace

import torch

from snug.body.skinning import skin, unskin_damped
from snug.kinds import find_kind
from snug.motion.motion import Motion
from snug.networks.dressed_body import DressedBody
from snug.networks.garment_network import make_network
from snug.networks.trained_model import TrainedModel, digest_of_triangles
from snug.recipe import Recipe
from snug.training.checkpoint import Checkpoint
from snug.training.device import find_device
from snug.training.optimisation_step import Trainer
from snug.training.training_loop import TrainingLoop
from snug.training.training_set import TrainingSet
from snug.training.validation import Validation
from snug.training.vertex_targets import Trajectories, relative_vertices, vertex_loss

DAMPING = 0.01  # of the offsets that fitted networks learn, see unskin_damped
PIECE = 256  # frames whose loss is taken at once


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

    Kinds that are fitted in one go (snug.networks.fitted) take no steps: of all that concerns steps, nothing
    is used.

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
        checkpoint: where checkpoints are written. A run resumed from one ends, on a CPU, with the bits of an
            unbroken run. The last one stays until the caller has stored the model and calls
            `checkpoint.delete()`.
        validation: held-out motions; the weights that do best on them are kept.

    Returns:
        The trained model.

    Raises:
        ValueError: TrainingError, TargetError, RecipeError, DeviceError or TensorFileError, naming what is
            missing or diverged.

    >>> model = train_network("snug", dressed, motions, steps=2000, seed=0)  # doctest: +SKIP
    """
    start = time.perf_counter()
    gc.collect()  # an earlier training refers to itself, and holds gigabytes
    recipe = recipe or find_kind(model_kind).recipe
    if find_kind(model_kind).fitted:
        return _fitted_model(model_kind, dressed, motions, trajectories, seed=seed, recipe=recipe)
    trainer = Trainer(
        model_kind, dressed, motions, steps=steps, seed=seed, recipe=recipe, trajectories=trajectories,
        device=find_device(device), kernels=kernels,
    )  # fmt: skip
    loop = TrainingLoop(
        trainer, log=log, progress=progress, every=every, checkpoint=checkpoint, validation=validation,
        setup_seconds=time.perf_counter() - start,
    )  # fmt: skip
    return loop.run()


def _fitted_model(
    model_kind: str,
    dressed: DressedBody,
    motions: Sequence[Motion],
    trajectories: Trajectories | None,
    *,
    seed: int,
    recipe: Recipe,
) -> TrainedModel:
    """Fit a network to the offsets of simulated frames; its loss is that of the posed vertices."""
    begun = time.perf_counter()
    kind = find_kind(model_kind)
    data = TrainingSet(dressed, motions, recipe, features=kind.network.feature_set, sequences=False)
    vertices = relative_vertices(dressed, motions, trajectories)
    weights = dressed.weights(recipe.smoothing)
    pins = dressed.garment.pins
    network = make_network(model_kind, data.features.shape[1], dressed.vertices, recipe, seed=seed, pins=pins)
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

    The default recipe starts at a zero last layer, where the untrained network is skinning alone. So this one
    keeps the random last layer of the recipe's rules: the answer of a network that has learned nothing. Input
    statistics are those of the training motions. Without a recipe it is the kind's.
    """
    kind = find_kind(model_kind)
    recipe = replace(recipe or find_kind(model_kind).recipe, zero_last_layer=False)
    data = TrainingSet(
        dressed, motions, recipe, features=kind.network.feature_set, sequences=kind.network.sequential
    )
    pins = dressed.garment.pins
    network = make_network(model_kind, data.features.shape[1], dressed.vertices, recipe, seed=seed, pins=pins)
    network.wear(dressed.garment)
    network.normalise_by(*data.input_statistics())
    return TrainedModel(
        model_kind, network.eval(), recipe, seed=seed, unit=kind.unit, fps=1.0 / data.dt,
        triangles=digest_of_triangles(dressed.garment.faces),
    )  # fmt: skip
