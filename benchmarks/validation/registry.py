"""Cases: the visible tuple of modules whose functions declare them."""

from __future__ import annotations

from benchmarks.validation.case import Case, cases_of
from benchmarks.validation.fabric.cases import TEXTILE_TESTS

MODULES = (
    # Answers that hold to round-off, or to what the solver may leave: closed forms and discrete laws.
    "shells.membrane", "shells.hinges", "derivatives", "motion.discrete_laws", "motion.oscillators",
    "motion.resting_sheet", "motion.friction_plane", "motion.friction_pull", "minimisers",
    # Answers whose error has a declared order, measured by slope over three meshes or time steps.
    "shells.manufactured_solution", "shells.hanging_strip", "known_surfaces", "motion.time_step_orders",
    "motion.round_bodies",
    # Answers by a reference that is solved independently, by scipy or scikit-fem, in the case itself.
    "shells.plates", "shells.elastica", "shells.clamped_stretch", "motion.capstan", "shells.lateral_buckling",
    "shells.slit_annulus",
)  # fmt: skip

KNOWN_ANSWERS: tuple[Case, ...] = sum((cases_of(f"benchmarks.validation.{name}") for name in MODULES), ())
STRESS_TESTS: tuple[Case, ...] = cases_of("benchmarks.validation.extreme_steps")
CASES: tuple[Case, ...] = (*KNOWN_ANSWERS, *STRESS_TESTS, *TEXTILE_TESTS)
