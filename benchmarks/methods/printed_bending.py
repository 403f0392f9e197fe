"""The simulation of the scene with its hinges as the SNUG paper prints them: k/2 theta^2, not scaled.

It is judged, as every method, by the energies that the scene declares. Its start is theirs too.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path

from reference_sim.energies import BendHinge, Energy

from ..scene import BuiltScene
from .simulation import Simulation


class PrintedBending(Simulation):
    """The reference with other hinges."""

    def prepare(self, scene: BuiltScene) -> None:
        start = scene.start_state
        energies = tuple(map(_printed, scene.energies))
        super().prepare(dataclasses.replace(scene, energies=energies, settle=lambda: start))


def _printed(term: Energy) -> Energy:
    if not isinstance(term, BendHinge):
        return term
    return BendHinge(term.cloth, scaling="none", rest_angles=term.rest_angles)


def make(*, models: Path, seed: int) -> PrintedBending:
    """The reference with printed hinges."""
    return PrintedBending(options={})
