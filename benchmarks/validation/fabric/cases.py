"""Cases of suite fabric: converged answers of the reference, beside published targets."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from benchmarks.fabrics.fabric import FABRICS, Fabric, find_fabric
from benchmarks.validation.case import Case

GAMMAS = tuple(round(10 ** (power / 2), 2) for power in range(-2, 7))  # four decades
COLUMNS = (80, 160, 320)


def _case(name: str, description: str, module: str, function: str, **declared: Any) -> Case:
    module = f"benchmarks.validation.{module}"
    return Case(
        name=name, suite="fabric", description=description, module=module, function=function, **declared
    )


MASTER_CURVE = tuple(
    _case(f"master_curve_{gamma:g}_{columns}",
        f"height over width of a cantilever at Gamma = {gamma:g}, {columns} cells, over the elastica's",
        "shells.elastica", "slenderness", options={"gamma": gamma, "columns": columns}, expected=1.0,
        tolerance=0.01, reason="the aim; what is left falls with the square of the cell",
        smoke=(gamma, columns) == (GAMMAS[4], COLUMNS[0]))
    for gamma in GAMMAS
    for columns in COLUMNS
)  # fmt: skip

CANTILEVER = (
    _case("astm_d1388_angle", "angle of the elastica's chord at twice its bending length; ASTM D1388: 41.5",
        "fabric.cantilever", "standard_angle", unit="degrees", expected=41.5, tolerance=0.05, smoke=True,
        reason="the standard gives one decimal"),
    _case("peirce_formula", "bending length by Peirce's formula at that angle, over the elastica's",
        "fabric.cantilever", "peirce_formula", reason="reported: the error of a formula of 1930"),
    *(
        _case(f"bending_length_{columns}_cells_{rate}_steps",
            f"bending length of SNUG's fabric by a simulated strip of {columns} cells, {rate} steps a second",
            "fabric.cantilever", "simulated_bending_length", unit="mm",
            options={"columns": columns, "rate": rate}, tolerance=0.17,
            reason="1 % of it")
        for columns, rate in ((14, 30), (28, 30), (56, 30), (28, 60), (28, 120))
    ),
    _case("lateral_buckling_own_weight",
        "weight at which a strip on edge buckles sideways, over 12.85 (EI GJ)^0.5 / L^2",
        "shells.lateral_buckling", "critical_load", options={"where": "weight", "slender": 0.02},
        expected=1.0, tolerance=0.03, reason="the clamp holds back warping over a width, 2 % of the length"),
)  # fmt: skip

# kappa L -> Gamma at which an arc on edge gives way, C / B = 3: Kirchhoff's rod, bend_twist.critical_gamma.
ARCS = {1.0: 146.4, 2.0: 50.5, 3.0: 30.9, 4.0: 24.6, 5.0: 23.6, 6.0: 26.1}
CURLS = ((1.0, 1.0), (3.0, 1.0), (3.0, 10.0), (5.0, 1.0), (5.0, 100.0))  # kappa L, Gamma

BEND_TWIST = (
    *(
        _case(f"bend_twist_arc_{curvature:g}",
            f"weight at which a hanging arc on edge, kappa L = {curvature:g}, gives way, over Kirchhoff's "
            f"rod: Gamma = {gamma:g}",
            "fabric.bend_twist", "hanging_arc", options={"curvature": curvature}, expected=1.0,
            tolerance=0.01, reason="two meshes extrapolated; width 2 % of the length, stiff on edge")
        for curvature, gamma in ARCS.items()
    ),
    *(
        _case(f"bend_twist_leaves_plane_{curvature:g}",
            f"weight from which on the minimiser takes that arc out of its plane, kappa L = {curvature:g}, "
            "over that of its tangent stiffness",
            "fabric.bend_twist", "leaves_plane", options={"curvature": curvature}, expected=1.0,
            tolerance=0.015, reason="planar at 0.985, out of its plane at 1.01", smoke=curvature == 3.0)
        for curvature in (1.0, 3.0, 5.0)
    ),
    *(
        _case(f"bend_twist_curl_{curvature:g}_{gamma:g}",
            f"tip of a hanging strip of rest curvature, kappa L = {curvature:g}, Gamma = {gamma:g}, pushed "
            "aside at the start: distance to the planar elastica's, over the length",
            "fabric.curled_strip", "tip_distance", options={"curvature": curvature, "gamma": gamma},
            expected=0.0, tolerance=0.002, reason="two meshes extrapolated", smoke=curvature == 3.0)
        for curvature, gamma in CURLS
    ),
)  # fmt: skip

# Strain -> friction below which the tip slips: elastica, stick_slip.critical_friction.
STRAINS = {0.05: 0.1035, 0.1: 0.1528, 0.15: 0.1959, 0.2: 0.2378, 0.25: 0.2807}

STICK_SLIP = (
    *(
        _case(f"stick_slip_ratio_{strain:g}",
            f"friction over pressure at the tip of a strip pressed on end by {strain:g} of its length, over "
            f"the elastica's {friction:g}",
            "fabric.stick_slip", "force_ratio", options={"strain": strain}, expected=1.0, tolerance=0.005,
            reason="60 cells: at most 0.0012", smoke=strain == 0.1)
        for strain, friction in STRAINS.items()
    ),
    *(
        _case(f"stick_slip_breaks_loose_{strain:g}",
            f"strain at which that strip breaks loose as its clamp is lowered, mu = {friction:g}, over the "
            f"elastica's {strain:g}",
            "fabric.stick_slip", "breaking_loose", options={"mu": friction}, expected=1.0, tolerance=0.005,
            reason="steps of 0.0002 of the strain", smoke=strain == 0.1)
        for strain, friction in STRAINS.items()
    ),
)  # fmt: skip

# Drape coefficients [%] of classes of fabrics: where published, see docs/fabric.md for the sources.
BANDS = {
    "silk": (20.0, 40.0), "cotton": (60.0, 76.0), "wool": (40.0, 70.0), "leather": (47.0, 70.0),
    "denim": (70.0, 90.0),
}  # fmt: skip
COTTON = 68.4  # measured by Gan, Ly and Steven 1991, doi 10.1080/00405009108658741
RINGS = (5, 7, 10, 14)
REPORTED = "reported: no target of its own"

DRAPE = (
    *(
        _case(f"drape_{fabric.name}_{rings}_rings_{rate}_steps",
            f"drape coefficient, {1e3 * fabric.density:.0f} g/m2, bending length "
            f"{1e3 * fabric.bending_length:.1f} mm; {rings} rings, {rate} steps a second",
            "fabric.drape", "drape", unit="%",
            options={"fabric": fabric.name, "rings": rings, "rate": rate},
            expected=COTTON if fabric.name.startswith("snug") else None, reason=REPORTED)
        for fabric in FABRICS
        for rings, rate in (*((rings, 30) for rings in RINGS), (7, 60), (7, 120))
    ),
    _case("drape_snug_membrane_x10", "the same of SNUG's fabric with ten times its membrane, 7 rings",
        "fabric.drape", "drape", unit="%", options={"fabric": "snug", "membrane_factor": 10.0},
        expected=COTTON, reason=REPORTED),
    _case("drape_snug_without_poisson_effect",
        "the same with the energy that takes nu = -1/3 of hinges to 0, 7 rings",
        "fabric.drape", "drape", unit="%", options={"fabric": "snug", "poisson_ratio": "zero"},
        expected=COTTON, reason=REPORTED),
    *(
        _case(f"drape_band_{fabric}_{end}",
            f"bending length at which the reference's disc has the {end} drape coefficient published of "
            f"{fabric}, {coefficient:g} %",
            "fabric.drape", "bending_length_at", unit="mm", options={"coefficient": coefficient},
            reason=REPORTED)
        for fabric, band in BANDS.items()
        for end, coefficient in zip(("least", "largest"), band)
    ),
)  # fmt: skip

TEXTILE_TESTS: tuple[Case, ...] = (*MASTER_CURVE, *CANTILEVER, *BEND_TWIST, *STICK_SLIP, *DRAPE)


def percentiles(fabrics: Sequence[Fabric]) -> tuple[Case, ...]:
    """Return the cases that say where SNUG's fabric lies among a user's, as scaled and as printed.

    >>> [case.run().value for case in percentiles(FABRICS[:2])]
    [100.0, 100.0]
    """
    lengths = tuple(fabric.bending_length for fabric in fabrics)
    return tuple(
        _case(f"percentile_{fabric.name}",
            f"share of {len(fabrics)} measured fabrics whose bending length is below "
            f"{1e3 * fabric.bending_length:.1f} mm, SNUG's {title}",
            "fabric.measured", "percentile", unit="%", smoke=True, reason=REPORTED,
            options={"length": fabric.bending_length, "lengths": lengths})
        for fabric, title in ((find_fabric("snug"), "as scaled"), (find_fabric("snug_printed"), "as printed"))
    )  # fmt: skip
