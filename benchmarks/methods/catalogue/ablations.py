"""Ablations of SNUG: one choice of its recipe changed, one deviation from the paper."""

from __future__ import annotations

from benchmarks.methods.catalogue.networks import network
from snug.named_recipes import ABLATIONS, DEVIATIONS

_LABELS = {
    "no-noise": "first states of zero",
    "noise-alone": "first states of noise, none remembered",
    "window6": "windows of 6",
    "window12": "windows of 12",
    "shapes": "trained on body shapes",
    "detached-past": "inertia about a detached past",
    "two-transitions": "inertia of two transitions",
    "springs": "springs instead of StVK",
}


RECIPES = tuple(
    network(
        f"snug-{recipe.name}", f"SNUG, {_LABELS.get(recipe.name, recipe.name.replace('-', ' '))}",
        f"ablation: SNUG, recipe {recipe.name}", role="ablation", base="snug", pairing_group="snug",
    )
    for recipe in ABLATIONS
)  # fmt: skip

# Each a training of its own, of equal steps: their times stand beside them.
RECIPE_DEVIATIONS = tuple(
    network(
        f"{base}-{verb}-{deviation.name}", f"{label} {verb} {deviation.description}",
        f"{base} {verb} {deviation.description}", role="ablation", base=base, pairing_group="snug",
    )
    for base, label, verb in (("snug", "SNUG", "without"), ("snug-paper", "SNUG, paper's text,", "with"))
    for deviation in DEVIATIONS
)  # fmt: skip
