"""Every choice in which the default recipe is not the paper's text, one by one: undone, or added to the text.

Together the deviations name every option in which the two recipes differ. Imports nothing heavy.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from snug.recipes.recipe import Recipe


@dataclass(frozen=True)
class Deviation:
    """name: as part of a recipe's; options: of the recipe; words: what the default has, the text has not."""

    name: str
    options: tuple[str, ...]
    words: str


DEVIATIONS = (
    Deviation("zero-last-layer", ("zero_last_layer",), "a last layer of zero"),
    Deviation("small-output", ("output_scale",), "its small output"),
    Deviation("six-numbers", ("pose_input",), "six numbers a joint"),
    Deviation("root-axes", ("velocity_frame",), "velocity in the root's axes"),
    Deviation("smoothed-weights", ("smoothing",), "smoothed skinning weights"),
    Deviation("higher-rate", ("learning_rate", "schedule"), "a higher rate that falls by a cosine"),
    Deviation("weight-decay", ("weight_decay",), "weight decay"),
    Deviation("remembered-states", ("remembered", "h0_sigma"), "remembered states and less noise"),
    Deviation("overlapping-windows", ("window_stride",), "overlapping windows"),
    Deviation("even-epochs", ("even",), "even epochs"),
    Deviation("mean-body", ("shape_range",), "the mean body alone"),
    Deviation("simulator-contact", ("contact_samples", "contact_stiffness", "contact_margin"),
              "contact as the simulator has it"),
    Deviation("mixed-motions", ("mixed",), "mixed motions"),
    Deviation("divergence-guard", ("spike",), "its guard against divergence"),
)  # fmt: skip


def with_and_without(default: Recipe, paper: Recipe) -> tuple[Recipe, ...]:
    """`default` without each deviation, named "without-...", then `paper` with each, "paper-with-..."."""
    return (
        *(_taken(d, default, paper, f"without-{d.name}") for d in DEVIATIONS),
        *(_taken(d, paper, default, f"paper-with-{d.name}") for d in DEVIATIONS),
    )


def _taken(deviation: Deviation, recipe: Recipe, other: Recipe, name: str) -> Recipe:
    """`recipe` with the options of the deviation as `other` has them."""
    return replace(recipe, name=name, **{option: getattr(other, option) for option in deviation.options})
