"""Trainings of the project's networks, by the name of the network that a method declares as `trained`.

No result depends on this list, but on the training of its own network alone: a further line makes no
finished network out of date.
"""

from __future__ import annotations

from benchmarks.training import Simulated, Training
from snug.recipes.deviations import exchange_deviations
from snug.recipes.named import (
    ABLATIONS,
    DYNAMIC,
    HANDLES,
    NCS,
    NEAREST_POSES,
    PAPER,
    PBNS,
    PBNS_SPRINGS,
    POSE_REGRESSION,
    SANTESTEBAN2019,
    SUPERVISED,
    TAILORNET,
)
from snug.recipes.recipe import DEFAULT

TRAININGS = {
    "snug": Training("snug", DEFAULT),
    "pbns": Training("pbns", PBNS),
    "pbns-paper": Training("pbns", PAPER),
    "pbns-springs": Training("pbns", PBNS_SPRINGS),
    "supervised": Training("supervised", SUPERVISED, Simulated()),
    "santesteban2019": Training("santesteban2019", SANTESTEBAN2019, Simulated()),
    "tailornet": Training("tailornet", TAILORNET, Simulated()),
    "nearest-poses": Training("nearest-poses", NEAREST_POSES, Simulated()),
    "pose-regression": Training("pose-regression", POSE_REGRESSION, Simulated()),
    **{f"handles-{count}": Training(f"handles-{count}", HANDLES) for count in (20, 40, 80)},
    "ncs": Training("ncs", NCS),
    "ncs-static": Training("ncs-static", NCS),
    "snug-dynamic": Training("dynamic", DYNAMIC, Simulated(mixed=4, method="fast-lbfgs-40", swinging=True)),
    **{f"snug-{recipe.name}": Training("snug", recipe) for recipe in (PAPER, *ABLATIONS)},
    # Each deviation has as many steps as the recipe that it changes.
    **{
        f"snug-{recipe.name}": Training(
            "snug", recipe, steps_of="snug-paper" if recipe.name.startswith("paper-") else ""
        )
        for recipe in exchange_deviations(DEFAULT, PAPER)
    },
}
