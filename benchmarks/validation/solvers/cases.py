"""Cases of the solver: derivatives of each term, and properties of the minimisers."""

from __future__ import annotations

from benchmarks.validation.case import known_answer

DERIVATIVES = tuple(
    known_answer(f"{kind}_of_{term}",
        f"{kind} of the term {term} beside differences of {of}, relative error",
        "solvers.derivatives", "error", options={"kind": kind, "term": term}, expected=0.0, tolerance=1e-7,
        reason="round-off over a step of 1e-3, and its fourth power")
    for kind, of in (("gradient", "the energy"), ("hessian", "the gradient"))
    for term in ("strain", "spring", "bending", "gravity", "inertia", "collision", "area_barrier")
    if (kind, term) != ("hessian", "gravity")  # it is zero
)  # fmt: skip

MINIMISERS = (
    known_answer("newton_quadratic",
        "factorisations for inertia and weight alone: one step, and one to confirm the minimum",
        "solvers.minimisers", "work_on_a_quadratic", expected=2.0, tolerance=0.0,
        reason="Newton's method ends a quadratic in one step"),
    known_answer("newton_order", "order of the last steps of Newton's method on a stretched sheet",
        "solvers.minimisers", "newton_order", expected=2.0, tolerance=0.4,
        reason="three steps are left between 1e-3 m and round-off"),
    known_answer("newton_never_rises",
        "largest rise of the energy from one kept point to the next, from random places",
        "solvers.minimisers", "largest_rise", expected=0.0, tolerance=1e-12,
        reason="round-off of the energy"),
    known_answer("newton_wants_small_steps",
        "edge lengths from rest at which a strip so soft that its forces are nothing is left",
        "solvers.minimisers", "small_gradient", expected=0.0, tolerance=1e-3,
        reason="what Newton's method calls a negligible step"),
    known_answer("newton_leaves_saddles",
        "negative eigenvalues where a flat start under compression is said to have come to rest",
        "solvers.minimisers", "negative_curvature", expected=0.0, tolerance=0.0, reason="a minimum has none"),
    known_answer("lbfgs_distance",
        "distance of the end of 60 steps of L-BFGS to Newton's, where there is one minimiser",
        "solvers.minimisers", "lbfgs_distance", unit="m", expected=0.0, tolerance=1e-6,
        reason="2e-7, and 15 times that without its memory"),
)  # fmt: skip
