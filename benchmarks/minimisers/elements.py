"""The terms of a potential as arrays for sweeps over its elements, and the loop of sweeps."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from reference_sim import Potential
    from reference_sim.energies import BendHinge, ContactPenalty, Energy, Gravity, Inertia, StretchStVK
    from reference_sim.minimise import Result
    from reference_sim.minimise.descent import Descent


# By the names of the classes: a term that the potential does not have is not even imported.
KINDS = {
    "Inertia": "inertia", "Gravity": "gravity", "StretchStVK": "strain", "BendHinge": "bending",
    "ContactPenalty": "contact",
}  # fmt: skip
FAR = 100.0  # [m] from the guess: nowhere


@dataclass(frozen=True)
class Terms:
    """The terms of a potential by kind; None where it has no such term."""

    inertia: Inertia
    gravity: Gravity | None
    strain: StretchStVK | None
    bending: BendHinge | None
    contact: ContactPenalty | None


def terms_of(potential: Potential, sweeper: str) -> Terms:
    """The terms that the sweeps know. Raises ValueError naming the term that `sweeper` has no sweep for."""
    found: dict[str, Energy | None] = dict.fromkeys(KINDS.values())
    for energy in potential.energies:
        kind = KINDS.get(type(energy).__name__)
        if kind is None or found[kind] is not None:
            raise ValueError(f"{sweeper} has no sweep for the term {energy.name!r}: use newton or lbfgs")
        found[kind] = energy
    if found["inertia"] is None:
        raise ValueError(f"{sweeper} takes steps in time: the potential needs inertia")
    return Terms(**found)  # type: ignore[arg-type]


def membrane(term: StretchStVK | None) -> tuple:
    """faces, Dm^-1, areas, lambda, mu for a kernel; no faces without the term."""
    if term is None:
        return np.zeros((0, 3), np.int64), np.zeros((0, 2, 2)), np.zeros(0), 0.0, 0.0
    return _whole(term.stencils), term.Dm_inverse, term.areas, float(term.lam), float(term.mu)


def hinges(term: BendHinge | None) -> tuple:
    """hinges, stiffness, rest angles for a kernel; none without the term."""
    if term is None:
        return np.zeros((0, 4), np.int64), np.zeros(0), np.zeros(0)
    return _whole(term.stencils), term.stiffness, term.rest_angles


def contacts(term: ContactPenalty | None) -> tuple:
    """stencils, weights, stiffness, margin, points, normals for a kernel, as the step has frozen them."""
    if term is None:
        none = np.zeros((0, 3))
        return np.zeros((0, 3), np.int64), none, np.zeros(0), 0.0, none, none
    planes = np.ascontiguousarray(term.points), np.ascontiguousarray(term.normals)
    return _whole(term.stencils), term.weights, term.stiffness, term.margin, *planes


def weights(terms: Terms) -> np.ndarray:
    """Weight of each vertex [N], (V,); zero without gravity."""
    return np.zeros_like(terms.inertia.masses) if terms.gravity is None else terms.gravity.weights


def _whole(stencils: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(stencils, dtype=np.int64)


def runaway(x: np.ndarray, x0: np.ndarray) -> bool:
    """Whether a vertex is nowhere, or FAR from where it began."""
    return not (np.isfinite(x).all() and np.abs(x - x0).max(initial=0.0) < FAR)


def swept(
    run: Descent, x: np.ndarray, x0: np.ndarray, most: int, sweep: Callable[[np.ndarray], object]
) -> Result:
    """Sweep x (V, 3) [m] in place so many times; "diverged" where that runs away from x0."""
    while run.iterations < most:
        sweep(x)
        run.iterations += 1
        if runaway(x, x0):
            return run.result("diverged", f"sweep {run.iterations} threw a vertex far away")
    run.x = x
    run.value, run.g = run.evaluate(x)
    return run.result("max_iterations", f"{run.iterations} sweeps done")
