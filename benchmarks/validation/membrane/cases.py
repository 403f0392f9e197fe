"""Cases of the membrane: closed forms, scikit-fem, hanging strips, a sheet between clamps."""

from __future__ import annotations

from benchmarks.validation.case import known_answer

SCIKIT_FEM = tuple(
    known_answer(f"membrane_{what}_scikit_fem",
        f"{title} of the membrane beside scikit-fem's, random 3D state: relative difference",
        "membrane.closed_forms", "scikit_fem", options={"what": what}, expected=0.0, tolerance=1e-12,
        reason="round-off of two assemblies of the same sums")
    for what, title in (("energy", "energy"), ("gradient", "gradient"), ("hessian", "Hessian"))
)  # fmt: skip

CLOSED_FORMS = (
    *(
        known_answer(f"membrane_{state.replace(' ', '_')}",
            f"energy of {state} on a rotated unstructured patch, over its closed form",
            "membrane.closed_forms", "closed_form", options={"state": state}, expected=1.0, tolerance=1e-12,
            reason="round-off of some hundred triangles")
        for state in ("uniaxial strain", "uniaxial stress", "equibiaxial", "simple shear", "collapse")
    ),
    known_answer("membrane_pull", "force on an end of unit width in uniaxial stress, nothing across",
        "membrane.closed_forms", "uniaxial_pull", unit="N", tolerance=1e-11,
        reason="round-off of a sum of ten forces of 1 N"),
    *(
        known_answer(f"constant_{name}", f"{title} of the default cotton, as the paper prints it",
            "membrane.closed_forms", "constant", options={"name": name}, unit="N/m", expected=printed,
            tolerance=0.051, reason="three printed digits")
        for name, title, printed in (("lame_lambda", "lambda", 20.9), ("lame_mu", "mu", 11.1))
    ),
    known_answer("constant_bending_stiffness", "k of the default cotton's hinges, as the paper prints it",
        "membrane.closed_forms", "constant", options={"name": "bending_stiffness"}, unit="J",
        expected=3.96e-5,
        tolerance=5.1e-8, reason="three printed digits"),
    known_answer("weight_of_a_square_metre",
        "of the default cotton: 426 kg/m^3 times 0.47 mm times 9.81 m/s^2",
        "membrane.closed_forms", "weight_of_a_square_metre", unit="N", expected=426.0 * 0.47e-3 * 9.81,
        tolerance=1e-12, reason="round-off"),
)  # fmt: skip

RIGID_MOTIONS = (
    known_answer("rigid_motion_force", "largest force after a rigid motion of a flat patch, hinges on",
        "membrane.closed_forms", "rigid_motion", unit="N", expected=0.0, tolerance=1e-11,
        reason="round-off of a membrane of 33 N/m moved by 4 m"),
    known_answer("rigid_invariance",
        "relative change of the forces in a disordered patch under a rigid motion",
        "membrane.closed_forms", "rigid_invariance", expected=0.0, tolerance=1e-11,
        reason="round-off of positions some metres from the origin"),
    known_answer("rigid_zero_modes", "zero eigenvalues of the Hessian of a flat patch, hinges on",
        "membrane.closed_forms", "zero_modes", expected=6.0, tolerance=0.0,
        reason="three translations and three rotations, no other"),
)  # fmt: skip

ORDERS = (
    known_answer("manufactured_order",
        "order in h of positions (L2) for a manufactured solution on jittered Delaunay meshes",
        "membrane.manufactured_solution", "order", options={"of": "positions"}, expected=2.0, tolerance=0.2,
        reason="linear triangles; random meshes scatter the slope"),
    known_answer("manufactured_gradient_order",
        "order in h of the deformation gradient for the same solution",
        "membrane.manufactured_solution", "order", options={"of": "gradient"}, expected=1.0, tolerance=0.1,
        reason="linear triangles; random meshes scatter the slope"),
    known_answer("hanging_strip_order", "order in h of the tip of a hanging strip",
        "membrane.hanging_strip", "hanging_strip_order", expected=2.0, tolerance=0.2,
        reason="12, 24 and 48 cells are few"),
    known_answer("catenary_order", "order in h of the sag of an elastic catenary",
        "membrane.hanging_strip", "catenary_order", expected=2.0, tolerance=0.1,
        reason="12, 24 and 48 cells are few"),
)  # fmt: skip

STRINGS = (
    known_answer("hanging_strip_tip",
        "tip of a 1 m strip (lambda = 0) hanging by its top, against its exact curve",
        "membrane.hanging_strip", "hanging_strip_tip", unit="m", tolerance=2e-6,
        reason="second order in 1/24 of the length"),
    known_answer("catenary_sag", "sag of an elastic catenary, 1 m over a span of 0.8 m",
        "membrane.hanging_strip", "catenary", options={"what": "sag"}, unit="m", tolerance=1e-4,
        reason="second order in 1/48 of the length"),
    known_answer("catenary_force", "horizontal force per width of the same",
        "membrane.hanging_strip", "catenary", options={"what": "force"}, unit="N/m", tolerance=2e-4,
        reason="second order in 1/48 of the length"),
)  # fmt: skip

CLAMPED = (
    known_answer("clamped_stretch_force",
        "pull on a square sheet stretched by 1.2 between clamps, against P2 of scikit-fem",
        "membrane.clamped_stretch", "stretched", options={"what": "force"}, unit="N", tolerance=0.01,
        smoke=False,
        reason="32 cells beside the singular corners of the clamps"),
    known_answer("clamped_stretch_neck", "its width half-way between the clamps",
        "membrane.clamped_stretch", "stretched", options={"what": "neck"}, unit="m", tolerance=3e-4,
        smoke=False,
        reason="32 cells beside the singular corners of the clamps"),
)  # fmt: skip
