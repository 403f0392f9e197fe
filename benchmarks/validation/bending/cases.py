"""Cases of the hinges: folds, plates, the elastica, buckling and torsion."""

from __future__ import annotations

from benchmarks.validation.case import known_answer

FOLDS = (
    *(
        known_answer(f"hinges_folded_{title}",
            f"bending energy of a folded strip, {title}, over its closed form",
            "bending.hinges", "folded", options={"scaling": scaling, "fold": fold}, expected=1.0,
            tolerance=1e-12, reason="round-off")
        for title, scaling, fold in (("unscaled", "none", 0.3), ("scaled", "length_area", -1.2))
    ),
    known_answer("hinges_past_half_a_turn",
        "bending energy of folds of -3 rad with rest angles of 3 rad: the short way is 2 pi - 6",
        "bending.hinges", "past_half_a_turn", expected=1.0, tolerance=1e-12, reason="round-off"),
    known_answer("hinges_rest_shape_force", "largest force in a folded strip that was made folded",
        "bending.hinges", "rest_shape_force", unit="N", expected=0.0, tolerance=1e-14,
        reason="round-off of angles times k over a cell of 0.1 m"),
)  # fmt: skip

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
            "bending.elastica", "tip_distance", options={"weight": float(gamma)}, smoke=False,
            expected=0.0, tolerance=tolerance, reason="120 cells, their error halves with the cell")
        for gamma, tolerance in ((1, 1e-4), (10, 3e-3), (100, 6e-3), (1000, 6e-3))
    ),
    *(
        known_answer(f"end_loaded_cantilever_{load}",
            f"the same with a force of {load} D/L^2 at the end and no weight",
            "bending.elastica", "tip_distance", options={"load": float(load)}, smoke=False,
            expected=0.0, tolerance=3e-3, reason="120 cells, their error halves with the cell")
        for load in (1, 3, 10)
    ),
    known_answer("elastica_one_sided_diagonals",
        "the same at Gamma = 10 on right triangles whose diagonals all lean one way",
        "bending.elastica", "tip_distance", options={"weight": 10.0, "families": ("right",)}, smoke=False,
        reason="reported: such a strip twists as it bends and is no elastica"),
    *(
        known_answer(f"bending_spread_{scaling}",
            f"largest over smallest bending stiffness of a strip of {scaling} hinges at one k, over 5 meshes",
            "bending.elastica", "stiffness_spread", options={"scaling": option}, smoke=False,
            reason="reported: the price of hinges on any mesh")
        for scaling, option in SCALINGS
    ),
)  # fmt: skip

# Lifts [m] of the slit annular plate: Sze, Liu and Lo 2004.
SZE = (("inner", 13.891), ("outer", 17.528))

TORSION = (
    known_answer("lateral_buckling", "buckling load of a strip on edge, over 4.0126 (EI GJ)^0.5 / L^2",
        "bending.lateral_buckling", "critical_load", expected=1.0, tolerance=0.03, smoke=False,
        reason="the clamp holds back warping over a width, 4 % of the length"),
    *(
        known_answer(f"slit_annulus_{corner}",
            f"lift of the {corner} corner of a slit annular plate, nu = 0; expected: shells (Sze 2004)",
            "bending.slit_annulus", "corner", options={"which": corner}, unit="m", expected=expected,
            tolerance=0.08, smoke=False, long=True,
            reason="half of what 3 % of bending stiffness changes; the limit of three meshes is 0.04 m off")
        for corner, expected in SZE
    ),
    *(
        known_answer(f"slit_annulus_{corner}_hinges_alone",
            f"the same without the energy that takes nu = -1/3 of hinges to 0, {corner} corner",
            "bending.slit_annulus", "corner", options={"which": corner, "poisson_ratio": "hinges"}, unit="m",
            expected=expected, smoke=False, long=True, reason="reported: the price of nu = -1/3")
        for corner, expected in SZE
    ),
)  # fmt: skip
