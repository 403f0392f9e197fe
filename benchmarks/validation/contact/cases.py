"""Cases of contact without friction: a sheet on a plane, a point on a sphere, a strip over a drum."""

from __future__ import annotations

from benchmarks.validation.case import known_answer

PLANE = (
    known_answer("penalty_depth", "resting depth of a sheet on a plane, as a multiple of sqrt(rho g / (3 k))",
        "contact.plane", "penalty_depth", expected=1.0, tolerance=1e-3,
        reason="the depth follows the load by a square root"),
    known_answer("contact_sampled_area", "area of all contact samples of a cloth over its own",
        "contact.plane", "sampled_area", expected=3.0, tolerance=1e-12,
        reason="vertices, edges and faces carry it once each; round-off"),
    known_answer("contact_force_is_weight", "total contact force over weight of a sheet at rest on a plane",
        "contact.plane", "contact_force", expected=1.0, tolerance=2e-6,
        reason="the residual gradient that the solver may leave"),
)  # fmt: skip

SPHERE_ORDER = (
    known_answer("leaving_order", "order in dt of where a point leaves a sphere",
        "contact.round_bodies", "leaving_order", expected=1.0, tolerance=0.15,
        reason="backward Euler; the place is extrapolated from the force"),
)  # fmt: skip

DRUM = (
    known_answer("drum_tension",
        "tension along a strip over a frictionless cylinder, worst error over the mean",
        "contact.round_bodies", "drum_tension", expected=0.0, tolerance=5e-3,
        reason="120 cells, and one of contact at each end of the arc"),
    known_answer("drum_pressure", "mean contact pressure over (tension/R + w cos phi)",
        "contact.round_bodies", "drum_pressure", expected=1.0, tolerance=2e-3,
        reason="120 cells; the strip's depth in the margin over R"),
)  # fmt: skip

SPHERE = (
    known_answer("leaving_point",
        "cos theta where a point leaves a sphere, over 2/3 cos theta_0, extrapolated in dt",
        "contact.round_bodies", "leaving_point", expected=1.0, tolerance=2e-3,
        reason="second order in dt; the point's depth over R"),
)  # fmt: skip
