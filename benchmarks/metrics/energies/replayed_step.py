"""Time step that ended at a frame of a trajectory, replayed as its solver was given it."""

from __future__ import annotations

import copy
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from reference_sim.energies.energy import Step
from reference_sim.energies.inertia import Inertia

if TYPE_CHECKING:
    from benchmarks.scene import BuiltScene
    from reference_sim.energies.energy import Energy
    from reference_sim.potential import Potential

Floats = NDArray[np.float64]


def copied_terms(scene: BuiltScene) -> list[Energy]:
    """Copy the terms that the scene declares, and inertia, to be prepared for one trajectory alone.

    A term may remember the step before, and read another term: so all are copied together, and what one of
    them knows of another is the other's copy. Arrays are shared with the scene's.
    """
    declared = (*scene.energies, Inertia(scene.cloth, scene.dt))
    twins = {id(term): copy.copy(term) for term in declared}
    for twin in twins.values():
        vars(twin).update({name: twins[id(v)] for name, v in vars(twin).items() if id(v) in twins})
    return list(twins.values())


def freeze_step(
    scene: BuiltScene, potential: Potential, positions: Floats, frame: int, *, guess: Floats | None = None
) -> Floats:
    """Freeze the potential for the step that ended at `frame`; return its first guess (V,3) [m].

    Any frame may be jumped to: the step before is prepared first where a term remembers it.

    Args:
        scene: of the trajectory.
        potential: of terms made by `copied_terms`.
        positions: (T,V,3) [m].
        frame: 1 or later.
        guess: (V,3) [m] where contact planes are searched; the simulator's first guess by default.
    """
    if frame > 1 and any(term.remembers for term in potential.energies):
        potential.prepare(step_to(scene, positions, frame - 1))
    step = step_to(scene, positions, frame, guess=guess)
    potential.prepare(step)
    return step.guess


def step_to(scene: BuiltScene, positions: Floats, frame: int, *, guess: Floats | None = None) -> Step:
    """Return the step from frame - 1 of positions (T,V,3) [m] to `frame`, as a solver is given it.

    A frame before the first counts as equal to it: the start is a step from rest.
    """
    previous = positions[max(frame - 1, 0)]
    velocity = (previous - positions[max(frame - 2, 0)]) / scene.dt
    guess = first_guess(scene, previous, velocity, frame) if guess is None else guess
    return Step(previous, velocity, guess, scene.dt, scene.obstacle, frame)


def first_guess(scene: BuiltScene, previous: Floats, velocity: Floats, frame: int) -> Floats:
    """Return the solver's first guess of a step, (V,3) [m]: previous positions, carried along."""
    if scene.obstacle is None:
        guess = previous + scene.dt * velocity
    else:
        guess = scene.obstacle.transported(previous, frame, scene.cloth.rest_positions)
    pins = scene.cloth.pins
    guess[pins] = previous[pins] if scene.pin_positions is None else scene.pin_positions(frame)
    return np.ascontiguousarray(guess)
