"""Known answers by a reference that is solved independently, by scipy or scikit-fem, in the case itself."""

from __future__ import annotations

from benchmarks.validation.case import known_answer

# C11/k of a lattice is rational or sqrt(3)/2: see plates.py.
PLATES = (
    ("right", "right triangles, all diagonals alike", 1.0, 0.25),
    ("cross", "squares with both diagonals", 3 / 4, 1 / 3),
    ("union_jack", "squares with alternating diagonals", 3 / 4, 5 / 24),
    ("equilateral", "equilateral triangles", 3**0.5 / 2, 0.25),
    ("delaunay", "jittered Delaunay triangles", None, None),
)
SCALINGS = (("unscaled", "none"), ("scaled", "length_area"))

STIFFNESS = tuple(
    known_answer(f"plate_stiffness_{family}_{scaling}", f"C11/k of {scaling} hinges on {title}",
        "bending.plates", "plate_stiffness", options={"family": family, "scaling": option}, smoke=False,
        expected=exact, tolerance=None if exact is None else 3e-4,
        reason="reported: a mean of one patch" if exact is None else "the corners leave (1/24)^2")
    for family, title, *both in PLATES
    for (scaling, option), exact in zip(SCALINGS, both)
)  # fmt: skip

# Only equilateral triangles make an isotropic plate: there the number is known, elsewhere it is the price.
SUPPORTED = tuple(
    known_answer(f"plate_morley_{family}_{scaling}",
        f"D/k of the Kirchhoff plate (Morley) that sags like {scaling} hinges on {title}",
        "bending.plates", "supported_plate", options={"family": family, "scaling": option}, smoke=False,
        expected=exact, tolerance=None if exact is None else 0.03 * exact,
        reason="reported: no plate of one D" if exact is None else "edges on the border have no hinge")
    for family, title, *_ in PLATES
    for scaling, option in SCALINGS
    for exact in [{"none": 3**0.5 / 2, "length_area": 0.25}[option] if family == "equilateral" else None]
)  # fmt: skip

ELASTICA = (
    *(
        known_answer(f"heavy_elastica_{gamma}",
            f"tip of a cantilever at Gamma = {gamma}, distance to the elastica, worst of 4",
            "bending.elastica", "heavy", options={"gamma": float(gamma)}, smoke=False,
            expected=0.0, tolerance=tolerance, reason="120 cells, their error halves with the cell")
        for gamma, tolerance in ((1, 1e-4), (10, 3e-3), (100, 6e-3), (1000, 6e-3))
    ),
    *(
        known_answer(f"end_loaded_cantilever_{load}",
            f"the same with a force of {load} D/L^2 at the end and no weight",
            "bending.elastica", "end_loaded", options={"load": float(load)}, smoke=False,
            expected=0.0, tolerance=3e-3, reason="120 cells, their error halves with the cell")
        for load in (1, 3, 10)
    ),
    known_answer("elastica_one_sided_diagonals",
        "the same at Gamma = 10 on right triangles whose diagonals all lean one way",
        "bending.elastica", "one_sided_diagonals", options={"gamma": 10.0}, smoke=False,
        reason="reported: such a strip twists as it bends and is no elastica"),
    *(
        known_answer(f"bending_spread_{scaling}",
            f"largest over smallest bending stiffness of a strip of {scaling} hinges at one k, over 5 meshes",
            "bending.elastica", "stiffness_spread", options={"scaling": option}, smoke=False,
            reason="reported: the price of hinges on any mesh")
        for scaling, option in SCALINGS
    ),
)  # fmt: skip

OTHERS = (
    known_answer("clamped_stretch_force",
        "pull on a square sheet stretched by 1.2 between clamps, against P2 of scikit-fem",
        "membrane.clamped_stretch", "force", unit="N", tolerance=0.01, smoke=False,
        reason="32 cells beside the singular corners of the clamps"),
    known_answer("clamped_stretch_neck", "its width half-way between the clamps",
        "membrane.clamped_stretch", "neck", unit="m", tolerance=3e-4, smoke=False,
        reason="32 cells beside the singular corners of the clamps"),
    known_answer("drum_tension",
        "tension along a strip over a frictionless cylinder, worst error over the mean",
        "contact.round_bodies", "drum_tension", expected=0.0, tolerance=5e-3,
        reason="120 cells, and one of contact at each end of the arc"),
    known_answer("drum_pressure", "mean contact pressure over (tension/R + w cos phi)",
        "contact.round_bodies", "drum_pressure", expected=1.0, tolerance=2e-3,
        reason="120 cells; the strip's depth in the margin over R"),
    *(
        known_answer(f"friction_capstan_{name}",
            f"pull on the tight end of a strip over a turning drum over that on the slack one, mu = {mu:g}, "
            "over exp(mu phi)",
            "friction.capstan", "ratio", options={"mu": mu}, expected=1.0, tolerance=1e-3,
            reason="60 cells: mu (1 + mu^2) phi b^2 / 12, at most 8e-4")
        for name, mu in (("rough", 0.5), ("smooth", 0.1))
    ),
    known_answer("friction_capstan_order", "order of its error in the length of a cell",
        "friction.capstan", "order", expected=2.0, tolerance=0.2,
        reason="the strip's depth in the margin over R is left"),
    known_answer("friction_capstan_soft", "the same ratio with the contact stiffness of garments",
        "friction.capstan", "ratio", options={"mu": 0.5, "stiffness": 3.4e6},
        reason="reported: the strip sinks by a millimetre of R = 200 towards its tight end"),
    known_answer("friction_strip_pull",
        "pull on the end of a strip that sticks to a table, worst error over mu times its weight",
        "friction.pull", "strip_pull", expected=0.0, tolerance=1e-3,
        reason="40 cells, and which of them slides last"),
    known_answer("friction_strip_slide", "pull on that strip once all of it slides, over mu times its weight",
        "friction.pull", "strip_slide", expected=1.0, tolerance=1e-5,
        reason="its vertices move aside a little: all diagonals lean one way"),
    known_answer("leaving_point",
        "cos theta where a point leaves a sphere, over 2/3 cos theta_0, extrapolated in dt",
        "contact.round_bodies", "leaving_point", expected=1.0, tolerance=2e-3,
        reason="second order in dt; the point's depth over R"),
    known_answer("lateral_buckling", "buckling load of a strip on edge, over 4.0126 (EI GJ)^0.5 / L^2",
        "bending.lateral_buckling", "critical_load", expected=1.0, tolerance=0.03, smoke=False,
        reason="the clamp holds back warping over a width, 4 % of the length"),
    *(
        known_answer(f"slit_annulus_{corner}",
            f"lift of the {corner} corner of a slit annular plate; expected: shells (Sze 2004)",
            "bending.slit_annulus", "corner", options={"which": corner}, unit="m", expected=expected, smoke=False,
            reason="reported: hinges are too stiff in torsion by a half")
        for corner, expected in (("inner", 13.891), ("outer", 17.528))
    ),
)  # fmt: skip

CASES = (*STIFFNESS, *SUPPORTED, *ELASTICA, *OTHERS)
