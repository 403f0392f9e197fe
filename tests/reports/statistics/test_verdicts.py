"""One rule says how two methods stand: ties by the interval, margins by the ensemble, Holm's correction."""

from __future__ import annotations

from dataclasses import replace

import pytest

from benchmarks.metric import Metric
from reports.statistics.effects import DIFFERENCE, RANGE, RATIO, Effect
from reports.statistics.verdicts import LESS, MORE, OPEN, TIED, compare_methods, decide, explain, holm
from tests.reports.report_folder import row, run_of

FAR = Effect(0.2, RATIO, error=0.01, freedom=10.0, motions=4)
NEAR = replace(FAR, value=0.01)
PLAIN = replace(FAR, value=0.03, scale=DIFFERENCE, error=0.005)
COST = Effect(-0.4, RATIO, covers=RANGE)
STEP = "simulation-dt/8"


@pytest.mark.parametrize(
    ("far", "changed", "expected"),
    [
        # A tie is an interval within the margin of 5 %, and not a point estimate.
        (NEAR, {}, TIED),
        (NEAR, {"error": 0.03}, OPEN),
        (NEAR, {"value": 0.04, "error": 0.001}, TIED),  # surely different, and negligible
        (FAR, {}, MORE),
        (FAR, {"value": -0.2}, LESS),
        (FAR, {"error": 0.1}, OPEN),
        # The noise of the reference widens the margin and the least difference.
        (FAR, {"uncertainty": 0.1}, MORE),
        (FAR, {"uncertainty": 0.21}, OPEN),
        (FAR, {"uncertainty": 0.3}, TIED),
        # A verdict is one against each time step of the reference.
        (FAR, {"against": {STEP: -0.1}}, MORE),
        (FAR, {"against": {STEP: -0.3}}, OPEN),
        (NEAR, {"against": {STEP: 0.01}}, TIED),
        (NEAR, {"against": {STEP: 0.2}}, OPEN),
        # Few motions, one seed, or nothing repeated.
        (FAR, {"motions": 3}, OPEN),
        (FAR, {"one_seed": True}, OPEN),
        (FAR, {"error": None}, OPEN),
        # A plain difference is a tie within 5 % of its unit.
        (PLAIN, {"unit": 1.0}, TIED),
        (PLAIN, {"unit": 0.5}, MORE),
        (PLAIN, {"unit": 0.0}, MORE),
        # A cost is judged by its range.
        (COST, {"limits": (-0.5, -0.3)}, LESS),
        (COST, {"limits": (0.1, 0.9)}, MORE),
        (COST, {"limits": (-0.1, 0.2)}, OPEN),
        (COST, {"limits": (-0.01, 0.02)}, TIED),
        (COST, {"limits": None}, OPEN),
    ],
)
def test_how_one_method_stands_to_another(far, changed, expected):
    far = replace(far, **changed)
    assert decide(far, far.p_value()) == expected


def test_one_reading_of_a_clock_gives_no_verdict_and_one_of_a_size_does():
    rows = [
        row("tshirt/walk", method, metric, value)
        for method, value in (("snug", 1.0), ("pbns", 1.06))
        for metric in ("cost/frame", "cost/memory")
    ]
    run = run_of(rows)
    metrics = (
        Metric(name=name, unit="1", title=name, definition="", of=of)
        for name, of in (("cost/frame", "machine"), ("cost/memory", "method"))
    )
    time, size = (compare_methods(run, run.frame, m, "snug", "pbns").effect for m in metrics)
    assert (decide(time, None), explain(time)) == (OPEN, ": no range")
    assert (decide(size, None), explain(size)) == (LESS, "")


@pytest.mark.parametrize("name", ["dynamics/correlation", "dynamics/common_correlation"])
def test_correlations_are_compared_by_differences_though_all_are_positive(name):
    run = run_of([row(method=method, metric=name, value=0.5) for method in ("snug", "pbns")])
    assert compare_methods(run, run.frame, run.metrics[name], "snug", "pbns").effect.scale == DIFFERENCE


def test_a_time_step_with_another_sign_is_named():
    far = replace(FAR, against={"simulation-dt/4": -0.1, STEP: -0.3})
    assert explain(far) == f": other sign against {STEP}"


def test_holm_by_hand():
    """Four tests: the least times 4, the next times 3 ...; never less than one before it, never above one."""
    assert holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02])
    assert holm([0.6, 0.9]) == [1.0, 1.0] and holm([0.04]) == [0.04] and holm([]) == []
    # Bonferroni's first step, then larger levels: 11 of 12 at 0.004 each would all stay, at 0.0045 none.
    assert max(holm([0.004] * 12)) < 0.05 < min(holm([0.0045] * 12))
    # Tests of the family that a run cannot make count as well.
    assert holm([0.01, 0.02], family=8) == pytest.approx([0.08, 0.14])
