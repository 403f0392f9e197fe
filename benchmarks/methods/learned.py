"""Methods that run when named: further baselines, ablations of SNUG, its swing, clean-up, the free bound."""

from __future__ import annotations

from dataclasses import replace

from snug.recipe import ABLATIONS

from ..method import MethodEntry
from .solvers import hybrids


def _network(name: str, description: str) -> MethodEntry:
    """The entry of a network that snug.recipe.TRAININGS knows under the same name."""
    return MethodEntry(
        name=name,
        description=description,
        module="benchmarks.methods.networks",
        options={"kind": name},
        needs_body=True,
        dtype="float32",
        trained=name,
        seeded=True,
    )


def _cleaned(kind: str) -> MethodEntry:
    """The entry of that network with the collision clean-up behind it."""
    words = f"{kind}, then vertices within 2 mm of the skin pushed out; both are timed"
    return replace(_network(kind, words), name=f"{kind}+cleanup", module="benchmarks.methods.clean_up")


LEARNED = (
    _network("pbns-springs", "PBNS with its own mass-spring material instead of StVK"),
    _network("santesteban2019", "fit by shape and one GRU of 1500, trained on simulated vertices"),
    _network("tailornet", "low and high frequencies by static networks, trained on simulated vertices"),
    _network("snug-dynamic", "SNUG that learns its swing from a simulation, the rest from the energies"),
    _network("snug-paper", "SNUG by the paper's text, its closest points remembered"),
    *(_network(f"snug-{recipe.name}", f"ablation: SNUG, recipe {recipe.name}") for recipe in ABLATIONS),
    *hybrids("snug-dynamic", "lbfgs", "snug-dynamic"),
    *map(_cleaned, ("snug", "pbns", "supervised", "santesteban2019", "tailornet")),
    MethodEntry(
        name="free-bound",
        description="no network: the vertices of a whole clip optimised directly, the least energy found",
        module="benchmarks.methods.free_bound",
        needs_body=True,
    ),
)
