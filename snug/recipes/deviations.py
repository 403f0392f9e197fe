"""Deviations of the default recipe from the paper's text, each of which can be undone or added alone.

Together they name every option in which the two recipes differ. Imports nothing heavy.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from snug.recipes.recipe import Recipe


@dataclass(frozen=True)
class Deviation:
    """One deliberate difference between the default recipe and the paper's text.

    Attributes:
        name: part of the name of a recipe without it, or with it alone.
        options: fields of Recipe that it changes.
        description: what the default recipe has and the text has not, to be read behind "with" or "without".
    """

    name: str
    options: tuple[str, ...]
    description: str


DEVIATIONS = (
    Deviation("zero-last-layer", ("zero_last_layer",), "a last layer of zero"),
    Deviation("small-output", ("output_scale",), "its small output"),
    Deviation("six-numbers", ("pose_input",), "six numbers a joint"),
    Deviation("root-axes", ("velocity_frame",), "velocity in the root's axes"),
    Deviation("smoothed-weights", ("smoothing",), "smoothed skinning weights"),
    Deviation("cosine-rate", ("schedule",), "a rate that falls by a cosine"),
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


def exchange_deviations(default: Recipe, paper: Recipe) -> tuple[Recipe, ...]:
    """Return `default` without each deviation ("without-..."), then `paper` with each ("paper-with-...")."""
    return (
        *(_with_options_of(d, default, paper, f"without-{d.name}") for d in DEVIATIONS),
        *(_with_options_of(d, paper, default, f"paper-with-{d.name}") for d in DEVIATIONS),
    )


def _with_options_of(deviation: Deviation, recipe: Recipe, other: Recipe, name: str) -> Recipe:
    """Return `recipe` with the deviation's options taken from `other`."""
    return replace(recipe, name=name, **{option: getattr(other, option) for option in deviation.options})
