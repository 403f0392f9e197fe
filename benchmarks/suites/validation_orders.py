"""Checks whose error has a declared order, measured by slope over three meshes or time steps."""

from __future__ import annotations

from ..check import Check

ORDERS = tuple(
    Check(
        name=name, description=description, expected=expected, tolerance=tolerance, reason=reason,
        module=module, function=function, smoke=True,
    )
    for name, description, expected, tolerance, reason, module, function in (
        (
            "manufactured_order",
            "order in h of positions (L2) for a manufactured solution on jittered Delaunay meshes",
            2.0, 0.2, "linear triangles; random meshes scatter the slope",
            "manufactured", "mean_square_order",
        ),
        (
            "manufactured_gradient_order",
            "order in h of the deformation gradient for the same solution",
            1.0, 0.1, "linear triangles; random meshes scatter the slope",
            "manufactured", "gradient_order",
        ),
        (
            "hanging_strip_order",
            "order in h of the tip of a hanging strip",
            2.0, 0.2, "12, 24 and 48 cells are few", "statics", "hanging_strip_order",
        ),
        (
            "catenary_order",
            "order in h of the sag of an elastic catenary",
            2.0, 0.1, "12, 24 and 48 cells are few", "statics", "catenary_order",
        ),
        (
            "time_step_order",
            "order in dt of the place of an elastic pendulum after half a second",
            1.0, 0.1, "backward Euler; its second order still shows at 1/480 s",
            "few_masses", "time_step_order",
        ),
        (
            "leaving_order",
            "order in dt of where a point leaves a sphere",
            1.0, 0.15, "backward Euler; the place is extrapolated from the force",
            "round_bodies", "leaving_order",
        ),
        (
            "curvature_sphere_order",
            "order in h of mean curvature on a band of a sphere, worst vertex",
            2.0, 0.1, "mixed Voronoi areas are second order there", "geometry", "sphere_order",
        ),
        (
            "curvature_cylinder_order",
            "order in h of mean curvature on a cylinder, oblique triangles, worst vertex",
            2.0, 0.1, "mixed Voronoi areas are second order there", "geometry", "cylinder_order",
        ),
        (
            "curvature_torus_order",
            "order in h of mean curvature on a torus, worst vertex",
            2.0, 0.1, "mixed Voronoi areas are second order there", "geometry", "torus_order",
        ),
    )
)  # fmt: skip

VALUES = (
    Check(
        name="hanging_strip_tip",
        description="tip of a 1 m strip (lambda = 0) hanging by its top, against its exact curve",
        unit="m", tolerance=2e-6, reason="second order in 1/24 of the length",
        module="statics", function="hanging_strip_tip", smoke=True,
    ),
    Check(
        name="catenary_sag",
        description="sag of an elastic catenary, 1 m over a span of 0.8 m",
        unit="m", tolerance=1e-4, reason="second order in 1/48 of the length",
        module="statics", function="catenary_sag", smoke=True,
    ),
    Check(
        name="catenary_force",
        description="horizontal force per width of the same",
        unit="N/m", tolerance=2e-4, reason="second order in 1/48 of the length",
        module="statics", function="catenary_force", smoke=True,
    ),
    Check(
        name="curvature_sphere",
        description="largest relative error of mean curvature on a sphere of 642 vertices",
        expected=0.0, tolerance=1e-4, reason="second order in cells of a tenth of the radius",
        module="geometry", function="sphere_curvature", smoke=True,
    ),
    Check(
        name="curvature_cylinder",
        description="mean curvature of a cylinder of radius 0.1 m, mean over interior vertices",
        unit="1/m", expected=5.0, tolerance=1e-9, reason="exact for vertices on a circle; round-off",
        module="geometry", function="cylinder_curvature", smoke=True,
    ),
)  # fmt: skip

FLOORS = tuple(
    Check(
        name=f"curvature_floor_{where}",
        description=f"relative rms error of mean curvature on jittered triangles of a {where}, at any size",
        reason="reported: pointwise, the operator does not converge on irregular triangles",
        module="geometry", function=f"{where}_floor", smoke=True,
    )
    for where in ("sphere", "cylinder")
)  # fmt: skip

DEPENDENCE = tuple(
    Check(
        name=f"{kind}_dependence_{quantity}",
        description=f"mean {title} of a hanging cloth with {change}, over that without",
        reason="reported: nobody should compare across meshes or time steps unawares",
        module="dependence", function=f"{kind}_dependence", arguments=(quantity,),
    )
    for kind, change in (("mesh", "cells half as wide"), ("time_step", "a quarter of the time step"))
    for quantity, title in (
        ("strain", "strain energy"), ("bending", "bending energy"), ("curvature", "mean curvature")
    )
)  # fmt: skip

CHECKS = (*ORDERS, *VALUES, *FLOORS, *DEPENDENCE)
