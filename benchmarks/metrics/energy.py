"""Metrics energy/*: every declared term at every frame, by the very terms that were minimised.

Each method is judged on its own history: inertia compares a frame with the two before it in the same
trajectory, and contact planes are searched at the method's own positions. A frame before the third has no
two before it; it counts as moving freely, hence inertia 0 there. Means are over the frames after the warm-up.

"Sudden motion changes naturally produce peaks in the inertial term", the paper says. `inertia/correlation` is
Pearson's between two root mean square accelerations by mass, each the square root of an inertia: the
method's, and that of the garment that the body's joints move alone. It says whether the one peaks where the
other does, not how high.

Metric energy/bending_printed: bending of the same hinges as the SNUG paper prints them, not scaled.

Papers of the field give one or the other under the same name. It is no part of the total.

Metrics excess/*: energy above that of the vertices optimised directly, the lowest found.

The lowest is what optimising all vertices of the scene directly has found (the method whose role is "bound"):
what a dresser could reach whose output were not bound to its input. It is the lowest in the sum of all terms,
so in the sum without gravity a method may lie below it.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from benchmarks.metric import Measurements, Metric, skinned
from reference_sim.energies.energy import Step
from reference_sim.energies.gravity import Gravity
from reference_sim.energies.inertia import Inertia

if TYPE_CHECKING:
    from benchmarks.metric import RollOut, SceneRollOuts
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


FIRST_FULL_FRAME = 2


def _energy(term: str, definition: str, title: str = "", *, arbitrary_zero: bool = False) -> Metric:
    return Metric(
        name=f"energy/{term}", unit="J", title=title or term.capitalize(), definition=definition,
        table="energies", lower_is_better=True, arbitrary_zero=arbitrary_zero,
    )  # fmt: skip


ENERGY_METRICS = (
    _energy("strain", "membrane energy of the declared material, mean over frames"),
    _energy("bending", "energy of the hinges, mean over frames"),
    _energy("gravity", "weight times height above the pelvis in that frame, mean over frames: its zero moves "
            "with the body", arbitrary_zero=True),
    _energy("inertia", "sum of m / (2 dt^2) |x - 2 x' + x''|^2 over vertices, x' and x'' the method's "
            "own last two frames; mean over frames"),
    _energy("collision", "cubic penalty of vertices, edge midpoints and centroids nearer to the body than "
            "the margin, contact planes searched at the method's own positions; mean over frames"),
    _energy("total", "sum of all terms that the scene declares, and inertia; its zero is that of gravity",
            arbitrary_zero=True),
    _energy("*", "energy of that term, mean over frames", "{}"),
    Metric(
        name="inertia/correlation", unit="1", title="Inertia with the body's",
        definition="correlation over frames of the square roots of two inertias: the method's, and that of "
        "the garment skinned to the poses, which is the body's acceleration where the garment lies",
    ),
)  # fmt: skip


def energy_series(
    scene: BuiltScene, trajectories: Sequence[NDArray[np.float64]]
) -> list[dict[str, NDArray[np.float64]]]:
    """Return energies of each trajectory: term -> (T,) [J], plus "total".

    Frames are the outer loop: what belongs to a frame alone, as an obstacle's search tree, is made once.

    Args:
        scene: its terms are evaluated; terms that are not declared have no entry.
        trajectories: positions (T,V,3) [m] each.

    >>> from benchmarks.presets import find_preset
    >>> from benchmarks.scenes import find_scene
    >>> scene = find_scene("hanging_sheet").at(find_preset("smoke")).build()
    >>> still = scene.cloth.rest_positions[None].repeat(3, axis=0)
    >>> {term: abs(round(float(series[2]), 9)) for term, series in energy_series(scene, [still])[0].items()}
    {'strain': 0.0, 'bending': 0.0, 'gravity': 0.0, 'inertia': 0.0, 'total': 0.0}
    """
    copies = [copied_terms(scene) for _ in trajectories]
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
    scene: BuiltScene, terms: Sequence[Energy], positions: NDArray[np.float64], frame: int
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
    """Return mean energies over the evaluated frames [J per frame], and the correlation of inertia."""
    by_term = energies(roll_out)
    means = {f"energy/{term}": float(series[roll_out.judged].mean()) for term, series in by_term.items()}
    correlation = correlation_with_body(roll_out)
    return means if correlation is None else means | {"inertia/correlation": correlation}


def series(roll_out: RollOut) -> dict[str, NDArray[np.float64]]:
    """Return energies of every frame, (T,) [J] each."""
    return {f"energy/{term}": series for term, series in energies(roll_out).items()}


def energies(roll_out: RollOut) -> dict[str, NDArray[np.float64]]:
    """Return term -> (T,) [J], and "total"; computed for all roll-outs of the scene at once."""
    return roll_out.group.kept(_of_all)[roll_out.place]


def _of_all(group: SceneRollOuts) -> list[dict[str, NDArray[np.float64]]]:
    return energy_series(group.scene, group.positions)


def correlation_with_body(roll_out: RollOut) -> float | None:
    """Return the correlation of the method's accelerations with the body's.

    None without a body, where frames of the motion are left out, or where one of the two does not vary.
    """
    group = roll_out.group
    bare = group.kept(skinned)
    if bare is None or group.scene.kept is not None:
        return None
    frames = roll_out.judged_beside(bare)
    masses = group.scene.cloth.masses
    ours, body = (accelerations(x, masses, group.scene.dt)[frames] for x in (roll_out.positions, bare))
    if len(ours) < 3 or min(np.ptp(size) / size.max(initial=1e-300) for size in (ours, body)) < 1e-9:
        return None
    return float(np.corrcoef(ours, body)[0, 1])


def accelerations(
    positions: NDArray[np.float64], masses: NDArray[np.float64], dt: float
) -> NDArray[np.float64]:
    """Return root mean square accelerations by mass, (T,) [m/s^2]; the first two are 0.

    Half the whole mass times dt^2 times their square is the inertia energy.

    Args:
        positions: (T,V,3) [m].
        masses: (V,) [kg].
        dt: [s].
    """
    sizes = np.zeros(len(positions))
    squared = (np.diff(positions, 2, axis=0) ** 2).sum(2)
    sizes[FIRST_FULL_FRAME:] = np.sqrt(squared @ masses / masses.sum()) / dt**2
    return sizes


PRINTED_BENDING_METRICS = (
    Metric(
        name="energy/bending_printed", unit="J", title="Bending, as printed", lower_is_better=True,
        definition="energy of the same hinges without their scale, k/2 theta^2 as the SNUG paper prints it; "
        "no part of the total; mean over frames",
    ),
)  # fmt: skip


def measure_printed_bending(roll_out: RollOut) -> dict[str, float]:
    """Return the mean [J per frame]; empty where the scene's own hinges are not scaled."""
    from reference_sim.energies.bend_hinge import BendHinge  # loads numba

    hinges = [term for term in roll_out.scene.energies if isinstance(term, BendHinge)]
    if [term.scaling for term in hinges] != ["length_area"]:
        return {}
    printed = BendHinge(hinges[0].cloth, scaling="none", rest_angles=hinges[0].rest_angles)
    frames = map(np.ascontiguousarray, roll_out.positions[roll_out.judged])
    return {"energy/bending_printed": float(np.mean([printed.value_and_gradient(x)[0] for x in frames]))}


_metric_excess = partial(Metric, unit="J", table="energies", lower_is_better=True)

EXCESS_METRICS = (
    _metric_excess(name="excess/total", title="Excess",
            definition="sum of all terms less that of the vertices optimised directly, mean over frames"),
    _metric_excess(name="excess/without_gravity", title="Excess without gravity",
            definition="the same difference without gravity, which a method can lower by letting the cloth "
            "sag"),
)  # fmt: skip


def measure_excess(roll_out: RollOut) -> dict[str, float]:
    """Return the mean excess [J per frame], with and without gravity; empty without the bound."""
    lowest = roll_out.group.find(role="bound")
    if lowest is None or lowest is roll_out:
        return {}
    ours, theirs = energies(roll_out), energies(lowest)
    frames = roll_out.judged_beside(lowest.positions)
    above = {name: float((ours[name][frames] - theirs[name][frames]).mean()) for name in ours}
    return {
        "excess/total": above["total"],
        "excess/without_gravity": above["total"] - above.get("gravity", 0.0),
    }


ENERGY = Measurements("energy", ENERGY_METRICS, measure=measure_energy, series=series)

PRINTED_BENDING = Measurements("printed_bending", PRINTED_BENDING_METRICS, measure=measure_printed_bending)

EXCESS = Measurements("excess", EXCESS_METRICS, measure=measure_excess)
