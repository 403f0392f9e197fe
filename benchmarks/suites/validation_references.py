"""Checks against a reference that is solved independently, by scipy or scikit-fem, in the check itself."""

from __future__ import annotations

from ..check import Check

# C11/k of a lattice is rational or sqrt(3)/2: see benchmarks/checks/plates.py.
PLATES = (
    ("right", "right triangles, all diagonals alike", 1.0, 0.25),
    ("cross", "squares with both diagonals", 3 / 4, 1 / 3),
    ("union_jack", "squares with alternating diagonals", 3 / 4, 5 / 24),
    ("equilateral", "equilateral triangles", 3**0.5 / 2, 0.25),
    ("delaunay", "jittered Delaunay triangles", None, None),
)
SCALINGS = (("unscaled", "none"), ("scaled", "length_area"))

STIFFNESS = tuple(
    Check(
        name=f"plate_stiffness_{family}_{scaling}",
        description=f"C11/k of {scaling} hinges on {title}",
        expected=exact, tolerance=None if exact is None else 3e-4,
        reason="reported: a mean of one patch" if exact is None else "the corners leave (1/24)^2",
        module="plates", function="plate_stiffness", arguments=(family, option),
    )
    for family, title, *both in PLATES
    for (scaling, option), exact in zip(SCALINGS, both)
)  # fmt: skip

# Only equilateral triangles make an isotropic plate: there the number is known, elsewhere it is the price.
SUPPORTED = tuple(
    Check(
        name=f"plate_morley_{family}_{scaling}",
        description=f"D/k of the Kirchhoff plate (Morley) that sags like {scaling} hinges on {title}",
        expected=exact, tolerance=None if exact is None else 0.03 * exact,
        reason="reported: no plate of one D" if exact is None else "edges on the border have no hinge",
        module="plates", function="supported_plate", arguments=(family, option),
    )
    for family, title, *_ in PLATES
    for scaling, option in SCALINGS
    for exact in [{"none": 3**0.5 / 2, "length_area": 0.25}[option] if family == "equilateral" else None]
)  # fmt: skip

ELASTICA = (
    *(
        Check(
            name=f"heavy_elastica_{gamma}",
            description=f"tip of a cantilever at Gamma = {gamma}, distance to the elastica, worst of 4",
            expected=0.0, tolerance=tolerance, reason="96 cells, their error halves with the cell",
            module="elastica", function="heavy", arguments=(float(gamma),),
        )
        for gamma, tolerance in ((1, 1e-4), (10, 3e-3), (100, 6e-3), (1000, 6e-3))
    ),
    *(
        Check(
            name=f"end_loaded_cantilever_{load}",
            description=f"the same with a force of {load} D/L^2 at the end and no weight",
            expected=0.0, tolerance=3e-3, reason="96 cells, their error halves with the cell",
            module="elastica", function="end_loaded", arguments=(float(load),),
        )
        for load in (1, 3, 10)
    ),
    Check(
        name="elastica_one_sided_diagonals",
        description="the same at Gamma = 10 on right triangles whose diagonals all lean one way",
        reason="reported: such a strip twists as it bends and is no elastica",
        module="elastica", function="one_sided_diagonals", arguments=(10.0,),
    ),
    Check(
        name="bending_spread",
        description="largest over smallest bending stiffness of a strip at one k, over 5 meshes",
        reason="reported: the price of unscaled hinges",
        module="elastica", function="stiffness_spread",
    ),
)  # fmt: skip

OTHERS = (
    Check(
        name="clamped_stretch_force",
        description="pull on a square sheet stretched by 1.2 between clamps, against P2 of scikit-fem",
        unit="N", tolerance=0.01, reason="32 cells beside the singular corners of the clamps",
        module="clamped_stretch", function="force",
    ),
    Check(
        name="clamped_stretch_neck",
        description="its width half-way between the clamps",
        unit="m", tolerance=3e-4, reason="32 cells beside the singular corners of the clamps",
        module="clamped_stretch", function="neck",
    ),
    Check(
        name="drum_tension",
        description="tension along a strip over a frictionless cylinder, worst error over the mean",
        expected=0.0, tolerance=5e-3, reason="120 cells, and one of contact at each end of the arc",
        module="round_bodies", function="drum_tension", smoke=True,
    ),
    Check(
        name="drum_pressure",
        description="mean contact pressure over (tension/R + w cos phi)",
        expected=1.0, tolerance=2e-3, reason="120 cells; the strip's depth in the margin over R",
        module="round_bodies", function="drum_pressure", smoke=True,
    ),
    Check(
        name="leaving_point",
        description="cos theta where a point leaves a sphere, over 2/3 cos theta_0, extrapolated in dt",
        expected=1.0, tolerance=2e-3, reason="second order in dt; the point's depth over R",
        module="round_bodies", function="leaving_point", smoke=True,
    ),
    Check(
        name="lateral_buckling",
        description="buckling load of a strip on edge, over 4.0126 (EI GJ)^0.5 / L^2",
        expected=1.0, tolerance=0.03, reason="the clamp holds back warping over a width, 4 % of the length",
        module="buckling", function="critical_load",
    ),
    *(
        Check(
            name=f"slit_annulus_{corner}",
            description=f"lift of the {corner} corner of a slit annular plate; expected: shells (Sze 2004)",
            unit="m", expected=expected, reason="reported: hinges are too stiff in torsion by a half",
            module="annulus", function="corner", arguments=(corner,),
        )
        for corner, expected in (("inner", 13.891), ("outer", 17.528))
    ),
)  # fmt: skip

CHECKS = (*STIFFNESS, *SUPPORTED, *ELASTICA, *OTHERS)
