"""Effect of one method against another, with interval, p-value and Holm's correction."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
import pandas as pd

from reports.run.finished_run import Metric, Run
from reports.statistics.means_and_spreads import Mean, pair

TIE = 0.05  # share of the larger of two values up to which they count as equal
LEVEL = 0.05  # of the two-sided tests, and what an interval leaves out
TIED, OPEN, LESS, MORE = "tie", "cannot be told", "less", "more"  # how one mean stands to another
DRAWS, SEED = 10_000, 20220619  # of the bootstrap; the same draws for every comparison


@dataclass(frozen=True)
class Effect:
    """Ratio or difference of two methods, with the uncertainty that motions and seeds leave.

    value: on the scale of the test: the mean over motions and seeds of the difference, of logarithms where
    `ratio`. error: its standard error, None where nothing was repeated; freedom: of Student's t. covers: the
    resampled factors: "motions and seeds", "motions", "seeds" or nothing. scale: by which a difference is a
    share; 0 where nothing is known to be one. complete: neither mean lacks a scene or a
    seed. one_seed: whether a mean is of one seed, and nobody knows how far another would move it.
    """

    value: float
    ratio: bool
    error: float | None = None
    freedom: float = math.inf
    covers: str = ""
    scale: float = 0.0
    complete: bool = True
    one_seed: bool = False

    @property
    def shown(self) -> float:
        """Ratio of the geometric means, or difference of the means."""
        return float(np.exp(self.value)) if self.ratio else self.value

    @property
    def interval(self) -> tuple[float, float] | None:
        """Interval of 95 % of this comparison alone; None where nothing was repeated."""
        if self.error is None:
            return None
        low, high = (self.value + sign * self._quantile * self.error for sign in (-1.0, 1.0))
        with np.errstate(over="ignore"):  # a few seeds of what broke can leave the upper end open
            return (float(np.exp(low)), float(np.exp(high))) if self.ratio else (low, high)

    def p_value(self, factor: float = 1.0) -> float | None:
        """Return the two-sided p-value that `factor` times the first is the second.

        It is below LEVEL where the interval excludes it; None where nothing was repeated.
        """
        from scipy import stats

        if self.error is None:
            return None
        distance = abs(self.above(factor))
        if self.error == 0.0:  # every motion has the same factor between the two
            return float(distance == 0.0)
        return float(2.0 * stats.t.sf(distance / self.error, self.freedom))

    def above(self, factor: float = 1.0) -> float:
        """Return how far `factor` times the first is above the second, on the scale of the test."""
        return self.value + (math.log(factor) if self.ratio else 0.0)

    def equal(self, factor: float = 1.0) -> bool:
        """Return whether all of the interval, or a value without one, is within TIE of equality."""
        reach = 0.0 if self.error is None else self._quantile * self.error
        return abs(self.above(factor)) + reach <= (-math.log1p(-TIE) if self.ratio else TIE * self.scale)

    @property
    def _quantile(self) -> float:
        from scipy import stats

        return float(stats.t.ppf(1.0 - LEVEL / 2.0, self.freedom))


def effect(one: Mean, other: Mean, *, differences: bool = False, scale: float | None = None) -> Effect:
    """Compute the effect between two means over the same motions, as means_and_spreads.pair gives them.

    Positive numbers are compared by their logarithms, cell by cell: a violent motion has more of every energy
    with every method, and what came out a million times as large with one seed is told apart all the same.
    differences: not so here. scale: of which a difference is a share, the larger mean where none is given.

    The standard error is that of a bootstrap that draws motions and seeds, each with replacement and of each
    one fewer than there are: the variance is then that of the mean, not (n - 1) / n of it (Hesterberg 2015).
    Motions are drawn for both methods at once; so are seeds within a pairing group, others by themselves.
    Drawn crossed, the variance is on average no smaller than the true one (Owen 2007, "The pigeonhole
    bootstrap"). The interval is the value and Student's quantile times the error, for percentiles of so few
    values cover too little; the degrees of freedom are Satterthwaite's (1946), of the parts that motions and
    seeds have in the variance. A network of one seed is taken to have the scatter of the one beside it; what
    no seed changes has none. What is the same with every motion, such as the time of a training, is one
    number and was not repeated; so with seeds.
    """
    first, second = _grid(one), _grid(other)
    ratio = bool((first > 0.0).all() and (second > 0.0).all()) and not differences
    if ratio:
        first, second = np.log(first), np.log(second)
    grids = _drawn_alike(one, other, first, second)
    repeated = {
        "motions": any((grid != grid[:1]).any() for grid in grids),
        "seeds": any((grid != grid[:, :1]).any() for grid in grids),
    }
    error, freedom = _bootstrap(grids) if any(repeated.values()) else (None, math.inf)
    return Effect(
        value=float(first.mean() - second.mean()),
        ratio=ratio,
        error=error,
        freedom=freedom,
        covers=" and ".join(name for name, several in repeated.items() if several),
        scale=max(abs(one.value), abs(other.value)) if scale is None else scale,
        complete=one.complete and other.complete,
        one_seed=_one_seed(one, other) or _one_seed(other, one),
    )


def effect_on(metric: Metric, one: Mean, other: Mean, run: Run, rows: pd.DataFrame) -> Effect:
    """Compute the effect between two means of a metric.

    Where its zero is a choice they are compared by their difference, as a share of the excess of skinning
    (the baseline) over the reference in the same scenes of these rows.
    """
    if not metric.arbitrary_zero:
        return effect(one, other)
    rows = rows[rows["scene"].isin({scene for scene, _ in one.cells})]
    baseline = next((name for name in run.with_role("baseline") if name in set(rows["method"])), "")
    high, low = pair(rows, baseline, run.reference, metric.name)
    scale = abs(high.value - low.value) if high and low else 0.0
    return effect(one, other, differences=True, scale=scale)


def _one_seed(mean: Mean, beside: Mean) -> bool:
    """Return whether the mean is of one seed and the other one does not show how seeds scatter."""
    return mean.seeded and mean.seeds == 1 and not (beside.seeded and beside.seeds > 1)


def within_uncertainty(one: Mean, other: Mean, factor: float = 1.0) -> bool:
    """Return whether `factor` times the first differs from the second within the reference's uncertainty.

    False where nobody measured how far equally valid references would move them apart.
    """
    moved = _moved_apart(one, other, factor)
    return moved > 0.0 and abs(factor * one.value - other.value) <= moved


def _moved_apart(one: Mean, other: Mean, factor: float) -> float:
    """Return how far an equally valid reference moves `factor` times the first against the second.

    It is the largest change by one of them in a scene, the mean of scenes: most of a change is common to both
    methods. Where the single changes are unknown, the sum of both uncertainties, which is no less.
    """
    known = [mean.moved and mean.moved.keys() >= mean.cells.keys() for mean in (one, other)]
    if any(mean.uncertainty and not moved for mean, moved in zip((one, other), known)):
        return factor * (one.uncertainty or 0.0) + (other.uncertainty or 0.0)
    largest = []
    for scene in dict.fromkeys(scene for scene, _ in one.cells):
        first, second = (_moved_in(mean, scene) for mean in (one, other))
        references = first.keys() & second.keys() or first.keys() | second.keys()
        apart = [abs(factor * first.get(name, 0.0) - second.get(name, 0.0)) for name in references]
        largest.append(max(apart, default=0.0))
    return float(np.mean(largest)) if largest else 0.0


def _moved_in(mean: Mean, scene: str) -> dict[str, float]:
    """Return the change of the scene's value by each other reference, the mean of seeds."""
    changes: dict[str, list[float]] = {}
    for (where, _), moved in mean.moved.items():
        for name, change in moved.items() if where == scene else ():
            changes.setdefault(name, []).append(change)
    return {name: float(np.mean(of_seeds)) for name, of_seeds in changes.items()}


def standing(one: Mean, other: Mean, far: Effect, p: float | None, factor: float = 1.0) -> str:
    """Return how `factor` times the first stands to the second: TIED, OPEN, LESS or MORE.

    p: of far.p_value(factor), corrected where the comparison is one of a family.
    """
    if far.one_seed:
        return OPEN  # nobody knows how far another would move it
    if within_uncertainty(one, other, factor):
        return TIED
    if p is None or p >= LEVEL:
        if far.equal(factor):
            return TIED
        if p is not None:
            return OPEN
    return LESS if far.above(factor) < 0.0 else MORE


def holm(p_values: Sequence[float]) -> list[float]:
    """Return the p-values of a family corrected for their number, in their order.

    Source: Holm's step-down procedure (1979).

    >>> holm([0.01, 0.04, 0.03])
    [0.03, 0.06, 0.06]
    """
    corrected, largest = [1.0] * len(p_values), 0.0
    for rank, place in enumerate(np.argsort(p_values, kind="stable")):
        largest = max(largest, min(1.0, (len(p_values) - rank) * p_values[place]))
        corrected[place] = largest
    return corrected


def _grid(mean: Mean) -> np.ndarray:
    """Return (M,S): value of each motion with each seed, both in order."""
    scenes, seeds = (sorted(set(names)) for names in zip(*mean.cells))
    return np.array([[mean.cells[scene, seed] for seed in seeds] for scene in scenes])


def _drawn_alike(one: Mean, other: Mean, first: np.ndarray, second: np.ndarray) -> list[np.ndarray]:
    """Return grids (M,S) whose means add up to the effect, each with seeds of its own."""
    seeds = [{seed for _, seed in mean.cells} for mean in (one, other)]
    if one.pairing_group and one.pairing_group == other.pairing_group and seeds[0] == seeds[1]:
        return [first - second]
    lone = [mean.seeded and mean.seeds == 1 for mean in (one, other)]
    several = second if lone[0] else first
    if any(lone) and several.shape[1] > 1:  # s^2 / S of the one and s^2 of the other
        mean = several.mean(axis=1, keepdims=True)
        apart = first.mean(axis=1, keepdims=True) - second.mean(axis=1, keepdims=True)
        return [apart + math.sqrt(1.0 + several.shape[1]) * (several - mean)]
    return [first, -second]


def _bootstrap(grids: Sequence[np.ndarray]) -> tuple[float, float]:
    """Return the standard error of the sum of the means of the grids (M,S), and its degrees of freedom."""
    motions = _weights(len(grids[0]), 0)
    seeds = [_weights(grid.shape[1], stream) for stream, grid in enumerate(grids, 1)]
    draws = sum(np.einsum("bs,bs->b", motions @ grid, drawn) for grid, drawn in zip(grids, seeds))
    alone = [motions @ sum(grid.mean(axis=1) for grid in grids)]
    alone += [drawn @ grid.mean(axis=0) for grid, drawn in zip(grids, seeds)]
    parts = np.array([part.var() for part in alone])
    free = np.array([len(grids[0]), *(grid.shape[1] for grid in grids)]) - 1
    known = parts[free > 0] ** 2 / free[free > 0]
    freedom = parts.sum() ** 2 / known.sum() if known.sum() > 0.0 else math.inf
    return float(np.std(draws)), float(freedom)


@cache
def _weights(count: int, stream: int) -> np.ndarray:
    """Return (DRAWS,count): shares of `count` things in draws of count - 1; a single thing is in each."""
    if count == 1:
        return np.ones((DRAWS, 1))
    generator = np.random.default_rng((SEED, stream, count))
    return generator.multinomial(count - 1, np.full(count, 1.0 / count), DRAWS) / (count - 1)
