"""Whether two means differ by more than seeds scatter: the one rule for calling numbers different."""

from __future__ import annotations

import math
import warnings
from dataclasses import replace

from reports.means import Mean

TIE = 0.05  # share of the larger of two values by which they may differ where no seeds tell their scatter
LEVEL = 0.05  # of the two-sided tests


def difference(one: Mean, other: Mean) -> int:
    """1 where the first is larger by more than seeds scatter, -1 where the second is, else 0.

    Where every seed of both gave a positive number, their logarithms are tested: what came out a thousand
    times as large, or a million times with another seed, is told apart from one, though its spread is larger
    than its mean.
    """
    first, second = _comparable(one, other)
    p = p_value(first, second)
    if p is None:
        apart = abs(one.value - other.value) > TIE * max(abs(one.value), abs(other.value))
    else:
        apart = p < LEVEL
    return int(apart) * (1 if first.value > second.value else -1)


def relative_difference(one: Mean, other: Mean) -> float | None:
    """How far the first is above the second, as a share of it; of their geometric means where logarithms are
    tested. None where the second is zero.
    """
    first, second = _comparable(one, other)
    if first is not one:
        return math.expm1(first.value - second.value)
    return None if other.value == 0.0 else (one.value - other.value) / abs(other.value)


def p_value(one: Mean, other: Mean) -> float | None:
    """Of the two-sided t test that fits; None where neither has several seeds.

    Of one pairing group with the same seeds: paired, seed by seed, for what two ablations draw alike is no
    scatter between them. Both with several seeds: Welch's. A network of one seed is taken to have the scatter
    of the one beside it; what no seed changes is a known number.
    """
    from scipy import stats

    samples = [list(mean.by_seed.values()) for mean in (one, other)]
    if max(map(len, samples)) < 2:
        return None
    if not any(mean.spread for mean in (one, other)):
        return float(one.value == other.value)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # of samples that are nearly constant
        if _paired(one, other):
            test = stats.ttest_rel(samples[0], [other.by_seed[seed] for seed in one.by_seed])
        elif min(map(len, samples)) > 1:
            test = stats.ttest_ind(*samples, equal_var=False)
        elif (one if len(samples[0]) == 1 else other).seeded:
            test = stats.ttest_ind(*samples, equal_var=True)  # with one number its deviation is the other's
        else:
            many, known = (samples[0], other.value) if len(samples[1]) == 1 else (samples[1], one.value)
            test = stats.ttest_1samp(many, known)
    p = float(test.pvalue)
    return 1.0 if math.isnan(p) else p  # of pairs that are all alike


def _paired(one: Mean, other: Mean) -> bool:
    return bool(one.pairing_group) and (
        one.pairing_group == other.pairing_group and one.by_seed.keys() == other.by_seed.keys()
    )


def _comparable(one: Mean, other: Mean) -> tuple[Mean, Mean]:
    """Both in logarithms where these are tested, else as they are."""
    values = [*one.by_seed.values(), *other.by_seed.values()]
    several = max(one.seeds, other.seeds) > 1
    if not several or not one.by_seed or not other.by_seed or min(values) <= 0.0:
        return one, other
    return _in_logarithms(one), _in_logarithms(other)


def _in_logarithms(mean: Mean) -> Mean:
    logs = {seed: math.log(value) for seed, value in mean.by_seed.items()}
    return replace(mean, value=math.fsum(logs.values()) / len(logs), by_seed=logs)
