"""Fabric: its mass per area and flexural rigidities; the fabrics of suite fabric."""

from __future__ import annotations

import re
from dataclasses import dataclass

from reference_sim.material import GRAVITY, Material

SNUG = Material()
SCALED, PRINTED = 1 / 4, 3**0.5 / 2  # rigidity of a plate of equilateral triangles over k of its hinges


@dataclass(frozen=True)
class Fabric:
    """Fabric as textile laboratories describe it.

    Attributes:
        name: in scenes and tables.
        density: mass per area [kg/m^2].
        warp, weft: flexural rigidity per width along each direction [N m].

    >>> round(1e3 * Fabric("cotton", 0.2, 1e-5, 1e-5).bending_length, 1)  # [mm]
    17.2
    """

    name: str
    density: float
    warp: float
    weft: float

    @property
    def rigidity(self) -> float:
        """Overall flexural rigidity (warp weft)^(1/2) [N m], as ASTM D1388 defines it."""
        return (self.warp * self.weft) ** 0.5

    @property
    def bending_length(self) -> float:
        """Bending length c = (rigidity / weight per area)^(1/3) [m] (Peirce 1930)."""
        return (self.rigidity / (self.density * GRAVITY)) ** (1 / 3)


def plain_name(text: str) -> str:
    """Return a fabric's name as scenes can carry it, maybe empty.

    >>> plain_name(" twill 2/1 ")
    'twill_2_1'
    """
    return re.sub(r"[^A-Za-z0-9_.+-]+", "_", text.strip()).strip("_")


def isotropic(name: str, density: float, bending_length: float) -> Fabric:
    """Return the fabric of that mass per area [kg/m^2] and bending length [m]."""
    rigidity = density * GRAVITY * bending_length**3
    return Fabric(name, density, rigidity, rigidity)


# SNUG's cotton by both readings of its bending term, and round numbers inside the range of measured cloth:
# thin and thick, limp and stiff, so that an order of bending lengths is no order of weights.
FABRICS = (
    isotropic("thin_limp", 0.06, 14e-3),
    isotropic("thick_limp", 0.40, 16e-3),
    Fabric("snug", SNUG.areal_density, SNUG.bending_stiffness * SCALED, SNUG.bending_stiffness * SCALED),
    isotropic("thin_crisp", 0.08, 22e-3),
    Fabric(
        "snug_printed", SNUG.areal_density, SNUG.bending_stiffness * PRINTED, SNUG.bending_stiffness * PRINTED
    ),
    isotropic("thick_stiff", 0.38, 32e-3),
)


def find_fabric(name: str) -> Fabric:
    """Return one of FABRICS by its name."""
    return next(fabric for fabric in FABRICS if fabric.name == name)
