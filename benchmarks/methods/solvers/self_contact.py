"""Reference simulation whose cloth does not cross itself, evaluated by the scene's declared energies."""

from __future__ import annotations

import dataclasses
from pathlib import Path

from benchmarks.methods.solvers.simulation import Simulation
from benchmarks.scene import BuiltScene
from benchmarks.scenes.self_contact import crossing, demand_uncrossed, with_self_contact


class SelfContact(Simulation):
    """Reference simulation with self-contact, from the scene's start, or from one of its own."""

    def prepare(self, scene: BuiltScene) -> None:
        """Settle the garment anew, with self-contact, where the cloth of the scene's start crosses itself.

        Raises ValueError where that start cannot be had without a crossing.
        """
        energies, settle = with_self_contact(scene.energies), scene.settle_uncrossed
        if settle is not None and crossing(scene.start, energies):
            scene = dataclasses.replace(scene, settle=settle)
        demand_uncrossed(scene.start, energies, scene.name)
        super().prepare(dataclasses.replace(scene, minimised=energies))


def make(*, models: Path, seed: int) -> SelfContact:
    """Make the reference with self-contact."""
    return SelfContact(options={})
