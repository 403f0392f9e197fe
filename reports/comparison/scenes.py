"""Changes of single scenes of a garment, which a mean over its motions hides.

A network is tested in each scene over its seeds. Three seeds say little of their scatter, so the scatter is
pooled over the scenes of the method, and a scene that scatters more has its own. A scene that scatters far
more than most stays out of the pool: one motion on which seeds disagree would hide changes of all others.
The test is Student's with the pooled degrees of freedom, corrected by Bonferroni for all of these tests. A
method without seeds is compared with the uncertainty that the reference's ensemble leaves.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pandas as pd

from benchmarks.metric import Metric
from benchmarks.results.protocol import LEVEL
from reports.comparison.change import FLOOR, SPREADS, Change, side, size_of_values, tolerance_of

ODD = 3.0  # times the median scatter of scenes, beyond which a scene is left out of the pooled scatter


@dataclass(frozen=True)
class Table:
    """Values of one metric of one method in a run.

    Attributes:
        scenes: names of its rows, sorted.
        values: (scenes, seeds); NaN where a scene lacks a seed.
        uncertainty: (scenes,), 0 where it is unknown.
        seeded: whether the method has seeds.
    """

    scenes: tuple[str, ...]
    values: np.ndarray
    uncertainty: np.ndarray
    seeded: bool


def changed_scenes(one: pd.DataFrame, other: pd.DataFrame, metrics: dict[str, Metric]) -> list[Change]:
    """Return the changes of single scenes.

    Args:
        one: rows of the earlier run: scene, method, seed, metric, value, uncertainty, seeded.
        other: rows of the later run, of the same cells.
        metrics: by name. Times and memory are left out.
    """
    from scipy import stats

    answers = [name for name, metric in metrics.items() if metric.of != "machine"]
    before, after = (_tables(frame[frame["metric"].isin(answers)]) for frame in (one, other))
    parts = [
        _differences(method, metrics[name], table, after[method, name])
        for (method, name), table in before.items()
        if not table.seeded or min(table.values.shape[1], after[method, name].values.shape[1]) > 1
    ]
    if not parts:
        return []
    rows = pd.concat(parts)
    tests = max(int((rows["error"] > 0.0).sum()), 1)
    beyond = rows["error"] * stats.t.isf(LEVEL / 2.0 / tests, rows["freedom"])
    rows = rows[rows["far"].abs() > np.maximum(rows["least"], beyond)]
    changes = []
    for row in rows.itertuples():
        metric = metrics[row.metric]
        size = size_of_values(metric, row.before, row.after)
        changes.append(Change(side(metric, row.far), row.scene, row.method, metric.name, size))
    return changes


def _tables(frame: pd.DataFrame) -> dict[tuple[str, str], Table]:
    """Return (method, metric) -> its table, in the order of the rows.

    The frame is pivoted once: a pivot of each metric of each method takes pandas some 10 s a run.
    """
    if frame.empty:
        return {}
    group = ["method", "metric"]
    pivot = frame.pivot_table(index=[*group, "scene"], columns="seed", values="value")
    unsure = frame.groupby([*group, "scene"])["uncertainty"].mean().reindex(pivot.index).fillna(0.0)
    values, uncertainty = pivot.to_numpy(), unsure.to_numpy()
    scenes = pivot.index.get_level_values("scene").to_numpy()
    seeded = frame.groupby(group, sort=False)["seeded"].any()
    places = pivot.groupby(level=group).indices
    tables = {}
    for key, has_seeds in seeded.items():
        chosen = places[key]
        some = ~np.isnan(values[chosen]).all(axis=0)
        tables[key] = Table(
            tuple(scenes[chosen]), values[chosen][:, some], uncertainty[chosen], bool(has_seeds)
        )
    return tables


def _differences(method: str, metric: Metric, one: Table, other: Table) -> pd.DataFrame:
    """Return for each scene the difference of the later run from the earlier.

    before, after: means over seeds. far: the difference on the scale, of logarithms where all values are
    positive, else plain. least: the largest one on that scale that is no change. error: its standard error, 0
    without seeds. freedom: degrees of freedom of the error.
    """
    before, after = one.values, other.values
    relative = metric.name.startswith("relative_excess/")
    signed = relative or metric.arbitrary_zero
    positive = not signed and min(np.nanmin(before), np.nanmin(after)) > 0.0
    scales = [np.log(x) if positive else x for x in (before, after)]
    far = np.nanmean(scales[1], axis=1) - np.nanmean(scales[0], axis=1)
    scatter, freedom = _scatter(scales)
    share = tolerance_of(metric)
    old, new = np.nanmean(before, axis=1), np.nanmean(after, axis=1)
    median = float(np.median(np.abs(old)))
    moved = SPREADS * np.hypot(one.uncertainty, other.uncertainty)
    if positive:
        least = np.maximum(math.log1p(share), np.log1p((FLOOR * median + moved) / old))
    else:
        unit = 100.0 if relative else np.maximum(np.abs(old), median)
        least = np.maximum(np.maximum(share * unit, FLOOR * median), moved)
    counts = [np.isfinite(x).sum(axis=1) for x in (before, after)]
    error = scatter * np.sqrt(1.0 / counts[0] + 1.0 / counts[1])
    return pd.DataFrame({
        "scene": one.scenes, "method": method, "metric": metric.name, "before": old, "after": new,
        "far": far, "least": least, "error": error, "freedom": freedom,
    })  # fmt: skip


def _scatter(runs: list[np.ndarray]) -> tuple[np.ndarray, float]:
    """Return the standard deviation over seeds in each scene, at least the pooled one, and its freedom.

    A seed may move all scenes alike. With correlation rho between S scenes, the pooled variance has
    1 + (S - 1) rho^2 times fewer degrees of freedom than with independent scenes.
    """
    residuals = [x - np.nanmean(x, axis=1, keepdims=True) for x in runs]
    squares = sum(np.nansum(x**2, axis=1) for x in residuals)
    freedom = sum(np.isfinite(x).sum(axis=1) - 1 for x in runs)
    if not freedom.any() or not squares.any():
        return squares * 0.0, math.inf
    spread = np.sqrt(squares / np.maximum(freedom, 1))
    pool = (freedom > 0) & (spread <= ODD * np.median(spread[freedom > 0]))
    if not squares[pool].any():
        pool = freedom > 0
    total = float(freedom[pool].sum())
    pooled = float(squares[pool].sum()) / total
    residuals = [x[pool] for x in residuals]
    scenes, seeds = int(pool.sum()), sum(x.shape[1] - 1 for x in runs)
    common = sum(float((np.nanmean(x, axis=0) ** 2).sum()) for x in residuals) / seeds
    rho = (scenes * common / pooled - 1.0) / (scenes - 1) if scenes > 1 else 0.0
    total /= 1.0 + (scenes - 1) * min(max(rho, 0.0), 1.0) ** 2
    return np.maximum(spread, math.sqrt(pooled)), total
