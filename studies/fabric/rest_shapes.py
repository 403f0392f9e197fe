"""Rest shapes by the reference: master curve, bending length of ASTM D1388, drape on several meshes."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np

from benchmarks import known_answer
from benchmarks.validation.clamped_strip import exact_elastica
from benchmarks.validation.equilibrium import demand_converged
from benchmarks.validation.large_bending import bent_strip, critical_load
from benchmarks.validation.plates import NU, GaussianCurvature
from fabrics import FABRICS, find_fabric, isotropic, measured_fabrics
from reference_sim import simulate
from reference_sim.energies import BendHinge, Energy, Gravity, StretchStVK
from specimens import BENDING_LENGTH, DRAPE, FAMILY, OVERHANG, Disc, cantilever, disc

GAMMAS = tuple(round(10 ** (power / 2), 2) for power in range(-2, 7))  # four decades
COLUMNS = (80, 160, 320)
SECONDS = 1.5  # [s] in which a specimen falls and comes nearly to rest
SETTLING = 15  # steps without velocity that follow, of 1/30 s
RINGS, RATE = 7, 30  # of triangles; time steps a second
DISCS = ((5, 30), (7, 30), (10, 30), (14, 30), (7, 60), (7, 120))  # rings and rates of the drapes
LADDER = tuple(1e-3 * np.array([7.0, 9.0, 11.0, 13.0, 16.0, 19.0, 22.0, 25.0, 28.0, 32.0, 37.0]))  # [m]
LADDER_DENSITY = 0.2  # [kg/m^2]
# Drape coefficients [%] of classes of fabrics: where published, see README.md for the sources.
BANDS = {
    "silk": (20.0, 40.0), "cotton": (60.0, 76.0), "wool": (40.0, 70.0), "leather": (47.0, 70.0),
    "denim": (70.0, 90.0),
}  # fmt: skip
COTTON = 68.4  # measured by Gan, Ly and Steven 1991, doi 10.1080/00405009108658741
REPORTED = "reported: no target of its own"


# --- strips ------------------------------------------------------------------------------------------------


@known_answer(
    {f"master_curve_{gamma:g}_{columns}": {"gamma": gamma, "columns": columns}
     for gamma in GAMMAS for columns in COLUMNS},
    expected=1.0, tolerance=0.01, reason="the aim; what is left falls with the square of the cell",
)  # fmt: skip
def slenderness(gamma: float, columns: int) -> float:
    """Return height over width of a cantilever at that Gamma, on `columns` cells, over the elastica's."""
    ours, exact = bent_strip(FAMILY, gamma, 0.0, columns)
    return float((ours[1] / ours[0]) / (exact[1] / exact[0]))


@known_answer(
    ["astm_d1388_angle"], unit="degrees", expected=41.5, tolerance=0.05,
    reason="the standard gives one decimal",
)  # fmt: skip
def standard_angle() -> float:
    """Return the angle [degrees] of the elastica's chord where it overhangs by twice its bending length."""
    x, drop = exact_elastica(OVERHANG**3, 0.0)[1]
    return float(np.degrees(np.arctan2(drop[-1], x[-1])))


@known_answer(reason="reported: the error of a formula of 1930")
def peirce_formula() -> float:
    """Return Peirce's c = l (cos(angle / 2) / (8 tan(angle)))^(1/3) at that angle, over the elastica's."""
    angle = np.radians(standard_angle())
    return float(OVERHANG * (np.cos(angle / 2) / (8 * np.tan(angle))) ** (1 / 3))


@known_answer(
    {f"bending_length_{columns}_cells_{rate}_steps": {"columns": columns, "rate": rate}
     for columns, rate in ((14, 30), (28, 30), (56, 30), (28, 60), (28, 120))},
    unit="mm", tolerance=0.17, reason="1 % of it",
)  # fmt: skip
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


@known_answer(
    ["lateral_buckling_own_weight"], expected=1.0, tolerance=0.03,
    reason="the clamp holds back warping over a width, 2 % of the length",
)  # fmt: skip
def buckling_weight() -> float:
    """Return the weight at which a strip on edge buckles sideways, over 12.85 (EI GJ)^0.5 / L^2."""
    return critical_load("weight", slender=0.02)


# --- discs -------------------------------------------------------------------------------------------------


def _drapes(fabrics: Sequence[str]) -> dict[str, dict[str, str | int]]:
    """Return name -> options of the drapes of some fabrics, on several meshes and at several time steps."""
    return {
        f"drape_{fabric}_{rings}_rings_{rate}_steps": {"fabric": fabric, "rings": rings, "rate": rate}
        for fabric in fabrics
        for rings, rate in DISCS
    }


SNUGS = [fabric.name for fabric in FABRICS if fabric.name.startswith("snug")]
OTHERS = [fabric.name for fabric in FABRICS if not fabric.name.startswith("snug")]


@known_answer(_drapes(OTHERS), unit="%", reason=REPORTED)
@known_answer(
    {
        **_drapes(SNUGS),
        "drape_snug_membrane_x10": {"fabric": "snug", "membrane_factor": 10.0},
        "drape_snug_without_poisson_effect": {"fabric": "snug", "poisson_ratio": "zero"},
    },
    unit="%", expected=COTTON, reason=REPORTED,
)  # fmt: skip
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
    zero = poisson_ratio == "zero"
    extras = [GaussianCurvature(specimen.cloth, -NU * material.rigidity)] if zero else []
    return at_rest(specimen, rate, extras)


def at_rest(specimen: Disc, rate: int = RATE, extras: Sequence[Energy] = ()) -> float:
    """Return the drape coefficient [%] of a specimen at rest. Raises RuntimeError where a step fails."""
    cloth = specimen.cloth
    energies = [StretchStVK(cloth), BendHinge(cloth), Gravity(cloth), *extras]
    falling = simulate(cloth, energies, dt=1 / rate, frames=round(SECONDS * rate), start=specimen.start)
    last = demand_converged(falling, "the falling disc").positions[-1]
    settling = simulate(cloth, energies, dt=1 / RATE, frames=SETTLING, start=last, quasi_static=True)
    return specimen.measure(demand_converged(settling, "the disc near rest").positions[-1])[DRAPE]


@cache
def ladder() -> np.ndarray:
    """Return the drape coefficients [%] of fabrics of LADDER's bending lengths."""
    fabrics = [isotropic("ladder", LADDER_DENSITY, float(length)) for length in LADDER]
    return np.array([at_rest(disc(fabric, RINGS)) for fabric in fabrics])


@known_answer(
    {f"drape_band_{fabric}_{end}": {"coefficient": coefficient}
     for fabric, band in BANDS.items() for end, coefficient in zip(("least", "largest"), band)},
    unit="mm", reason=REPORTED,
)  # fmt: skip
def bending_length_at(coefficient: float) -> float:
    """Return the bending length [mm] at which the reference's disc has that drape coefficient [%]."""
    coefficients = np.maximum.accumulate(ladder())
    return 1e3 * float(np.interp(coefficient, coefficients, LADDER))


# --- measured fabrics of a user ----------------------------------------------------------------------------


def percentile(length: float, lengths: Sequence[float]) -> float:
    """Return the share of bending lengths that are below `length` [%], half of those that equal it.

    >>> percentile(3.0, [1.0, 2.0, 3.0, 4.0])
    62.5
    """
    below = sum(other < length for other in lengths) + 0.5 * sum(other == length for other in lengths)
    return 100.0 * below / len(lengths)


if measured := tuple(fabric.bending_length for fabric in measured_fabrics()):
    known_answer(
        {f"percentile_{name}": {"length": find_fabric(name).bending_length, "lengths": measured}
         for name in SNUGS},
        description=f"share of {len(measured)} measured fabrics with a shorter bending length than SNUG's",
        unit="%", reason=REPORTED,
    )(percentile)  # fmt: skip
