"""The simulation of the scene with energies of another material.

It is judged, as every method, by the energies that the scene declares. Its start is theirs too.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.methods.solvers.simulation import Simulation
from benchmarks.scene import BuiltScene
from reference_sim.energies import BendHinge, Energy, StretchSpring, StretchStVK
from snug.training.losses.pbns_material import BENDING


@dataclass(kw_only=True)
class OtherMaterial(Simulation):
    """The reference with other energies in places. exchange: one of EXCHANGES."""

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


def _pbns_springs(term: Energy) -> Energy:
    """PBNS's own springs and hinges, which recipe `pbns-springs` trains on; the weight stays the scene's."""
    own = _printed_bending(_springs(term))
    if isinstance(own, BendHinge):
        own.stiffness = np.full(len(own.stencils), 2.0 * BENDING)
    return own


EXCHANGES = {"printed-bending": _printed_bending, "springs": _springs, "pbns-springs": _pbns_springs}


def make(*, models: Path, seed: int, exchange: str) -> OtherMaterial:
    """The reference with that exchange."""
    return OtherMaterial(options={}, exchange=exchange)
