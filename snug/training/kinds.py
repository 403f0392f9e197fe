"""Kinds of models: the network of each, and whether the energies or simulated vertices teach it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from snug.networks.architectures import ARCHITECTURES, find_architecture
from snug.networks.garment_network import GarmentNetwork
from snug.training.vertex_targets import BandTargets, VertexTargets


@dataclass(frozen=True)
class Kind:
    """The training of one kind of model.

    Attributes:
        network: its architecture.
        targets: the form in which it learns simulated vertices; None if it learns from the energies.
        past: whether inertia is that of a simulation's previous frames, see
            snug.training.simulated_data.
        closed_form: whether it trains faster by snug.kernels.gru.
    """

    network: type[GarmentNetwork]
    targets: type[VertexTargets] | None = None
    past: bool = False
    closed_form: bool = False

    @property
    def physics(self) -> bool:
        """True if it learns from the energies."""
        return self.targets is None

    @property
    def unit(self) -> str:
        """Unit of its loss: a frame's energy, or a distance from the simulated vertices."""
        return self.targets.unit if self.targets else "J"


# What differs from a network that learns from the energies.
_OTHER: dict[str, dict[str, Any]] = {
    "snug": {"closed_form": True},
    "dynamic": {"past": True, "closed_form": True},
    "handles-80-dynamic": {"closed_form": True},
    "supervised": {"targets": VertexTargets, "closed_form": True},
    "santesteban2019": {"targets": VertexTargets, "closed_form": True},
    "tailornet": {"targets": BandTargets},
    "nearest-poses": {"targets": VertexTargets},
    "pose-regression": {"targets": VertexTargets},
}
KINDS = {name: Kind(network, **_OTHER.get(name, {})) for name, network in ARCHITECTURES.items()}


def find_kind(name: str) -> Kind:
    """Return the kind of that name. Raises ValueError naming the known ones."""
    find_architecture(name)
    return KINDS[name]
