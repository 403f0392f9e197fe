"""How far apart seeds alone may put two means: the one rule by which the report calls numbers different."""

from __future__ import annotations

import math
import statistics
from dataclasses import replace

from reports.summary import Mean

TIE = 0.05  # share of the larger of two values by which they may differ where no seeds tell their scatter
LEVEL = 0.975  # of each side: 95 % in all


def scatter(one: Mean, other: Mean) -> float:
    """The threshold of Welch's two-sided 95 % t test, t_{.975, nu} sqrt(s1^2 / n1 + s2^2 / n2) (Welch 1947).

    Where both are of one kin with the same seeds, that of the paired test: t_{.975, n - 1} s / sqrt(n) with s
    of the differences seed by seed. What two ablations draw alike is no scatter between them.
    Of one seed nothing is known: a network is then taken to have the s of the one beside it, and where
    neither has several seeds, `TIE` of the larger value is the threshold. What no seed changes has s = 0.
    """
    from scipy.special import stdtrit

    if pairs := paired(one, other):
        apart_by = statistics.stdev(first - second for first, second in pairs)
        return float(stdtrit(len(pairs) - 1, LEVEL)) * apart_by / math.sqrt(len(pairs))
    spreads = spreads_of(one, other)
    if spreads is None:
        return TIE * max(abs(one.value), abs(other.value))
    first, second = (spread**2 / mean.seeds for spread, mean in zip(spreads, (one, other)))
    if first + second == 0.0:
        return 0.0
    freedom = float(max(one.seeds, other.seeds) - 1)
    if min(one.seeds, other.seeds) > 1:
        freedom = (first + second) ** 2 / (first**2 / (one.seeds - 1) + second**2 / (other.seeds - 1))
    return float(stdtrit(freedom, LEVEL)) * math.sqrt(first + second)


def apart(one: Mean, other: Mean) -> tuple[float, float] | None:
    """How far the first is above the second, and how far seeds alone may put it there, both as shares of the
    second. None where the second is zero.

    Where every seed of both has a positive number, their logarithms are tested: what came out a thousand
    times as large, or a million times with another seed, is told apart from one, though its spread is larger
    than its mean.
    """
    if other.value == 0.0:
        return None
    first, second = _in_logarithms(one), _in_logarithms(other)
    if first and second and spreads_of(first, second):
        factor = first.value - second.value
        return math.expm1(factor), abs(math.expm1(math.copysign(scatter(first, second), factor)))
    size = abs(other.value)
    return (one.value - other.value) / size, scatter(one, other) / size


def difference(one: Mean, other: Mean) -> int:
    """1 where the first is larger by more than seeds scatter, -1 where the second is, else 0."""
    sign = 1
    shares = apart(one, other)
    if shares is None:
        sign, shares = -1, apart(other, one)
    if shares is None or abs(shares[0]) <= shares[1]:
        return 0
    return sign if shares[0] > 0 else -sign


def paired(one: Mean, other: Mean) -> list[tuple[float, float]]:
    """Their values seed by seed, where both are of one kin and have the same seeds, several; else nothing."""
    if not one.kin or one.kin != other.kin or one.by_seed.keys() != other.by_seed.keys():
        return []
    pairs = [(value, other.by_seed[seed]) for seed, value in one.by_seed.items()]
    return pairs if len(pairs) > 1 else []


def _in_logarithms(mean: Mean) -> Mean | None:
    if not mean.by_seed or min(mean.by_seed.values()) <= 0.0:
        return None
    logs = {seed: math.log(value) for seed, value in mean.by_seed.items()}
    spread = statistics.stdev(logs.values()) if len(logs) > 1 else None
    return replace(mean, value=statistics.fmean(logs.values()), spread=spread, by_seed=logs)


def spreads_of(one: Mean, other: Mean) -> tuple[float, float] | None:
    """Both standard deviations over seeds as `scatter` takes them, None where neither has several seeds."""
    known = [mean.spread for mean in (one, other) if mean.spread is not None]
    if not known:
        return None
    first, second = (
        mean.spread if mean.spread is not None else known[0] * mean.seeded for mean in (one, other)
    )
    return first, second
