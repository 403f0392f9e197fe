"""Cases: known answers are found, stress tests end honestly, and a number is judged as it should be."""

from __future__ import annotations

import math

import pytest

from benchmarks.validation.case import Case
from benchmarks.validation.registry import KNOWN_ANSWERS, STRESS_TESTS
from tests.benchmarks.plan.planned import planned

CASES = [
    pytest.param(case, id=case.name, marks=[] if case.smoke else [pytest.mark.slow])
    for case in (*KNOWN_ANSWERS, *STRESS_TESTS)
]


@pytest.mark.parametrize("case", CASES)
def test_a_known_answer_is_found_and_a_stress_test_never_lies(case):
    row, known = case.run(), case in KNOWN_ANSWERS
    honest = ("ok",) if known or case.smoke else ("ok", "stalled", "timeout", "diverged")
    assert row.status in honest and (known or row.reason), row.reason
    expected = ("validation", "simulation", "check") if known else ("extremes", "simulation", "outcome")
    assert (row.suite, row.method, row.metric) == expected and row.scene == case.name


def test_study_smoke_runs_the_quick_ones_unless_one_is_named():
    assert planned("full:validation", "--set", "parts.validation.cases=*").cases == KNOWN_ANSWERS
    smoke = tuple(case for case in KNOWN_ANSWERS if case.smoke and not case.long)
    assert planned("smoke:validation").cases == smoke
    (case,) = planned("smoke:validation", "--scenes", "slit_annulus_inner").cases
    assert case.name == "slit_annulus_inner"


def given(number: object) -> object:
    return number


@pytest.mark.parametrize(
    ("number", "expected", "tolerance", "status"),
    [
        (1.0, 1.0, 0.0, "ok"),
        (1.2, 1.0, 0.1, "failed"),
        ((1.2, 1.0), None, 0.1, "failed"),
        (7.0, 3.0, None, "ok"),
        (7.0, None, 0.1, "failed"),
        (math.nan, None, None, "failed"),
        ("text", 1.0, 0.1, "failed"),
    ],
)
def test_how_a_number_is_judged(number, expected, tolerance, status):
    case = Case(
        name="planted", description="", reason="planted", module=__name__, function="given",
        options={"number": number}, expected=expected, tolerance=tolerance,
    )  # fmt: skip
    row = case.run()
    assert row.status == status and (status == "ok" or row.reason) and row.tolerance == tolerance
