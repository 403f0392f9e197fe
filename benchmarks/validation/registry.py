"""Cases: the visible tuple of modules whose functions declare them."""

from __future__ import annotations

from benchmarks.validation.case import Case, cases_of

MODULES = (
    # Closed forms, and laws that hold to round-off or to what the solver may leave.
    "membrane", "derivatives", "discrete_laws", "contact", "friction", "minimisers",
    # Answers whose error has a declared order in the mesh or the time step, or a solver of their own.
    "plates", "large_bending", "known_surfaces", "time_steps",
)  # fmt: skip

KNOWN_ANSWERS: tuple[Case, ...] = sum((cases_of(f"benchmarks.validation.{name}") for name in MODULES), ())
STRESS_TESTS: tuple[Case, ...] = cases_of("benchmarks.validation.extreme_steps")
CASES: tuple[Case, ...] = (*KNOWN_ANSWERS, *STRESS_TESTS)
