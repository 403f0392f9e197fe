"""Schedules of the learning rate."""

from __future__ import annotations

import math

from snug.recipes.recipe import Recipe

DROP, COSINE_END = 0.1, 0.01  # factors after the drop of `epochs`, and at the end of `cosine`


def rate_factor(recipe: Recipe, *, step: int, steps: int, epoch: int) -> float:
    """Return the factor on the recipe's learning rate in a step, see Recipe.schedule.

    >>> from snug.recipes.recipe import DEFAULT
    >>> [round(rate_factor(DEFAULT, step=step, steps=100, epoch=1), 3) for step in (0, 50, 100)]
    [1.0, 0.505, 0.01]
    """
    if recipe.schedule == "epochs" and epoch > recipe.drop_after_epochs:
        return DROP
    if recipe.schedule == "cosine":
        return COSINE_END + (1 - COSINE_END) * 0.5 * (1 + math.cos(math.pi * step / steps))
    return 1.0
