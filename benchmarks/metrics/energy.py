"""Metrics energy/*: every declared term at every frame, by the very terms that were minimised.

Each method is measured on its own history: inertia compares a frame with the two before it in the same
trajectory, and contact planes are searched at the method's own positions. The first two frames have an
inertia of 0. Means are over the frames after the warm-up.

`energy/bending_printed` is of the same hinges, not scaled, as the SNUG paper prints them. It is no part of
the total.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.metric import Measurements, metrics_of
from reference_sim.energies.energy import Step
from reference_sim.energies.gravity import Gravity
from reference_sim.energies.inertia import Inertia

if TYPE_CHECKING:
    from benchmarks.metric import Floats, Positions, RollOut, SceneRollOuts, Vertices
    from benchmarks.scene import BuiltScene
    from reference_sim.energies.energy import Energy
    from reference_sim.potential import Potential


def copy_terms(scene: BuiltScene) -> list[Energy]:
    """Copy the terms that the scene declares, and inertia, to be prepared for one trajectory alone.

    What one of them knows of another is the other's copy. Arrays are shared with the scene's.
    """
    declared = (*scene.energies, Inertia(scene.cloth, scene.dt))
    twins = {id(term): copy.copy(term) for term in declared}
    for twin in twins.values():
        vars(twin).update({name: twins[id(v)] for name, v in vars(twin).items() if id(v) in twins})
    return list(twins.values())


def freeze_step(
    scene: BuiltScene,
    potential: Potential,
    positions: Positions,
    frame: int,
    guess: Vertices | None = None,
) -> Vertices:
    """Freeze the potential of `copy_terms` for the step that ended at `frame`; return its first guess.

    Any frame from 1 on may be jumped to: the step before is prepared first where a term remembers it.
    Contact planes are searched at `guess`, by default the simulator's.
    """
    if frame > 1 and any(term.remembers for term in potential.energies):
        potential.prepare(step_to(scene, positions, frame - 1))
    step = step_to(scene, positions, frame, guess=guess)
    potential.prepare(step)
    return step.guess


def step_to(
    scene: BuiltScene, positions: Positions, frame: int, *, guess: Vertices | None = None
) -> Step:
    """Return the step from frame - 1 to `frame`, as a solver is given it.

    A frame before the first counts as equal to it: the start is a step from rest.
    """
    previous = positions[max(frame - 1, 0)]
    velocity = (previous - positions[max(frame - 2, 0)]) / scene.dt
    guess = first_guess(scene, previous, velocity, frame) if guess is None else guess
    return Step(previous, velocity, guess, scene.dt, scene.obstacle, frame)


def first_guess(scene: BuiltScene, previous: Vertices, velocity: Floats, frame: int) -> Vertices:
    """Return the solver's first guess of a step: previous positions, carried along."""
    if scene.obstacle is None:
        guess = previous + scene.dt * velocity
    else:
        guess = scene.obstacle.transport(previous, frame, scene.cloth.rest_positions)
    pins = scene.cloth.pins
    guess[pins] = previous[pins] if scene.pin_positions is None else scene.pin_positions(frame)
    return np.ascontiguousarray(guess)


FIRST_FULL_FRAME = 2


def energy_series(scene: BuiltScene, trajectories: Sequence[Positions]) -> list[dict[str, Floats]]:
    """Return energies of each trajectory: term of the scene -> (T,) [J], plus "total".

    Frames are the outer loop: what belongs to a frame alone, as an obstacle's search tree, is made once.
    """
    copies = [copy_terms(scene) for _ in trajectories]
    tables = [{name: np.zeros(len(positions)) for name in scene.terms} for positions in trajectories]
    for frame in range(max(map(len, trajectories), default=0)):
        for positions, terms, series in zip(trajectories, copies, tables):
            if frame < len(positions):
                for name, value in _terms_at(scene, terms, positions, frame).items():
                    series[name][frame] = value
    for series in tables:
        series["total"] = np.sum(list(series.values()), axis=0)
    return tables


def _terms_at(
    scene: BuiltScene, terms: Sequence[Energy], positions: Floats, frame: int
) -> dict[str, float]:
    x = np.ascontiguousarray(positions[frame])
    step = step_to(scene, positions, frame, guess=x)
    values = {}
    for term in terms:
        if term.name == "inertia" and frame < FIRST_FULL_FRAME:
            continue
        term.prepare(step)
        values[term.name] = term.value_and_gradient(x)[0]
        if term.name == "gravity" and scene.origin_heights is not None:
            assert isinstance(term, Gravity)
            values["gravity"] -= term.weights.sum() * (scene.origin_heights[frame] - term.origin_height)
    return values


def measure_energy(roll_out: RollOut) -> dict[str, float]:
    """Return mean energies over the evaluated frames [J per frame]."""
    by_term = energies(roll_out)
    return {f"energy/{term}": float(series[roll_out.judged].mean()) for term, series in by_term.items()}


def series(roll_out: RollOut) -> dict[str, Floats]:
    """Return energies of every frame, (T,) [J] each."""
    return {f"energy/{term}": series for term, series in energies(roll_out).items()}


def energies(roll_out: RollOut) -> dict[str, Floats]:
    """Return term -> (T,) [J], and "total"; computed for all roll-outs of the scene at once."""
    return roll_out.group.get(_measure)[roll_out]


def _measure(group: SceneRollOuts) -> dict[RollOut, dict[str, Floats]]:
    positions = [roll_out.positions for roll_out in group.roll_outs]
    return dict(zip(group.roll_outs, energy_series(group.scene, positions)))


def measure_printed_bending(roll_out: RollOut) -> dict[str, float]:
    """Return the mean [J per frame]; empty where the scene's own hinges are not scaled."""
    from reference_sim.energies.bend_hinge import BendHinge  # loads numba

    hinges = [term for term in roll_out.scene.energies if isinstance(term, BendHinge)]
    if [term.scaling for term in hinges] != ["length_area"]:
        return {}
    printed = BendHinge(hinges[0].cloth, scaling="none", rest_angles=hinges[0].rest_angles)
    frames = map(np.ascontiguousarray, roll_out.positions[roll_out.judged])
    return {"energy/bending_printed": float(np.mean([printed.value_and_gradient(x)[0] for x in frames]))}


ENERGY = Measurements(
    "energy",
    metrics_of(
        ("energy/strain", "J", "Strain", "membrane energy of the declared material, mean over frames"),
        ("energy/bending", "J", "Bending", "energy of the hinges, mean over frames"),
        ("energy/gravity", "J", "Gravity",
         "weight times height above the pelvis in that frame, mean over frames: its zero moves with the body",
         {"arbitrary_zero": True}),
        ("energy/inertia", "J", "Inertia",
         "sum of m / (2 dt^2) |x - 2 x' + x''|^2 over vertices, x' and x'' the method's own last two frames; "
         "mean over frames"),
        ("energy/collision", "J", "Collision",
         "cubic penalty of vertices, edge midpoints and centroids nearer to the body than the margin, "
         "contact planes searched at the method's own positions; mean over frames"),
        ("energy/total", "J", "Total",
         "sum of all terms that the scene declares, and inertia; its zero is that of gravity",
         {"arbitrary_zero": True}),
        ("energy/*", "J", "{}", "energy of that term, mean over frames"),
        table="energies", lower_is_better=True,
    ),
    measure=measure_energy, series=series,
)  # fmt: skip
PRINTED_BENDING = Measurements(
    "printed_bending",
    metrics_of(
        ("energy/bending_printed", "J", "Bending, as printed",
         "energy of the hinges as the SNUG paper prints it, k/2 theta^2; no part of the total; mean over "
         "frames"),
        lower_is_better=True,
    ),
    measure=measure_printed_bending,
)  # fmt: skip
