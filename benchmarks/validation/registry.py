"""The visible tuple of cases. Listing them imports nothing that measures.

The smallest preset runs those marked `smoke`. Known answers without a tolerance are reported, not judged.
"""

from __future__ import annotations

from benchmarks.validation import exact, orders, references
from benchmarks.validation.case import Case
from benchmarks.validation.stress import cases as stress_tests

KNOWN_ANSWERS: tuple[Case, ...] = (*exact.CASES, *orders.CASES, *references.CASES)
STRESS_TESTS: tuple[Case, ...] = stress_tests.CASES
CASES: tuple[Case, ...] = (*KNOWN_ANSWERS, *STRESS_TESTS)
