"""One rule says how two methods stand: ties by the interval, margins by the ensemble, Holm's correction."""

from __future__ import annotations

from dataclasses import replace

import pytest

from benchmarks.metric import Metric
from reports.statistics.effects import DIFFERENCE, RANGE, RATIO, Effect
from reports.statistics.verdicts import LESS, MORE, OPEN, TIED, compare_methods, holm, standing, untested
from tests.reports.report_folder import row, run_of

FOUR = {"scale": RATIO, "freedom": 10.0, "motions": 4}


@pytest.mark.parametrize(
    ("value", "error", "expected"),
    [
        (0.01, 0.01, TIED),  # 2.2 errors below 5 %
        (0.01, 0.03, OPEN),  # the interval reaches beyond
        (0.2, 0.01, MORE),
        (-0.2, 0.01, LESS),
        (0.2, 0.1, OPEN),
        (0.04, 0.001, TIED),  # surely different, and negligible
    ],
)
def test_a_tie_is_an_interval_within_the_margin_and_not_a_point_estimate(value, error, expected):
    far = Effect(value, error=error, **FOUR)
    assert standing(far, far.p_value()) == expected


def test_the_spread_of_the_ensemble_widens_the_margin_and_the_least_difference():
    far = Effect(0.2, error=0.01, **FOUR)
    stands = {
        moved: standing(replace(far, uncertainty=moved), far.p_value()) for moved in (0.1, 0.21, 0.3)
    }
    assert stands == {0.1: MORE, 0.21: OPEN, 0.3: TIED}


def test_below_four_motions_with_one_seed_or_unrepeated_it_is_inconclusive():
    far = Effect(0.5, error=0.01, **FOUR)
    assert standing(far, 1e-9) == MORE
    for changed in ({"motions": 3}, {"one_seed": True}, {"error": None}):
        less = replace(far, **changed)
        assert standing(less, less.p_value()) == OPEN


def test_a_corrected_p_value_above_the_level_is_inconclusive():
    far = Effect(0.5, error=0.1, **FOUR)
    assert standing(far, far.p_value()) == MORE and standing(far, 0.06) == OPEN


@pytest.mark.parametrize(
    ("limits", "expected"),
    [((-0.5, -0.3), LESS), ((0.1, 0.9), MORE), ((-0.1, 0.2), OPEN), ((-0.01, 0.02), TIED), (None, OPEN)],
)
def test_a_cost_is_judged_by_its_range(limits, expected):
    far = Effect(-0.4, RATIO, covers=RANGE, limits=limits)
    assert standing(far, far.p_value()) == expected


def test_one_reading_of_a_clock_gives_no_verdict_and_one_of_a_size_does():
    rows = [
        row("tshirt/walk", method, metric, value)
        for method, value in (("snug", 1.0), ("pbns", 1.06))
        for metric in ("cost/frame", "cost/memory")
    ]
    run = run_of(rows)
    time, size = (
        compare_methods(
            run, run.frame, Metric(name=name, unit="1", title=name, definition="", of=of), "snug", "pbns"
        ).effect
        for name, of in (("cost/frame", "machine"), ("cost/memory", "method"))
    )
    assert (standing(time, None), untested(time)) == (OPEN, ": no range")
    assert (standing(size, None), untested(size)) == (LESS, "")


def test_a_claimed_factor_moves_the_effect():
    far = Effect(-5.0, error=0.01, **FOUR)  # a factor of 148
    assert standing(far, far.p_value(100.0), 100.0) == LESS
    assert standing(far, far.p_value(200.0), 200.0) == MORE
    assert standing(far, far.p_value(148.4), 148.4) == TIED


def test_a_plain_difference_is_a_tie_within_5_percent_of_its_unit():
    far = Effect(0.03, DIFFERENCE, error=0.005, freedom=10.0, motions=4, unit=1.0)
    assert standing(far, far.p_value()) == TIED
    assert standing(replace(far, unit=0.5), far.p_value()) == MORE
    assert standing(replace(far, unit=0.0), far.p_value()) == MORE


def test_holm_by_hand():
    """Four tests: the least times 4, the next times 3 ...; never less than one before it, never above one."""
    assert holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02])
    assert holm([0.6, 0.9]) == [1.0, 1.0] and holm([0.04]) == [0.04] and holm([]) == []
    # Bonferroni's first step, then larger levels: 11 of 12 at 0.004 each would all stay, at 0.0045 none.
    assert max(holm([0.004] * 12)) < 0.05 < min(holm([0.0045] * 12))
    # Tests of the family that a run cannot make count as well.
    assert holm([0.01, 0.02], family=8) == pytest.approx([0.08, 0.14])
