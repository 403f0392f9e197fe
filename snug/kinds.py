"""Kinds of networks: one record says what each is called, where it lies, and what teaches it.

The tables of networks, recipes, trainings and commands all come from KINDS. Imports no network: a command
lists them without torch.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING

from snug.named_recipes import (
    HANDLES,
    NCS,
    PBNS,
    SANTESTEBAN2019,
    SUPERVISED,
    TAILORNET,
)
from snug.recipe import DEFAULT, Recipe

if TYPE_CHECKING:
    from snug.networks.garment_network import GarmentNetwork

# Of a loss: a frame's energy, or a distance. Energies beside it are in joules before they are weighed.
UNITS = {"energies": "J", "vertices": "cm²", "bands": "cm"}


@dataclass(frozen=True, kw_only=True)
class Kind:
    """One kind of network and its training.

    Attributes:
        name: as a model file and `snug.train --model` have it.
        label: its name for people.
        architecture: module in snug.networks and class of its network.
        sizes: further arguments of that class, as the number of handles.
        recipe: options of network and training, unless others are named.
        targets: what teaches it: the `energies`, simulated `vertices`, or `bands` of their unposed
            offsets (snug.training.simulated_data).
        static: whether it knows single frames alone, so that no inertia is in its loss.
        cost: time of a step, where one of SNUG's takes 1.
    """

    name: str
    label: str
    architecture: str
    sizes: tuple[int, ...] = ()
    recipe: Recipe = DEFAULT
    targets: str = "energies"
    static: bool = False
    cost: float = 1.0

    @property
    def network(self) -> type[GarmentNetwork]:
        """Class of its network."""
        module, name = self.architecture.split(".")
        network: type[GarmentNetwork] = getattr(import_module(f"snug.networks.{module}"), name)
        return network

    @property
    def physics(self) -> bool:
        """True if it learns from the energies."""
        return self.targets == "energies"

    @property
    def unit(self) -> str:
        """Unit of its loss."""
        return UNITS[self.targets]

    def check(self, recipe: Recipe) -> None:
        """Raise ValueError for a `physics_weight` where no simulated vertices teach."""
        if recipe.physics_weight and self.targets != "vertices":
            raise ValueError(
                f"recipe option physics_weight={recipe.physics_weight}: {self.name} learns no simulated "
                "vertices; use 0"
            )


KINDS = {
    kind.name: kind
    for kind in (
        Kind(name="snug", label="SNUG", architecture="regressor.Regressor"),
        Kind(
            name="pbns",
            label="PBNS",
            architecture="pbns.PoseSpaceDeformation",
            recipe=PBNS,
            static=True,
            cost=0.4,
        ),
        Kind(
            name="supervised",
            label="Supervised",
            architecture="regressor.Regressor",
            recipe=SUPERVISED,
            targets="vertices",
        ),
        Kind(
            name="santesteban2019",
            label="Santesteban 2019",
            architecture="santesteban2019.FitAndWrinkles",
            recipe=SANTESTEBAN2019,
            targets="vertices",
        ),
        Kind(
            name="tailornet",
            label="TailorNet",
            architecture="tailornet.FrequencyMixture",
            recipe=TAILORNET,
            targets="bands",
            static=True,
        ),
        Kind(
            name="handles-80",
            label="80 handles",
            architecture="handles.Handles",
            sizes=(80,),
            recipe=HANDLES,
            static=True,
            cost=0.5,
        ),
        Kind(
            name="ncs",
            label="Neural Cloth Simulation",
            architecture="ncs.TwoBranches",
            recipe=NCS,
            cost=2.5,
        ),
    )
}


def find_kind(name: str) -> Kind:
    """Return the kind of that name. Raises ValueError naming the known ones.

    >>> find_kind("pbns").recipe.learning_rate
    0.002
    """
    if name not in KINDS:
        raise ValueError(f"unknown model {name!r}: use one of {', '.join(KINDS)}")
    return KINDS[name]
