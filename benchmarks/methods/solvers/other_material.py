"""Reference simulation with energies of another material, evaluated by the energies that the scene declares.

It is judged, as every method, by the energies that the scene declares. Its start is theirs too.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.methods.solvers.simulation import Simulation
from benchmarks.scene import BuiltScene
from reference_sim.energies.bend_hinge import BendHinge
from reference_sim.energies.energy import Energy
from reference_sim.energies.stretch_spring import StretchSpring
from reference_sim.energies.stretch_stvk import StretchStVK
from snug.training.physics_loss import BENDING


@dataclass(kw_only=True)
class OtherMaterial(Simulation):
    """Reference simulation with some energies exchanged. exchange: one of EXCHANGES."""

    exchange: str

    def prepare(self, scene: BuiltScene) -> None:
        """Exchange the energies and prepare; the start stays that of the scene's own material."""
        start = scene.start_state
        energies, minimised = (
            tuple(map(EXCHANGES[self.exchange], terms)) for terms in (scene.energies, scene.minimised)
        )
        super().prepare(
            dataclasses.replace(scene, energies=energies, minimised=minimised, settle=lambda: start)
        )


def _printed_bending(term: Energy) -> Energy:
    """Return hinges as the SNUG paper prints them, k/2 theta^2 each, not scaled; other terms as they are."""
    if not isinstance(term, BendHinge):
        return term
    return BendHinge(term.cloth, scaling="none", rest_angles=term.rest_angles)


def _springs(term: Energy) -> Energy:
    """Return k (l - l0)^2 of each edge, which recipe `springs` trains on, in place of the membrane."""
    return StretchSpring(term.cloth) if isinstance(term, StretchStVK) else term


def _pbns_springs(term: Energy) -> Energy:
    """Return PBNS's springs and hinges, as recipe `pbns-springs` has them; the weight is the scene's."""
    exchanged = _printed_bending(_springs(term))
    if isinstance(exchanged, BendHinge):
        exchanged.stiffness = np.full(len(exchanged.stencils), 2.0 * BENDING)
    return exchanged


EXCHANGES = {"printed-bending": _printed_bending, "springs": _springs, "pbns-springs": _pbns_springs}


def make(*, models: Path, seed: int, exchange: str) -> OtherMaterial:
    """Make the reference with that exchange."""
    return OtherMaterial(options={}, exchange=exchange)
