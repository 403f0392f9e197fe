"""Cusick's drape by the reference: on several meshes and time steps, and what changes it."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np

from benchmarks.fabrics.disc import DRAPE, Disc, disc
from benchmarks.fabrics.fabric import find_fabric, isotropic
from benchmarks.validation.equilibrium import demand_converged
from benchmarks.validation.plates import GaussianCurvature
from reference_sim.energies.bend_hinge import BendHinge
from reference_sim.energies.energy import Energy
from reference_sim.energies.gravity import Gravity
from reference_sim.energies.stretch_stvk import StretchStVK
from reference_sim.time_loop import simulate

SECONDS = 1.5  # [s] in which the disc falls and comes nearly to rest
SETTLING = 15  # steps without velocity that follow, of 1/30 s
RINGS, RATE = 7, 30  # of triangles; time steps a second
LADDER = tuple(1e-3 * np.array([7.0, 9.0, 11.0, 13.0, 16.0, 19.0, 22.0, 25.0, 28.0, 32.0, 37.0]))  # [m]
LADDER_DENSITY = 0.2  # [kg/m^2]


def drape(
    fabric: str, *, rings: int = RINGS, rate: int = RATE, membrane_factor: float = 1.0,
    poisson_ratio: str = "hinges",
) -> float:  # fmt: skip
    """Return the drape coefficient [%] of one of FABRICS at rest.

    Args:
        fabric: its name.
        rings: of triangles that overhang.
        rate: time steps a second on its way to rest.
        membrane_factor: times SNUG's membrane.
        poisson_ratio: "hinges" for that of the hinges, -1/3, or "zero".
    """
    material = find_fabric(fabric)
    specimen = disc(material, rings, membrane_factor)
    if poisson_ratio == "zero":
        further = [GaussianCurvature.without_poisson_effect(specimen.cloth, material.rigidity)]
        return at_rest(specimen, rate, further)
    return at_rest(specimen, rate)


def at_rest(specimen: Disc, rate: int = RATE, further: Sequence[Energy] = ()) -> float:
    """Return the drape coefficient [%] of a specimen at rest. Raises RuntimeError where a step fails."""
    cloth = specimen.cloth
    energies = [StretchStVK(cloth), BendHinge(cloth), Gravity(cloth), *further]
    falling = simulate(cloth, energies, dt=1 / rate, frames=round(SECONDS * rate), start=specimen.start)
    last = demand_converged(falling, "the falling disc").positions[-1]
    settling = simulate(cloth, energies, dt=1 / RATE, frames=SETTLING, start=last, quasi_static=True)
    return specimen.measure(demand_converged(settling, "the disc near rest").positions[-1])[DRAPE]


@cache
def ladder() -> np.ndarray:
    """Return the drape coefficients [%] of fabrics of LADDER's bending lengths."""
    fabrics = [isotropic("ladder", LADDER_DENSITY, float(length)) for length in LADDER]
    return np.array([at_rest(disc(fabric, RINGS)) for fabric in fabrics])


def bending_length_at(coefficient: float) -> float:
    """Return the bending length [mm] at which the reference's disc has that drape coefficient [%]."""
    coefficients = np.maximum.accumulate(ladder())
    return 1e3 * float(np.interp(coefficient, coefficients, LADDER))
