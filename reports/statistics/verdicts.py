"""How one method stands to another in a metric, by one rule: less, more, a tie, or inconclusive.

The rule looks at an effect (reports.statistics.effects) and, of an answer, at its corrected p-value:

    tie            all of the interval lies within the margin: 5 %, or the noise of the reference if that
                   is more; against each simulation with smaller time steps too
    less, more     p is below 0.05, the difference exceeds the reference's noise, and has the same sign
                   against each simulation with smaller time steps
    inconclusive   anything else; fewer than LEAST_MOTIONS motions; a network of one seed

Costs are not tested: their range over motions and seeds lies on one side, within the margin, or on both.
A time without a range, read from the clock once, is inconclusive.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from benchmarks.metric import Metric
from benchmarks.results.protocol import LEAST_MOTIONS, LEVEL
from reports.finished_run import Run
from reports.statistics.effects import DIFFERENCE, EXCESS, RANGE, Effect, cost_effect, effect
from reports.statistics.means_and_spreads import Mean, pair
from reports.statistics.relative_excess import pair_excesses, relative_metric

TIED, OPEN, LESS, MORE = "tie", "inconclusive", "less", "more"  # how the first stands to the second


@dataclass(frozen=True)
class Comparison:
    """Two methods in a metric: their means over the scenes that both have, and the effect.

    Means of an energy whose zero is a choice are relative excesses.
    """

    metric: Metric
    one: Mean | None
    other: Mean | None
    effect: Effect | None


def compare_methods(run: Run, rows: pd.DataFrame, metric: Metric, one: str, other: str) -> Comparison:
    """Compare two methods in a metric over the scenes of these rows that both have.

    Energies whose zero is a choice are compared by their relative excess, costs by their range.
    """
    if metric.arbitrary_zero:
        first, second = pair_excesses(run, rows, one, other, metric.name)
    else:
        first, second = pair(rows, one, other, metric.name)
    size = effect_of(metric, first, second) if first and second else None
    return Comparison(metric, first, second, size)


def measure_of(metric: Metric) -> Metric:
    """Return what is compared of a metric: relative excess where its zero is a choice."""
    return relative_metric(metric.name) if metric.arbitrary_zero else metric


def effect_of(metric: Metric, one: Mean, other: Mean) -> Effect:
    """Compute the effect between two means of a metric, on the metric's scale."""
    if metric.of != "answer":
        return cost_effect(one, other, exact=metric.of == "method")
    # A correlation may be negative, in other runs.
    scale = DIFFERENCE if metric.name.endswith("correlation") else ""
    return effect(one, other, EXCESS if metric.arbitrary_zero else scale)


def decide(effect: Effect, p: float | None, factor: float = 1.0) -> str:
    """Return how `factor` times the first stands to the second: TIED, OPEN, LESS or MORE.

    Args:
        effect: the effect.
        p: of effect.p_value(), corrected where the comparison is one of a family; None for costs.
        factor: of a cost, whose scale is RATIO unless it is 1.

    >>> decide(Effect(0.5, "ratio", error=0.1, freedom=10.0, motions=20), p=0.001)
    'more'
    >>> decide(Effect(0.5, "ratio", error=0.1, freedom=10.0, motions=3), p=0.001)
    'inconclusive'
    """
    if explain_untested(effect):
        return OPEN
    if effect.covers == RANGE:
        return _decide_range(effect, factor)
    if effect.is_equal():
        return TIED
    if p is None or p >= LEVEL or abs(effect.value) <= effect.uncertainty or effect.find_reversals():
        return OPEN
    return LESS if effect.value < 0.0 else MORE


def explain_untested(effect: Effect) -> str:
    """Return why an effect has no verdict, as a remark behind it; empty where it has one.

    >>> explain_untested(Effect(0.5, "ratio", error=0.1, freedom=10.0, motions=3))
    ': fewer than 4 motions'
    """
    if effect.covers == RANGE:
        return "" if effect.limits or effect.exact else ": no range"
    if effect.one_seed:
        return ": one seed"
    return f": fewer than {LEAST_MOTIONS} motions" if effect.motions < LEAST_MOTIONS else ""


def explain(effect: Effect) -> str:
    """Return why an effect is inconclusive, as a remark behind it: untested, or turned by smaller steps.

    >>> explain(Effect(0.5, "ratio", error=0.1, motions=20, against={"simulation-dt/8": -0.6}))
    ': other sign against simulation-dt/8'
    """
    p, turned = effect.p_value(), ", ".join(effect.find_reversals())
    clear = p is not None and p < LEVEL and abs(effect.value) > effect.uncertainty
    return explain_untested(effect) or (f": other sign against {turned}" if turned and clear else "")


def _decide_range(effect: Effect, factor: float) -> str:
    ends = [end + math.log(factor) for end in effect.limits or (effect.value,)]
    if all(abs(end) <= effect.margin for end in ends):
        return TIED
    if max(ends) < 0.0:
        return LESS
    return MORE if min(ends) > 0.0 else OPEN


def holm(p_values: Sequence[float], family: int = 0) -> list[float]:
    """Return the p-values of a family corrected for their number, in their order.

    Args:
        p_values: of the comparisons that were made.
        family: number of comparisons in the family, where it is larger: those not made count as 1.

    Source: Holm's step-down procedure (1979).

    >>> holm([0.01, 0.04, 0.03])
    [0.03, 0.06, 0.06]
    >>> holm([0.01], family=3)
    [0.03]
    """
    count = max(family, len(p_values))
    corrected, largest = [1.0] * len(p_values), 0.0
    for rank, place in enumerate(np.argsort(p_values, kind="stable")):
        largest = max(largest, min(1.0, (count - rank) * p_values[place]))
        corrected[place] = largest
    return corrected
