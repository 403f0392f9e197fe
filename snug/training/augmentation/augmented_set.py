"""The training set of a recipe: original motions and augmented clips, each on its body."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch

from snug.motion.motion import Motion
from snug.networks.dressed_body import DressedBody
from snug.recipes.recipe import Recipe
from snug.training.augmentation.mixed_clips import augment, draw_clip_shapes
from snug.training.kinds import Kind
from snug.training.training_set import TrainingSet


def varies_shape(kind: Kind, dressed: DressedBody, recipe: Recipe) -> bool:
    """Return whether the network is trained on bodies of several shapes."""
    reads_shape = kind.physics and kind.network.feature_set == "motion"
    return bool(recipe.shape_range and dressed.body.shape_count and reads_shape)


def make_training_set(
    kind: Kind,
    dressed: DressedBody,
    motions: Sequence[Motion],
    recipe: Recipe,
    *,
    seed: int,
    device: torch.device,
) -> TrainingSet:
    """Make the training set: the motions and, if the energies teach the network, augmented clips."""
    clips = augment(motions, recipe, vertices=dressed.vertices, seed=seed) if kind.physics else []
    shapes = None
    if varies_shape(kind, dressed, recipe) and recipe.shape_of == "clip":
        mean = np.zeros((len(motions), dressed.body.shape_count))
        of_clips = draw_clip_shapes(len(clips), dressed.body.shape_count, recipe, seed=seed)
        shapes = np.concatenate([mean, of_clips])
    return TrainingSet(
        dressed, [*motions, *clips], recipe, features=kind.network.feature_set,
        sequences=kind.network.sequential, device=device, shapes=shapes,
    )  # fmt: skip
