"""Trainings of the project's networks, by the name of the network that a method declares as `trained`.

No result depends on this list, but on the training of its own network alone: a further line makes no
finished network out of date.
"""

from __future__ import annotations

from benchmarks.training import Simulated, Training
from snug.named_recipes import ABLATIONS, DYNAMIC, PAPER, PBNS_SPRINGS, RECIPE_OF_KIND, exchange_deviations
from snug.recipe import DEFAULT

LEARN_FROM_SIMULATIONS = ("supervised", "santesteban2019", "tailornet", "nearest-poses", "pose-regression")
TRAININGS = {
    # Each kind by its own recipe; `dynamic` learns from other simulations, as `snug-dynamic`.
    **{
        kind: Training(kind, recipe, Simulated() if kind in LEARN_FROM_SIMULATIONS else None)
        for kind, recipe in RECIPE_OF_KIND.items()
        if kind != "dynamic"
    },
    "pbns-paper": Training("pbns", PAPER),
    "pbns-springs": Training("pbns", PBNS_SPRINGS),
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
