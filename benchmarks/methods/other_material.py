"""The simulation of the scene with one energy exchanged for another.

It is judged, as every method, by the energies that the scene declares. Its start is theirs too.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path

from reference_sim.energies import BendHinge, Energy, StretchSpring, StretchStVK

from ..scene import BuiltScene
from .simulation import Simulation


@dataclass(kw_only=True)
class OtherMaterial(Simulation):
    """The reference with another energy in one place. exchange: one of EXCHANGES."""

    exchange: str

    def prepare(self, scene: BuiltScene) -> None:
        start = scene.start_state
        energies = tuple(map(EXCHANGES[self.exchange], scene.energies))
        super().prepare(dataclasses.replace(scene, energies=energies, settle=lambda: start))


def _printed_bending(term: Energy) -> Energy:
    """k/2 theta^2 of each hinge, as the SNUG paper prints it, not scaled."""
    if not isinstance(term, BendHinge):
        return term
    return BendHinge(term.cloth, scaling="none", rest_angles=term.rest_angles)


def _springs(term: Energy) -> Energy:
    """k (l - l0)^2 of each edge, the membrane that recipe `springs` trains on."""
    return StretchSpring(term.cloth) if isinstance(term, StretchStVK) else term


EXCHANGES = {"printed-bending": _printed_bending, "springs": _springs}


def make(*, models: Path, seed: int, exchange: str) -> OtherMaterial:
    """The reference with that exchange."""
    return OtherMaterial(options={}, exchange=exchange)
