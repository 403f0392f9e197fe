"""Cases of Coulomb friction: slopes, belts, springs, a capstan, a strip on a table."""

from __future__ import annotations

from benchmarks.validation.case import known_answer

DISCRETE_PATHS = (
    known_answer("friction_creep",
        "speed of a patch on a slope of tan(a) = 0.8 mu, over (1 - 0.2^0.5) of the smoothing's: it creeps",
        "friction.plane", "creep_speed", options={"ratio": 0.8}, expected=1.0, tolerance=1e-9,
        reason="the residual gradient that the solver may leave"),
    *(
        known_answer(f"friction_slope_{name}",
            f"distance of a patch on a slope of tan(a) = {ratio:g} mu to its exact discrete path, 30 steps",
            "friction.plane", "slope_path", options={"ratio": ratio}, unit="m", expected=0.0, tolerance=1e-10,
            reason="the residual gradient that the solver may leave, summed twice")
        for name, ratio in (("below", 0.8), ("at", 1.0))
    ),
    known_answer("friction_slide",
        "the same at 1.2 mu, to the path of the constant force g (sin a - mu cos a): no smoothing is left",
        "friction.plane", "slide_path", options={"ratio": 1.2}, unit="m", expected=0.0, tolerance=1e-10,
        reason="the residual gradient that the solver may leave, summed twice"),
    known_answer("friction_belt",
        "distance of a patch put at rest on a moving belt to its exact discrete path, 15 steps",
        "friction.plane", "belt_path", unit="m", expected=0.0, tolerance=1e-10,
        reason="the residual gradient that the solver may leave, summed twice"),
    known_answer("friction_belt_in_substeps", "the same with four steps a frame, while the belt moves on",
        "friction.plane", "belt_path", options={"substeps": 4}, unit="m", expected=0.0, tolerance=1e-10,
        reason="the residual gradient that the solver may leave, summed twice"),
    known_answer("friction_landing",
        "speed that a sliding patch keeps when it lands, over v - mu (v_n + g t)",
        "friction.plane", "landing_speed", expected=1.0, tolerance=1e-9,
        reason="what is left of its bounce, and the residual gradient"),
    known_answer("friction_spring_path",
        "distance of a point that a spring pulls along to discrete steps solved by scipy, 300 steps",
        "friction.pull", "spring_path", unit="m", expected=0.0, tolerance=1e-10,
        reason="the residual gradient that the solver may leave, summed twice"),
    known_answer("friction_spring_pull",
        "pull of that spring over mu m g once the point slides: no more than to break it loose",
        "friction.pull", "spring_pull", expected=1.0, tolerance=1e-4,
        reason="what is left of its swing after 300 steps"),
)  # fmt: skip

CAPSTAN_AND_STRIP = (
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
)  # fmt: skip
