"""Methods that run when named: further baselines, ablations of SNUG, its dynamics, clean-up, the bound."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from benchmarks.method import MethodEntry
from benchmarks.methods.catalogue.solvers import warm_started
from snug.recipes.deviations import DEVIATIONS
from snug.recipes.named import ABLATIONS


def network(name: str, label: str, description: str, **changes: Any) -> MethodEntry:
    """The entry of a network that TRAININGS (benchmarks.methods.catalogue.trainings) knows under the same name."""
    fields: dict[str, Any] = {
        "name": name,
        "label": label,
        "description": description,
        "module": "benchmarks.methods.networks.network",
        "options": {"kind": name},
        "needs_body": True,
        "dtype": "float32",
        "trained": name,
        "seeded": True,
        "batched": True,
        "gives_first_frame": True,
        "conserving": True,
        "role": "network",
        "pairing_group": name,
    } | changes
    return MethodEntry(**fields)


def cleaned(entry: MethodEntry) -> MethodEntry:
    """That network with the collision clean-up behind it."""
    return replace(
        entry, name=f"{entry.name}+cleanup", label=f"{entry.label}, cleaned up",
        description=f"{entry.name}, then vertices within 2 mm of the skin pushed out; both are timed",
        module="benchmarks.methods.networks.clean_up", batched=False, base=entry.name,
        family=f"{entry.family}+cleanup" if entry.family else "",
    )  # fmt: skip


def _ablation(recipe: str) -> MethodEntry:
    words = _LABELS.get(recipe, recipe.replace("-", " "))
    return network(
        f"snug-{recipe}", f"SNUG, {words}", f"ablation: SNUG, recipe {recipe}", role="ablation", base="snug",
        pairing_group="snug",
    )  # fmt: skip


def _stored(precision: str) -> MethodEntry:
    words = f"SNUG, its weights in {precision}"
    entry = network("snug", words, f"{words}: less memory to read in a frame, rounded answers")
    return replace(
        entry, name=f"snug-{precision}", options={"kind": "snug", "precision": precision}, batched=False,
        role="ablation", base="snug",
    )  # fmt: skip


_LABELS = {
    "no-noise": "first states of zero",
    "noise-alone": "first states of noise, none remembered",
    "window6": "windows of 6",
    "window12": "windows of 12",
    "shapes": "trained on body shapes",
    "springs": "springs instead of StVK",
}

# Each a training of its own, of equal steps: their times stand beside them.
RECIPE_DEVIATIONS = tuple(
    network(
        f"{base}-{verb}-{deviation.name}", f"{label} {verb} {deviation.words}",
        f"{base} {verb} {deviation.words}", role="ablation", base=base, pairing_group="snug",
    )
    for base, label, verb in (("snug", "SNUG", "without"), ("snug-paper", "SNUG, paper's text,", "with"))
    for deviation in DEVIATIONS
)  # fmt: skip

LEARNED = (
    network("pbns-springs", "PBNS, springs", "PBNS with its own mass-spring material instead of StVK"),
    network("santesteban2019", "Santesteban 2019",
            "fit by shape and one GRU of 1500, trained on simulated vertices"),
    network("tailornet", "TailorNet",
            "low and high frequencies by static networks, trained on simulated vertices"),
    network("snug-dynamic", "SNUG, dynamic",
            "SNUG that learns its dynamics from a simulation, the rest from the energies",
            base="snug", pairing_group="snug"),
    network("snug-paper", "SNUG, paper's text", "SNUG by the paper's text, its closest points remembered",
            base="snug", pairing_group="snug"),
    *(_ablation(recipe.name) for recipe in ABLATIONS),
    *(_stored(precision) for precision in ("bf16", "int8")),
    *warm_started("snug-dynamic", "SNUG, dynamic", "lbfgs", trained="snug-dynamic", pairing_group="snug"),
    *warm_started("snug-dynamic", "SNUG, dynamic", "fast-lbfgs", trained="snug-dynamic",
                  pairing_group="snug"),
    *(cleaned(network(kind, label, "")) for kind, label in (("snug", "SNUG"), ("pbns", "PBNS"),
                                                ("supervised", "Supervised"),
                                                ("santesteban2019", "Santesteban 2019"),
                                                ("tailornet", "TailorNet"))),
    MethodEntry(
        name="direct-optimisation",
        label="Vertices optimised directly",
        description="no network: the vertices of a whole clip optimised directly, the least energy found",
        module="benchmarks.methods.networks.direct_optimisation",
        needs_body=True,
        gives_first_frame=True,
        static_known=False,
        role="bound",
    ),
)  # fmt: skip
