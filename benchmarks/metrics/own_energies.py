"""Metric own_excess/total: mean of the energies that a method was trained on, above their simulation's.

    100 (E(x) - E(y)) / (E(s) - E(y)) [%],    E the mean over the evaluated frames

with x the method's roll-out, s the skinned garment, y the simulation with the energies of E. It minimises
each step from its own past, so a roll-out may be below it. Where E is the
energy of the scene, y is the reference and the number the relative excess. For a network that was trained
on others (benchmarks.methods.own_energies) y is the simulation of these, started where the reference
starts. Without inertia E is that of single frames, y the quasi-static solution.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.methods.own_energies import STATIC, find_energies, find_own_reference, is_own_reference
from benchmarks.metric import Measurements, metrics_of
from benchmarks.metrics.energy import energies, energy_series
from benchmarks.results.row import USABLE
from snug.recipe import DEFAULT

if TYPE_CHECKING:
    from benchmarks.metric import Floats, Positions, RollOut, SceneRollOuts
    from snug.recipe import Recipe

NAME = "own_excess/total"


def measure(roll_out: RollOut) -> dict[str, float]:
    """Return the excess where the energies are not the scene's; 0 of their simulation."""
    group, recipe = roll_out.group, find_energies(roll_out.entry)
    bare = group.scene.skinned
    if bare is not None and (roll_out is group.reference or is_own_reference(roll_out.entry)):
        return {NAME: 0.0}
    minimum = None if recipe in (None, DEFAULT) else _find_minimum(roll_out, recipe)
    if bare is None or recipe is None or minimum is None:
        return {}
    from benchmarks.methods.reference_variants import swap_energies  # loads torch

    terms = energy_series(swap_energies(group.scene, recipe), [roll_out.positions, minimum, bare])
    series = [e["total"] if "inertia" in recipe.terms else e["total"] - e["inertia"] for e in terms]
    return _share(series, roll_out.match_frames(minimum))


def compare(roll_out: RollOut, reference: RollOut) -> dict[str, float]:
    """Return the excess over a reference of the scene's energies."""
    bare = roll_out.group.get(_measure_skinning)
    if bare is None or find_energies(roll_out.entry) != DEFAULT:
        return {}
    series = [energies(roll_out)["total"], energies(reference)["total"], bare]
    return _share(series, roll_out.match_frames(reference.positions))


def _find_minimum(roll_out: RollOut, recipe: Recipe) -> Positions | None:
    """Return the minimiser (T,V,3) [m] of these energies; None where no simulation ended well."""
    if recipe == STATIC:
        static = roll_out.group.quasi_static  # of a shipped reference, known at the hem alone
        return static if static is not None and np.isfinite(static).all() else None
    entry = find_own_reference(roll_out.entry)
    others = (other for other in roll_out.group.roll_outs if entry and other.entry.name == entry.name)
    return next((other.positions for other in others if other.status in USABLE), None)


def _measure_skinning(group: SceneRollOuts) -> Floats | None:
    bare = group.scene.skinned
    return None if bare is None else energy_series(group.scene, [bare])[0]["total"]


def _share(series: Sequence[Floats], frames: slice) -> dict[str, float]:
    """Return the excess [%] of a method, from its energies (T,), those of the minimiser and of skinning.

    Empty where skinning does not lie above the minimiser: there is no such share.
    """
    method, minimum, bare = (float(energy[frames].mean()) for energy in series)
    return {NAME: 100.0 * (method - minimum) / (bare - minimum)} if bare > minimum else {}


OWN_ENERGIES = Measurements(
    "own_energies",
    metrics_of((
        NAME, "%", "Excess in own energies",
        "excess of the energy that a method was trained on over that of the simulation with this energy, as "
        "a share of skinning's; of a method without training in the scene's energies",
    ), lower_is_better=True),
    measure=measure, compare=compare,
)  # fmt: skip
