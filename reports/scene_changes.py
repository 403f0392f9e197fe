"""Changes between two runs: what counts as one, and those of single scenes.

A network is tested in each scene over its seeds. Three seeds say little of their scatter, so the scatter
is pooled over the scenes of the method. A scene that scatters more has its own; one that scatters far more
stays out of the pool. The test is Student's with the pooled degrees of freedom, by Bonferroni for all these
tests. A method without seeds is compared with the noise of the reference by a normal quantile at a tenth of
that level.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pandas as pd

from benchmarks.metric import Metric
from benchmarks.results.protocol import LEVEL
from reports.statistics.effects import DIFFERENCE, RATIO, Effect
from reports.statistics.means_and_spreads import AT_REFERENCE, Mean
from reports.tables.table import format_spread, number

GONE, WORSE, BETTER, OTHER = "gone", "worse", "better", "changed"  # verdicts, the first two fail
FAILING = (GONE, WORSE)
ENERGY_TOLERANCE = 0.02  # share of an energy
TOLERANCE = 0.05  # share of any other answer
TIME_TOLERANCE = 0.2  # share of a time or memory that was repeated
# share of the median method's value; a smaller difference is none, whatever it is a share of
FLOOR = 1e-4
# Differences that are none, in a metric's own unit; a lag is searched in steps of 0.01 frames.
ROUND_OFF, LAG_STEPS = 1e-12, 0.02
# Times the reference's noise, beyond which an answer that nothing repeats has changed.
SPREADS = 3.0


@dataclass(frozen=True)
class Change:
    """One line of a comparison: GONE, WORSE, BETTER or OTHER, in a garment or scene; size: in words."""

    verdict: str
    place: str
    method: str
    metric: str
    size: str


def tolerance_of(metric: Metric) -> float:
    """Return the share of a number up to which another one counts as equal.

    >>> tolerance_of(Metric(name="energy/strain", unit="J", title="Strain", definition=""))
    0.02
    """
    if metric.of == "machine":
        return TIME_TOLERANCE
    of_energy = metric.name.startswith(("energy/", "relative_excess/"))
    return ENERGY_TOLERANCE if of_energy else TOLERANCE


def floor_of(metric: Metric, scale: float) -> float:
    """Return the largest difference that is none; scale: the median value."""
    return max(FLOOR * scale, LAG_STEPS if metric.name.endswith("lag") else ROUND_OFF)


def side(metric: Metric, before: float, after: float, difference: float) -> str:
    """Return whether a difference of that sign is worse or better, or just another number.

    What neither side of is better is worse farther from the value that the reference itself has.
    """
    if metric.lower_is_better is not None:
        return WORSE if bool(difference > 0.0) is metric.lower_is_better else BETTER
    default = 1.0 if metric.name.endswith("correlation") else None
    best = AT_REFERENCE.get(metric.name.replace("/common_", "/"), default)
    if best is None:
        return OTHER
    return WORSE if abs(after - best) > abs(before - best) else BETTER


def size_of(metric: Metric, mean: Mean, new_mean: Mean, shift: Effect, p: float | None) -> str:
    """Return a change as "0.21 ± 0.010 -> 0.26 ± 0.010 J, × 1.24 (1.20 to 1.28), p 0.0030"."""
    before, after = (format_spread(m.value, m.spread_or_uncertainty) for m in (mean, new_mean))
    sign = "×" if shift.scale == RATIO else "by"
    text = f"{before} -> {after}{_unit(metric)}, {sign} {number(shift.shown)}"
    if shift.interval:
        text += f" ({' to '.join(number(end) for end in shift.interval)})"
    return text + ("" if p is None else f", p {number(p, 2)}")


def _unit(metric: Metric) -> str:
    return "" if metric.unit == "1" else f" {metric.unit}"


def is_negligible(metric: Metric, mean: Mean, new_mean: Mean, shift: Effect, scale: float) -> bool:
    """Return whether a change of means is too small to be one.

    scale: the median method's value there; unit of a difference whose unit is unknown.
    """
    if abs(new_mean.value - mean.value) <= floor_of(metric, scale):
        return True
    share = tolerance_of(metric)
    limit = share * (shift.unit or scale) if shift.scale == DIFFERENCE else math.log1p(share)
    return abs(shift.value) <= limit


# Times the median scatter of scenes, beyond which a scene is left out of the pooled scatter.
ODD = 3.0
NETWORK_METRIC = ["method", "metric"]


def compare_scenes(one: pd.DataFrame, other: pd.DataFrame, metrics: dict[str, Metric]) -> list[Change]:
    """Return the changes of single scenes; rows of both runs are of the same cells. Costs are left out."""
    from scipy import stats

    answers = [name for name, metric in metrics.items() if metric.of != "machine"]
    frame = pd.concat([one.assign(run=0), other.assign(run=1)], ignore_index=True)
    frame = frame[frame["metric"].isin(answers)].astype(dict.fromkeys((*NETWORK_METRIC, "scene"), str))
    # One seed says nothing of how seeds scatter.
    seeds = frame.groupby(NETWORK_METRIC)["seed"].transform("nunique")
    frame = frame[~frame["seeded"] | (seeds > 1)]
    if frame.empty:
        return []
    level = LEVEL / 2.0 / len(frame.drop_duplicates([*NETWORK_METRIC, "scene"]))
    spreads = max(float(stats.norm.isf(level / 10.0)), SPREADS)
    groups = frame.groupby(NETWORK_METRIC, sort=False)
    rows = pd.concat([_differences(metrics[name], of_group, spreads) for (_, name), of_group in groups])
    margin = rows["error"] * stats.t.isf(level, rows["freedom"])
    rows = rows[rows["shift"].abs() > np.maximum(rows["limit"], margin)]
    return [
        Change(
            side(metrics[row.metric], row.before, row.after, row.shift), row.scene, row.method, row.metric,
            f"{number(row.before)} -> {number(row.after)}{_unit(metrics[row.metric])}",
        )
        for row in rows.itertuples()
    ]  # fmt: skip


def _differences(metric: Metric, rows: pd.DataFrame, spreads: float) -> pd.DataFrame:
    """Return for each scene of one method the difference of the later run from the earlier.

    before, after: means over seeds. shift: the difference on the scale, of logarithms where all values are
    positive, else plain. limit: the largest one on that scale that is no change, at least `spreads` times
    the noise. error: its standard error, 0 without seeds. freedom: degrees of freedom of the error.
    """
    values, run = rows["value"].to_numpy(), rows["run"].to_numpy()
    relative = metric.name.startswith("relative_excess/")
    signed = relative or metric.arbitrary_zero or metric.name.endswith("correlation")
    positive = not signed and values.min() > 0.0
    scaled = np.log(values) if positive else values
    places, scenes = pd.factorize(rows["scene"], sort=True)
    cells = 2 * places + run
    counts = np.bincount(cells)

    def means_of(numbers: np.ndarray) -> np.ndarray:
        """Return (2,scenes): mean over the seeds of either run."""
        return (np.bincount(cells, numbers) / counts).reshape(-1, 2).T

    (old_means, new_means), (before, after) = means_of(values), means_of(scaled)
    draws = pd.factorize(rows["seed"] * 2 + run)[0]
    scatter, freedom = _scatter(scaled - np.stack([before, after])[run, places], places, draws)
    median = float(np.median(np.abs(old_means)))
    floor = floor_of(metric, median)
    noise = spreads * np.hypot(*means_of(rows["uncertainty"].fillna(0.0).to_numpy()))
    share = tolerance_of(metric)
    if positive:
        limit = np.maximum(math.log1p(share), np.log1p((floor + noise) / old_means))
    else:
        unit = 100.0 if relative else np.maximum(np.abs(old_means), median)
        limit = np.maximum(np.maximum(share * unit, floor), noise)
    # On a scale of logarithms a fall by as much is farther than a rise.
    limit = np.where(np.abs(new_means - old_means) <= noise, np.inf, limit)
    error = scatter * np.sqrt((1.0 / counts).reshape(-1, 2).sum(axis=1))
    return pd.DataFrame({
        "scene": scenes, "method": rows["method"].iloc[0], "metric": metric.name, "before": old_means,
        "after": new_means, "shift": after - before, "limit": limit, "error": error, "freedom": freedom,
    })  # fmt: skip


def _scatter(residuals: np.ndarray, places: np.ndarray, draws: np.ndarray) -> tuple[np.ndarray, float]:
    """Return the standard deviation over seeds in each scene, at least the pooled one, and its freedom.

    residuals: (N,) values less the mean over the seeds of their scene and run. places, draws: (N,) numbers
    of their scenes, and of their trainings, each a seed of a run.

    A seed may move all scenes alike. With correlation rho between S scenes, the pooled variance has
    1 + (S - 1) rho^2 times fewer degrees of freedom than with independent scenes.
    """
    squares, freedom = np.bincount(places, residuals**2), np.bincount(places) - 2
    if not freedom.any() or not squares.any():
        return squares * 0.0, math.inf
    spread = np.sqrt(squares / np.maximum(freedom, 1))
    pool = (freedom > 0) & (spread <= ODD * np.median(spread[freedom > 0]))
    if not squares[pool].any():
        pool = freedom > 0
    total = float(freedom[pool].sum())
    pooled = float(squares[pool].sum()) / total
    scenes, in_pool = int(pool.sum()), pool[places]
    numbers = draws[in_pool]
    of_draws = np.bincount(numbers, residuals[in_pool]) / np.maximum(np.bincount(numbers), 1)
    common = float((of_draws**2).sum()) / (draws.max() - 1)
    rho = (scenes * common / pooled - 1.0) / (scenes - 1) if scenes > 1 else 0.0
    total /= 1.0 + (scenes - 1) * min(max(rho, 0.0), 1.0) ** 2
    return np.maximum(spread, math.sqrt(pooled)), total
