"""Known answers whose error has a declared order, measured by slope over three meshes or time steps."""

from __future__ import annotations

from benchmarks.validation.case import known_answer

ORDERS = (
    known_answer("manufactured_order",
        "order in h of positions (L2) for a manufactured solution on jittered Delaunay meshes",
        "membrane.manufactured_solution", "mean_square_order", expected=2.0, tolerance=0.2,
        reason="linear triangles; random meshes scatter the slope"),
    known_answer("manufactured_gradient_order",
        "order in h of the deformation gradient for the same solution",
        "membrane.manufactured_solution", "gradient_order", expected=1.0, tolerance=0.1,
        reason="linear triangles; random meshes scatter the slope"),
    known_answer("hanging_strip_order", "order in h of the tip of a hanging strip",
        "membrane.hanging_strip", "hanging_strip_order", expected=2.0, tolerance=0.2,
        reason="12, 24 and 48 cells are few"),
    known_answer("catenary_order", "order in h of the sag of an elastic catenary",
        "membrane.hanging_strip", "catenary_order", expected=2.0, tolerance=0.1, reason="12, 24 and 48 cells are few"),
    known_answer("time_step_order", "order in dt of the place of an elastic pendulum after half a second",
        "dynamics.oscillators", "time_step_order", expected=1.0, tolerance=0.1,
        reason="backward Euler; its second order still shows at 1/480 s"),
    known_answer("leaving_order", "order in dt of where a point leaves a sphere",
        "contact.round_bodies", "leaving_order", expected=1.0, tolerance=0.15,
        reason="backward Euler; the place is extrapolated from the force"),
    known_answer("membrane_time_step_order", "order in dt of a vibrating membrane, against its exact motion",
        "dynamics.time_steps", "membrane_order", expected=1.0, tolerance=0.1,
        reason="backward Euler; its second order still shows at 1/3840 s"),
    known_answer("swing_time_step_order", "order in dt of a sheet that swings from its upper edge",
        "dynamics.time_steps", "swing_order", expected=1.0, tolerance=0.15,
        reason="backward Euler; faster vibrations still show at 1/1920 s"),
    known_answer("pressed_time_step_order", "order in dt of a taut sheet that a ball is pressed into",
        "dynamics.time_steps", "pressed_order", expected=1.0, tolerance=0.1,
        reason="backward Euler; its second order still shows at 1/1200 s"),
    known_answer("viscous_time_step_order",
        "order in dt of a sheet held at two corners, wrinkled, with viscous edges",
        "dynamics.time_steps", "hanging_sheet_order", options={"viscous": True}, expected=1.0, tolerance=0.1,
        reason="backward Euler; nothing swings too fast for the steps"),
    *(
        known_answer(f"curvature_{surface}_order", f"order in h of mean curvature on {words}, worst vertex",
            "curvature", f"{surface}_order", expected=2.0, tolerance=0.1,
            reason="mixed Voronoi areas are second order there")
        for surface, words in (
            ("sphere", "a band of a sphere"), ("cylinder", "a cylinder, oblique triangles"),
            ("torus", "a torus"),
        )
    ),
)  # fmt: skip

VALUES = (
    known_answer("hanging_strip_tip",
        "tip of a 1 m strip (lambda = 0) hanging by its top, against its exact curve",
        "membrane.hanging_strip", "hanging_strip_tip", unit="m", tolerance=2e-6,
        reason="second order in 1/24 of the length"),
    known_answer("catenary_sag", "sag of an elastic catenary, 1 m over a span of 0.8 m",
        "membrane.hanging_strip", "catenary_sag", unit="m", tolerance=1e-4, reason="second order in 1/48 of the length"),
    known_answer("catenary_force", "horizontal force per width of the same",
        "membrane.hanging_strip", "catenary_force", unit="N/m", tolerance=2e-4, reason="second order in 1/48 of the length"),
    known_answer("curvature_sphere",
        "largest relative error of mean curvature on a sphere of 642 vertices",
        "curvature", "sphere_curvature", expected=0.0, tolerance=1e-4,
        reason="second order in cells of a tenth of the radius"),
    known_answer("curvature_cylinder",
        "mean curvature of a cylinder of radius 0.1 m, mean over interior vertices",
        "curvature", "cylinder_curvature", unit="1/m", expected=5.0, tolerance=1e-9,
        reason="exact for vertices on a circle; round-off"),
)  # fmt: skip

IRREGULAR = tuple(
    known_answer(f"curvature_floor_{where}",
        f"relative rms error of mean curvature on jittered triangles of a {where}, at any size",
        "curvature", f"{where}_floor",
        reason="reported: pointwise, the operator does not converge on irregular triangles")
    for where in ("sphere", "cylinder")
)  # fmt: skip

UNDAMPED = (
    known_answer("hanging_sheet_time_step_order",
        "order in dt of the same sheet as it is, without viscosity",
        "dynamics.time_steps", "hanging_sheet_order", options={"viscous": False},
        reason="reported: its vibrations are too fast for the steps, so the first order does not show"),
    known_answer("chord_time_step_distance",
        "distance of the sheet on the ball to one whose ball moves linearly between frames of 1/30 s",
        "dynamics.time_steps", "chord_distance", unit="m",
        reason="reported: sub-steps converge to the motion along chords, not to the smooth one"),
)  # fmt: skip

DEPENDENCE = tuple(
    known_answer(f"{kind}_dependence_{quantity}",
        f"mean {title} of a hanging cloth with {change}, over that without",
        "dynamics.mesh_and_time_step", f"{kind}_dependence", options={"quantity": quantity}, smoke=False,
        reason="reported: nobody should compare across meshes or time steps unawares")
    for kind, change in (("mesh", "cells half as wide"), ("time_step", "a quarter of the time step"))
    for quantity, title in (
        ("strain", "strain energy"), ("bending", "bending energy"), ("curvature", "mean curvature")
    )
)  # fmt: skip

CASES = (*ORDERS, *VALUES, *IRREGULAR, *UNDAMPED, *DEPENDENCE)
