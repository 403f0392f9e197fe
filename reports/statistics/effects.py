"""Effect of one method against another on a scale where it is symmetric, with its uncertainty.

Three scales: logarithms of positive numbers; shares of skinning's excess energy, for energies whose zero
is a choice (reports.statistics.relative_excess); plain differences for what is neither. Costs have no
interval but a range.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache

import numpy as np

from benchmarks.results.protocol import DRAWS, LEVEL, SEED, SOFTENING, TIE, noise, trend
from reports.statistics.means_and_spreads import Mean, mean_by_recording

RATIO, EXCESS, DIFFERENCE = "ratio", "excess", "difference"  # scales
RANGE = "range"  # what the limits of a cost are


def rescale(values: np.ndarray | float, scale: str) -> np.ndarray | float:
    """Return values on a scale where effects add up: logarithm, arcsinh(x / SOFTENING), or as they are.

    >>> [float(rescale(x, scale)) for x, scale in ((1.0, RATIO), (0.0, EXCESS), (2.0, DIFFERENCE))]
    [0.0, 0.0, 2.0]
    """
    if scale == RATIO:
        return np.log(values)
    return np.arcsinh(np.divide(values, SOFTENING)) if scale == EXCESS else values


def unscale(values: np.ndarray | float, scale: str) -> np.ndarray | float:
    """Invert `rescale`."""
    if scale == RATIO:
        with np.errstate(over="ignore"):  # a few seeds of what broke can leave the upper end open
            return np.exp(values)
    return SOFTENING * np.sinh(values) if scale == EXCESS else values


@dataclass(frozen=True)
class Effect:
    """Difference of two methods on a scale, with the uncertainty that motions, seeds and the reference leave.

    Attributes:
        value: the first less the second on the scale, mean over recordings and seeds.
        scale: RATIO, EXCESS or DIFFERENCE.
        second: mean of the second on the scale.
        error: standard error of the value; None where nothing was repeated, and of costs.
        freedom: degrees of freedom of Student's t.
        covers: the resampled factors: "motions and seeds", "motions", "seeds" or nothing; RANGE of costs.
        motions: how many independent motions both methods have: segments of one recording are one.
        limits: of costs, the least and the greatest of what was measured, on the scale.
        possible: the least and the greatest effect that there can be, which cut the interval.
        least_p: p-value below which no test of so few motions can go.
        uncertainty: noise of the value, of what the start of the reference changes; 0 where that is
            unknown.
        against: change of the value by each simulation with smaller time steps in the reference's place.
        unit: of a plain difference, what 1 is of: TIE of it is no difference; 0 where that is unknown.
        complete: neither mean lacks a scene or a seed.
        one_seed: whether a mean is of one seed, and nobody knows how far another would move it.
        exact: whether no clock gave the two, such as the size of a network.
    """

    value: float
    scale: str
    second: float = 0.0
    error: float | None = None
    freedom: float = math.inf
    covers: str = ""
    motions: int = 1
    limits: tuple[float, float] | None = None
    possible: tuple[float, float] = (-math.inf, math.inf)
    least_p: float = 0.0
    uncertainty: float = 0.0
    against: Mapping[str, float] = field(default_factory=dict, hash=False)
    unit: float = 0.0
    complete: bool = True
    one_seed: bool = False
    exact: bool = False

    @property
    def shown(self) -> float:
        """Ratio of geometric means; points of skinning's excess; or difference of means."""
        return self._unscale(self.value)

    @property
    def interval(self) -> tuple[float, float] | None:
        """Interval of 95 % of this comparison alone, or the range of a cost; None where nothing repeats.

        Of points it is `ends` with the mean nearer to 0 held, though that mean is uncertain too.
        """
        ends = self.ends
        return None if ends is None else (self._unscale(ends[0]), self._unscale(ends[1]))

    @property
    def ends(self) -> tuple[float, float] | None:
        """Ends of the interval on the scale."""
        if self.error is None:
            return self.limits
        from scipy import stats

        reach = float(stats.t.ppf(1.0 - LEVEL / 2.0, self.freedom)) * self.error
        low, high = self.possible
        return max(self.value - reach, low), min(self.value + reach, high)

    @property
    def margin(self) -> float:
        """Largest difference on the scale that counts as none: TIE, or the uncertainty if larger."""
        tie = TIE * self.unit if self.scale == DIFFERENCE else math.log1p(TIE)
        return max(tie, self.uncertainty)

    def p_value(self) -> float | None:
        """Return the two-sided p-value that the first is the second.

        None where nothing was repeated, and of costs. Below LEVEL where the interval excludes 0 and
        `least_p` is below it.
        """
        from scipy import stats

        if self.error is None:
            return None
        distance = abs(self.value)
        if self.error == 0.0:  # every motion has the same factor between the two
            return 1.0 if distance == 0.0 else self.least_p
        return max(self.least_p, float(2.0 * stats.t.sf(distance / self.error, self.freedom)))

    def is_equal(self) -> bool:
        """Return whether all of the interval lies within the margin; a value without one never does.

        It has to with each simulation of smaller time steps in the reference's place.
        """
        moved = (0.0, *self.against.values())
        ends = self.ends or ()
        return bool(ends) and all(abs(end + change) <= self.margin for end in ends for change in moved)

    def find_reversals(self) -> list[str]:
        """Return the simulations with smaller time steps against which the effect has the other sign."""
        return [
            name for name, change in self.against.items() if (self.value + change) * self.value <= 0.0
        ]

    def _unscale(self, value: float) -> float:
        if self.scale == EXCESS:  # points between typical shares of the two
            first, second = self.second + self.value, self.second
            # The mean nearer to 0 stays and the other moves: so it is the same in either order.
            first, second = (
                (first, first - value) if abs(first) < abs(second) else (second + value, second)
            )
            return float(unscale(first, EXCESS)) - float(unscale(second, EXCESS))
        return float(unscale(value, self.scale))


def effect(one: Mean, other: Mean, scale: str = "", *, unit: float | None = None) -> Effect:
    """Compute the effect between two means over the same motions, as means_and_spreads.pair gives them.

    Args:
        one: the first mean.
        other: the second mean.
        scale: RATIO where both are positive, else DIFFERENCE, unless it is given.
        unit: see Effect; the larger mean where none is given.

    Segments of one recording are one motion, the mean of its segments on the scale.

    The standard error is that of a bootstrap of motions and seeds, of each one fewer than there are, so that
    its variance is that of the mean (Hesterberg 2015). Motions are drawn for both methods at once, as seeds
    are within a pairing group. Drawn crossed, the variance is on average no smaller than the true one (Owen
    2007, "The pigeonhole bootstrap"). Degrees of freedom are Satterthwaite's (1946). A network of one seed
    is taken to have the scatter of the one beside it.
    """
    scale = scale or (RATIO if _is_positive(one) and _is_positive(other) else DIFFERENCE)
    first, second = (_grid(mean, scale) for mean in (one, other))
    grids = _pair_seeds(one, other, first, second)
    repeated = {
        "motions": any((grid != grid[:1]).any() for grid in grids),
        "seeds": any((grid != grid[:, :1]).any() for grid in grids),
    }
    changes = _changes(one, other, scale)
    spread = noise(changes)
    if spread is None:  # as between two runs, whose noises are independent
        noises = (_slope(mean, scale) * (mean.uncertainty or 0.0) for mean in (one, other))
        spread = math.hypot(*noises)
    error, freedom = _bootstrap(grids) if any(repeated.values()) else (None, math.inf)
    return Effect(
        value=float(first.mean() - second.mean()),
        scale=scale,
        second=float(second.mean()),
        error=error,
        freedom=freedom,
        covers=" and ".join(name for name, several in repeated.items() if several),
        motions=len(first),
        uncertainty=spread,
        against=trend(changes),
        unit=max(abs(one.value), abs(other.value)) if unit is None else unit,
        complete=one.complete and other.complete,
        one_seed=_has_one_seed(one, other) or _has_one_seed(other, one),
    )


def cost_effect(one: Mean, other: Mean, *, exact: bool = False) -> Effect:
    """Compute the effect between two costs: the ratio, and its range over motions and seeds, no interval.

    A run time depends on the machine and on the motion, not on chance that another draw would repeat.
    exact: see Effect.
    """
    scale = RATIO if _is_positive(one) and _is_positive(other) else DIFFERENCE
    gaps = [
        float(rescale(first, scale)) - float(rescale(second, scale))
        for (scene, _), first in one.cells.items()
        for (place, _), second in other.cells.items()
        if place == scene
    ]
    limits = (min(gaps), max(gaps)) if min(gaps) < max(gaps) else None
    return replace(effect(one, other, scale), error=None, limits=limits, covers=RANGE, exact=exact)


def _is_positive(mean: Mean) -> bool:
    return all(value > 0.0 for value in mean.cells.values())


def _has_one_seed(mean: Mean, other: Mean) -> bool:
    """Return whether the mean is of one seed and the other one does not show how seeds scatter."""
    return mean.seeded and mean.seeds == 1 and not (other.seeded and other.seeds > 1)


def _changes(one: Mean, other: Mean, scale: str) -> dict[str, float]:
    """Return the change of the effect's value by each member of the reference's family, on the scale.

    Members count that converged in most scenes. They take the reference's place in those in which all of
    them converged, if these are most.
    """
    cells = [
        (cell, mean.moved.get(cell, {})) for mean in (one, other) if mean.moved for cell in mean.cells
    ]
    scenes = {scene for (scene, _), _ in cells}
    names = sorted({name for _, moved in cells for name in moved})
    members: dict[str, set[str]] = {}
    for name in names:
        subset = scenes - {scene for (scene, _), moved in cells if name not in moved}
        if 2 * len(subset) > len(scenes):
            members[name] = subset
    shared = set.intersection(*members.values()) if members else set()
    if 2 * len(shared) <= len(scenes):
        return {}
    return {n: _change_of(one, n, scale, shared) - _change_of(other, n, scale, shared) for n in members}


def _slope(mean: Mean, scale: str) -> float:
    """Return by how much a change of the mean changes it on the scale."""
    if scale == EXCESS:
        return 1.0 / math.hypot(SOFTENING, mean.value)
    return 1.0 / abs(mean.value) if scale == RATIO else 1.0


def _change_of(mean: Mean, name: str, scale: str, scenes: Collection[str]) -> float:
    """Return by how much a member of the family changes the mean over these scenes."""
    changes: dict[tuple[str, int], float] = {}
    for cell, value in mean.cells.items():
        if cell[0] not in scenes:
            continue
        moved = value + mean.moved.get(cell, {}).get(name, 0.0)
        if scale == RATIO and moved <= 0.0:  # no logarithm: to first order
            changes[cell] = moved / value - 1.0
        else:
            changes[cell] = float(rescale(moved, scale)) - float(rescale(value, scale))
    return float(np.mean(list(mean_by_recording(changes).values())))


RECORDING = re.compile(r"/\d+_\d+(_[a-z])?(@|$)")  # names of clips of the library, and of segments


def is_recorded(scene: str) -> bool:
    """Return whether the motion of the scene is a recording of the library, by its name.

    >>> is_recorded("tshirt/01_01_a@clip"), is_recorded("tshirt/kick")
    (True, False)
    """
    return RECORDING.search(scene) is not None


def _grid(mean: Mean, scale: str) -> np.ndarray:
    """Return (M,S): value of each recording with each seed on the scale, both in order."""
    cells = mean_by_recording({cell: float(rescale(value, scale)) for cell, value in mean.cells.items()})
    recordings, seeds = (sorted(set(names)) for names in zip(*cells))
    return np.array([[cells[recording, seed] for seed in seeds] for recording in recordings])


def _pair_seeds(one: Mean, other: Mean, first: np.ndarray, second: np.ndarray) -> list[np.ndarray]:
    """Return grids (M,S) whose means add up to the effect, each with seeds of its own."""
    seeds = [{seed for _, seed in mean.cells} for mean in (one, other)]
    if one.pairing_group and one.pairing_group == other.pairing_group and seeds[0] == seeds[1]:
        return [first - second]
    lone = [mean.seeded and mean.seeds == 1 for mean in (one, other)]
    several = second if lone[0] else first
    if any(lone) and several.shape[1] > 1:  # s^2 / S of the one and s^2 of the other
        mean = several.mean(axis=1, keepdims=True)
        gap = first.mean(axis=1, keepdims=True) - second.mean(axis=1, keepdims=True)
        return [gap + math.sqrt(1.0 + several.shape[1]) * (several - mean)]
    return [first, -second]


def _bootstrap(grids: Sequence[np.ndarray]) -> tuple[float, float]:
    """Return the standard error of the sum of the means of the grids (M,S), and its degrees of freedom."""
    motions = _weights(len(grids[0]), 0)
    seeds = [_weights(grid.shape[1], stream) for stream, grid in enumerate(grids, 1)]
    draws = sum(np.einsum("bs,bs->b", motions @ grid, drawn) for grid, drawn in zip(grids, seeds))
    marginals = [motions @ sum(grid.mean(axis=1) for grid in grids)]
    marginals += [drawn @ grid.mean(axis=0) for grid, drawn in zip(grids, seeds)]
    parts = np.array([part.var() for part in marginals])
    free = np.array([len(grids[0]), *(grid.shape[1] for grid in grids)]) - 1
    terms = parts[free > 0] ** 2 / free[free > 0]
    # Where only motion and seed together scatter, nothing tells: the fewest there can be.
    freedom = parts.sum() ** 2 / terms.sum() if terms.sum() > 0.0 else 1.0
    return float(np.std(draws)), float(freedom)


@cache
def _weights(count: int, stream: int) -> np.ndarray:
    """Return (DRAWS,count): shares of `count` things in draws of count - 1; a single thing is in each."""
    if count == 1:
        return np.ones((DRAWS, 1))
    generator = np.random.default_rng((SEED, stream, count))
    return generator.multinomial(count - 1, np.full(count, 1.0 / count), DRAWS) / (count - 1)
