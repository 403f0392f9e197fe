"""The visible tuple of cases. Listing them imports nothing that measures.

The smallest preset runs those marked `smoke`. Known answers without a tolerance are reported, not judged.
"""

from __future__ import annotations

from . import exact, orders, references, stress_tests
from .case import Case

KNOWN_ANSWERS: tuple[Case, ...] = (*exact.CASES, *orders.CASES, *references.CASES)
STRESS_TESTS: tuple[Case, ...] = stress_tests.CASES
CASES: tuple[Case, ...] = (*KNOWN_ANSWERS, *STRESS_TESTS)
