"""Variants of the reference: the energies of a recipe, perturbed start.

All are measured, as every method, by the energies that the scene declares; with other energies they start
where the scene's own does.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.methods.simulation import STATIC, Simulation
from benchmarks.scene import BuiltScene
from snug.recipe import DEFAULT, Recipe
from snug.training.physics_loss import make_contact, static_terms


def swap_energies(scene: BuiltScene, recipe: Recipe) -> BuiltScene:
    """Return the scene with the energies that a recipe trains on; the start stays that of its own ones.

    Self-contact, which is no energy of a recipe, stays.
    """
    contact = (make_contact(scene.cloth, recipe),) * (scene.obstacle is not None)
    terms = *static_terms(scene.cloth, recipe).values(), *contact
    extras = scene.minimised[len(scene.energies) :]
    return replace(scene, energies=terms, minimised=terms + extras, settle=lambda: scene.start_state)


def perturb_start(scene: BuiltScene, shift: float) -> BuiltScene:
    """Return the scene with each free vertex moved by `shift` [m] in a random direction at the start.

    The directions are seeded by the shift, so that every run is perturbed differently.
    """
    seed = np.float64(shift).view(np.uint64)
    direction = np.random.default_rng(int(seed)).standard_normal(scene.start.shape)
    direction *= shift / np.linalg.norm(direction, axis=1, keepdims=True)
    direction[scene.cloth.pins] = 0.0
    start = scene.start_state + np.stack([direction, np.zeros_like(direction)])
    return replace(scene, settle=lambda: start)


def make_own_reference(*, models: Path, seed: int, **options: Any) -> Simulation:
    """Make the simulation of the energies of a recipe with these options, the default's in all else."""
    recipe = replace(DEFAULT, **options)
    steps = {} if "inertia" in recipe.terms else STATIC
    return Simulation(steps, partial(swap_energies, recipe=recipe))


def make_perturbed_start(*, models: Path, seed: int, shift: float, **options: Any) -> Simulation:
    """Make the reference from a start perturbed by `shift` [m], with options of its steps."""
    return Simulation(options, partial(perturb_start, shift=shift))
