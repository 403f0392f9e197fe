"""Variants of the reference: other material, perturbed start.

All are measured, as every method, by the energies that the scene declares; another material starts where the
scene's own does. Wrinkling cloth has several minima, and which one is reached hangs on the last digits: what
runs from perturbed starts differ by is the uncertainty of whatever is compared with the reference.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks.methods.simulation import Simulation
from benchmarks.scene import BuiltScene
from reference_sim.energies.bend_hinge import BendHinge
from reference_sim.energies.energy import Energy
from reference_sim.energies.stretch_spring import StretchSpring
from reference_sim.energies.stretch_stvk import StretchStVK
from snug.training.physics_loss import BENDING


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


def of_other_energies(scene: BuiltScene, exchange: Callable[[Energy], Energy]) -> BuiltScene:
    """Return the scene with each energy exchanged by that function; the start stays that of its own ones."""
    start = scene.start_state
    energies, minimised = (tuple(map(exchange, terms)) for terms in (scene.energies, scene.minimised))
    return replace(scene, energies=energies, minimised=minimised, settle=lambda: start)


def of_perturbed_start(scene: BuiltScene, shift: float) -> BuiltScene:
    """Return the scene with each free vertex moved by `shift` [m] in a random direction at the start.

    The directions are seeded by the shift, so that every run is perturbed differently.
    """
    seed = np.float64(shift).view(np.uint64)
    direction = np.random.default_rng(int(seed)).standard_normal(scene.start.shape)
    direction *= shift / np.linalg.norm(direction, axis=1, keepdims=True)
    direction[scene.cloth.pins] = 0.0
    start = scene.start_state + np.stack([direction, np.zeros_like(direction)])
    return replace(scene, settle=lambda: start)


def make_other_material(*, models: Path, seed: int, exchange: str) -> Simulation:
    """Make the reference with that exchange, one of EXCHANGES."""
    return Simulation(change=partial(of_other_energies, exchange=EXCHANGES[exchange]))


def make_perturbed_start(*, models: Path, seed: int, shift: float) -> Simulation:
    """Make the reference from a start perturbed by `shift` [m]."""
    return Simulation(change=partial(of_perturbed_start, shift=shift))
