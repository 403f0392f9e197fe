"""Networks as methods, their ablations and bounds, in NETWORKS; and the trainings of all of them.

No result depends on these lists, but on the training of its own network alone: a further line makes no
finished network out of date, though metrics are measured again.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from benchmarks.method import MethodEntry, Simulated, Training
from snug.kinds import KINDS
from snug.named_recipes import (
    ABLATIONS,
    PAPER,
    PAPER_ABLATIONS,
    PAPERS,
    PBNS_SPRINGS,
    SUPERVISED,
    SUPERVISED_VERTICES,
)
from snug.recipe import DEFAULT
from snug.trained import list_networks, network_name

TRAININGS = {
    **{
        name: Training(name, kind.recipe, None if kind.physics else Simulated())
        for name, kind in KINDS.items()
    },
    "supervised": Training("supervised", SUPERVISED, Simulated(mixed=round(DEFAULT.mixed))),
    "supervised-vertices": Training("supervised", SUPERVISED_VERTICES, Simulated()),
    "pbns-paper": Training("pbns", PAPER),
    "pbns-springs": Training("pbns", PBNS_SPRINGS),
    **{f"snug-{recipe.name}": Training("snug", recipe) for recipe in (*PAPERS, *ABLATIONS)},
}
IN_PACKAGE = list_networks()
TRAININGS |= {
    f"{name}-packaged": replace(training, packaged=name)
    for name, training in TRAININGS.items()
    if network_name(name, "tshirt", 0) in IN_PACKAGE
}


def network(
    name: str, label: str, description: str, *, base: str = "", pairing_group: str = "", **fields: Any
) -> MethodEntry:
    """Return the entry of a network.

    Args:
        name: that of its training in TRAININGS, unless `fields` has a `training`.
        label: its name for people; empty: that of its kind.
        description: one line for --list and run.json.
        base: the method that it is compared with.
        pairing_group: shared by methods compared seed by seed; its own name by default.
        fields: other fields of MethodEntry, in place of those of a network.

    >>> network("snug-windy", "SNUG, windy", "SNUG, trained in a wind", base="snug").pairing_group
    'snug-windy'
    """
    usual: dict[str, Any] = {
        "module": "benchmarks.methods.networks:make_network",
        "options": {"kind": name},
        "needs_body": True,
        "dtype": "float32",
        "trained": name,
        "seeded": True,
        "batched": True,
        "gives_first_frame": True,
        "role": "network",
        "base": base,
        "pairing_group": pairing_group or name,
    }
    return MethodEntry(
        name=name, label=label or KINDS[name].label, description=description, **usual | fields
    )


NAMED = (
    network("snug", "", "recurrent network trained on the energies alone (Santesteban et al. 2022)"),
    network("supervised", "",
            "the SNUG network trained on simulated vertices, strain and collision; augmented clips too"),
    network("supervised-vertices", "Supervised by vertices",
            "the SNUG network trained on simulated vertices of the original motions alone",
            base="supervised", pairing_group="supervised"),
    network("pbns", "", "static pose-space deformation trained on the energies (Bertiche et al. 2021)"),
    network("pbns-springs", "PBNS, springs", "PBNS with its own mass-spring material instead of StVK"),
    network("pbns-paper", "PBNS, paper's text", "PBNS with StVK, trained as SNUG by the paper's text",
            base="pbns", pairing_group="pbns"),
    network("santesteban2019", "",
            "fit by shape and one GRU of 1500, trained on simulated vertices"),
    network("tailornet", "",
            "low and high frequencies by static networks, trained on simulated vertices"),
    network("ncs", "",
            "static and dynamic branch apart, trained on the energies (Bertiche et al. 2022)"),
    network("handles-80", "",
            "static network that moves the garment by 80 handles, trained on the energies"),
    network("snug-paper", "SNUG, paper's text", "SNUG by the paper's text, its closest points remembered",
            base="snug", pairing_group="snug"),
    network("snug-paper-contact", "SNUG, paper's text, simulator's contact",
            "SNUG by the paper's text, but for the contact, which is that of the scene",
            base="snug-paper", pairing_group="snug"),
    network("snug-paper-nearest-vertex", "SNUG, paper's text, nearest body vertex",
            "SNUG by the paper's text, its contact planes at the nearest body vertices, as its authors' code",
            base="snug-paper", pairing_group="snug"),
)  # fmt: skip


POST_PROCESSED = tuple(
    replace(
        entry, name=f"{entry.name}+cleanup", label=f"{entry.label}, post-processed", batched=False,
        description=f"{entry.name}, then vertices within 2 mm of the skin pushed out; both are timed",
        options={"kind": entry.name, "cleanup": True},
        base=entry.name,
    )
    for entry in NAMED
    if entry.name in ("snug", "supervised", "supervised-vertices")
)  # fmt: skip

_LABELS = {
    "no-noise": "first states of zero",
    "noise-alone": "first states of noise, none remembered",
    "window6": "windows of 6",
    "window12": "windows of 12",
    "shapes": "trained on body shapes",
    "detached-past": "inertia about a detached past",
    "two-transitions": "inertia of two transitions",
    "springs": "springs instead of StVK",
    **{recipe.name: recipe.name.replace("paper-no-", "paper's text, no ") for recipe in PAPER_ABLATIONS},
}
RECIPES = tuple(
    network(
        f"snug-{recipe.name}", f"SNUG, {_LABELS.get(recipe.name, recipe.name.replace('-', ' '))}",
        f"ablation: SNUG, recipe {recipe.name}", role="ablation", base=base, pairing_group="snug",
    )
    for base, recipes in (("snug", ABLATIONS), ("snug-paper", PAPER_ABLATIONS))
    for recipe in recipes
)  # fmt: skip


PACKAGED = tuple(
    network(
        f"{entry.name}-packaged", f"{entry.label}, package",
        f"{entry.name} of the package, trained on all clips by sizes quick: trains nothing, seed 0 alone",
        base=entry.name, seeded=False,
        options={"kind": entry.name, "packaged": network_name(entry.name, "tshirt", 0)},
    )
    for entry in NAMED
    if f"{entry.name}-packaged" in TRAININGS
)  # fmt: skip

NETWORKS = (*NAMED, *PACKAGED, *RECIPES, *POST_PROCESSED)
