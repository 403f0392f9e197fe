"""Converged simulations with the contact of recipe `paper`: a file of methods for benchmarks.run.

    python -m benchmarks.run full:garments --motions library \
        --test-motions 07_02,01_01_a,02_07_a,push_recovery,07_01,06_05 \
        --methods simulation,skinning,docs/notebook/recipe_contact.py -o DIR

`reports.statistics.relative_excess.Excess.by_motion` of that run gives the numbers of
training.md#the-contact-of-the-papers-recipe.
Everything but contact is the reference's: terms, start, time step and tolerance. Contact is that of the
recipe, whole or with one or two constants replaced by the reference's. The run measures these simulations
as it measures every method: by the contact of the scene.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path

from benchmarks import MethodEntry
from benchmarks.methods.reference_variants import swap_energies
from benchmarks.methods.simulation import Simulation
from snug.named_recipes import PAPER
from snug.recipe import DEFAULT

KEPT = "recipe's contact"
REPLACED = {
    "recipe-contact": (),
    "recipe-contact-stiffness": ("contact_stiffness",),
    "recipe-contact-samples": ("contact_samples",),
    "recipe-contact-margin": ("contact_margin",),
    "recipe-contact-stiffness-margin": ("contact_stiffness", "contact_margin"),
}
METHODS = tuple(
    MethodEntry(
        name=name,
        label=", the reference's ".join([KEPT, *(option.removeprefix("contact_") for option in options)]),
        description=f"the reference with the contact of recipe paper, without its {options}",
        role="solver",
        options={"replaced": options},
    )
    for name, options in REPLACED.items()
)


def make(*, models: Path, seed: int, replaced: tuple[str, ...]) -> Simulation:
    """Make the simulation with the recipe's contact, the fields `replaced` those of the default recipe."""
    recipe = replace(PAPER, **{option: getattr(DEFAULT, option) for option in replaced})
    return Simulation(change=partial(swap_energies, recipe=recipe))
