"""Changes of single scenes of a garment, which a mean over its motions hides.

A network is tested in each scene over its seeds. Three seeds say little of their scatter, so the scatter is
pooled over all scenes of the method, and a scene that scatters more has its own. The test is Student's with
the pooled degrees of freedom, corrected by Bonferroni for all of these tests. A method without seeds is
compared with the uncertainty that the reference's ensemble leaves.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pandas as pd

from reports.comparison.change import FLOOR, SPREADS, Change, side, size_of_values, tolerance_of
from reports.run.finished_run import Metric
from reports.statistics.effects import LEVEL


@dataclass(frozen=True)
class Difference:
    """Difference of a method's metric in one scene, the later run less the earlier.

    Attributes:
        scene: its name.
        method: name of the method.
        metric: the metric.
        before: mean over seeds in the earlier run.
        after: mean over seeds in the later run.
        far: difference on the scale: of logarithms where all values are positive, else plain.
        least: largest difference on that scale that is no change.
        error: standard error; 0 without seeds.
        freedom: degrees of freedom of the error.
    """

    scene: str
    method: str
    metric: Metric
    before: float
    after: float
    far: float
    least: float
    error: float = 0.0
    freedom: float = math.inf


def changed_scenes(one: pd.DataFrame, other: pd.DataFrame, metrics: dict[str, Metric]) -> list[Change]:
    """Return the changes of single scenes.

    Args:
        one: rows of the earlier run: scene, method, seed, metric, value, uncertainty, seeded.
        other: rows of the later run, of the same cells.
        metrics: by name. Times and memory are left out.
    """
    from scipy import stats

    differences: list[Difference] = []
    later = dict(list(other.groupby(["method", "metric"], sort=False)))
    for (method, name), rows in one.groupby(["method", "metric"], sort=False):
        if metrics[name].of != "machine":
            differences += _differences(method, metrics[name], rows, later[method, name])
    tests = sum(difference.error > 0.0 for difference in differences)
    changes = []
    for d in differences:
        reach = 0.0
        if d.error > 0.0:
            reach = d.error * float(stats.t.isf(LEVEL / 2.0 / tests, d.freedom))
        if abs(d.far) > max(d.least, reach):
            size = size_of_values(d.metric, d.before, d.after)
            changes.append(Change(side(d.metric, d.far), d.scene, d.method, d.metric.name, size))
    return changes


def _differences(method: str, metric: Metric, one: pd.DataFrame, other: pd.DataFrame) -> Iterator[Difference]:
    """Yield the difference of each scene that both have; of a network, where both have two seeds."""
    before, after = (rows.pivot_table(index="scene", columns="seed", values="value") for rows in (one, other))
    scenes = before.index.intersection(after.index)
    before, after = before.loc[scenes], after.loc[scenes]
    if bool(one["seeded"].any()) and min(before.shape[1], after.shape[1]) < 2:
        return
    relative = metric.name.startswith("relative_excess/")
    signed = relative or metric.arbitrary_zero
    positive = not signed and min(one["value"].min(), other["value"].min()) > 0.0
    scales = [np.log(x) if positive else x for x in (before, after)]
    far = scales[1].mean(axis=1) - scales[0].mean(axis=1)
    scatter, freedom = _scatter(scales)
    share = tolerance_of(metric)
    median = float(before.mean(axis=1).abs().median())
    moved = SPREADS * np.hypot(*(_uncertainty(rows).reindex(scenes).fillna(0.0) for rows in (one, other)))
    for scene in scenes:
        old, new = float(before.loc[scene].mean()), float(after.loc[scene].mean())
        unit = 100.0 if relative else max(abs(old), median)
        if positive:
            least = max(math.log1p(share), math.log1p((FLOOR * median + moved[scene]) / old))
        else:
            least = max(share * unit, FLOOR * median, moved[scene])
        counts = before.loc[scene].count(), after.loc[scene].count()
        error = scatter[scene] * math.sqrt(1.0 / counts[0] + 1.0 / counts[1])
        yield Difference(scene, method, metric, old, new, float(far[scene]), least, error, freedom)


def _scatter(runs: list[pd.DataFrame]) -> tuple[pd.Series, float]:
    """Return the standard deviation over seeds in each scene, at least the pooled one, and its freedom.

    A seed may move all scenes alike. With correlation rho between S scenes, the pooled variance has
    1 + (S - 1) rho^2 times fewer degrees of freedom than with independent scenes.
    """
    residuals = [x.sub(x.mean(axis=1), axis=0) for x in runs]
    squares = sum((x**2).sum(axis=1) for x in residuals)
    freedom = sum(x.count(axis=1) - 1 for x in runs)
    total = float(freedom.sum())
    if total == 0.0 or not squares.any():
        return squares * 0.0, math.inf
    pooled = float(squares.sum()) / total
    scenes, seeds = len(squares), sum(x.shape[1] - 1 for x in runs)
    common = sum(float((x.mean(axis=0) ** 2).sum()) for x in residuals) / seeds
    rho = (scenes * common / pooled - 1.0) / (scenes - 1) if scenes > 1 else 0.0
    total /= 1.0 + (scenes - 1) * min(max(rho, 0.0), 1.0) ** 2
    own = np.sqrt(squares / freedom.where(freedom > 0))
    return own.fillna(0.0).clip(lower=math.sqrt(pooled)), total


def _uncertainty(rows: pd.DataFrame) -> pd.Series:
    return rows.groupby("scene")["uncertainty"].mean().fillna(0.0)
