"""Cases of the curvature metric on surfaces whose curvature is known."""

from __future__ import annotations

from benchmarks.validation.case import known_answer

ORDERS = (
    *(
        known_answer(f"curvature_{surface}_order", f"order in h of mean curvature on {title}, worst vertex",
            "curvature.known_surfaces", f"{surface}_order", expected=2.0, tolerance=0.1,
            reason="mixed Voronoi areas are second order there")
        for surface, title in (
            ("sphere", "a band of a sphere"), ("cylinder", "a cylinder, oblique triangles"),
            ("torus", "a torus"),
        )
    ),
)  # fmt: skip

VALUES = (
    known_answer("curvature_sphere",
        "largest relative error of mean curvature on a sphere of 642 vertices",
        "curvature.known_surfaces", "sphere_curvature", expected=0.0, tolerance=1e-4,
        reason="second order in cells of a tenth of the radius"),
    known_answer("curvature_cylinder",
        "mean curvature of a cylinder of radius 0.1 m, mean over interior vertices",
        "curvature.known_surfaces", "cylinder_curvature", unit="1/m", expected=5.0, tolerance=1e-9,
        reason="exact for vertices on a circle; round-off"),
)  # fmt: skip

IRREGULAR = tuple(
    known_answer(f"curvature_floor_{where}",
        f"relative rms error of mean curvature on jittered triangles of a {where}, at any size",
        "curvature.known_surfaces", f"{where}_floor",
        reason="reported: pointwise, the operator does not converge on irregular triangles")
    for where in ("sphere", "cylinder")
)  # fmt: skip
