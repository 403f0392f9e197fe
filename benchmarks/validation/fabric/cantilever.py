"""Cantilever of ASTM D1388: the standard's angle, Peirce's formula, simulated bending lengths."""

from __future__ import annotations

import numpy as np

from benchmarks.fabrics.elastica import exact_elastica
from benchmarks.fabrics.fabric import find_fabric
from benchmarks.fabrics.strip import BENDING_LENGTH, OVERHANG, cantilever
from benchmarks.validation.equilibrium import demand_converged
from reference_sim.energies.bend_hinge import BendHinge
from reference_sim.energies.gravity import Gravity
from reference_sim.energies.stretch_stvk import StretchStVK
from reference_sim.time_loop import simulate

SECONDS = 1.5  # [s] in which the strip comes to rest


def standard_angle() -> float:
    """Return the angle [degrees] of the elastica's chord where it overhangs by twice its bending length."""
    x, drop = exact_elastica(OVERHANG**3, 0.0)[1]
    return float(np.degrees(np.arctan2(drop[-1], x[-1])))


def peirce_formula() -> float:
    """Return Peirce's c = l (cos(angle / 2) / (8 tan(angle)))^(1/3) at that angle, over the elastica's."""
    angle = np.radians(standard_angle())
    return float(OVERHANG * (np.cos(angle / 2) / (8 * np.tan(angle))) ** (1 / 3))


def simulated_bending_length(columns: int, rate: int) -> tuple[float, float]:
    """Return the bending length [mm] of a strip of SNUG's fabric at rest, and that of the fabric.

    Args:
        columns: cells along the strip.
        rate: time steps a second.
    """
    material = find_fabric("snug")
    strip = cantilever(material, columns)
    cloth = strip.cloth
    energies = (StretchStVK(cloth), BendHinge(cloth), Gravity(cloth))
    moved = simulate(cloth, energies, dt=1.0 / rate, frames=round(SECONDS * rate))
    rest = demand_converged(moved, "the strip").positions[-1]
    return strip.measure(rest)[BENDING_LENGTH], 1e3 * material.bending_length
