"""Errors against the reference in multiples of what its ensemble has: 1 is as good as another simulation."""

from __future__ import annotations

import pandas as pd

from benchmarks.results.protocol import LEAST_MEMBERS
from reports.run.finished_run import Run

# Metric -> its value where a roll-out equals the reference.
AT_REFERENCE = {
    "distance/rms": 0.0, "curvature/error": 0.0, "curvature/histogram": 0.0, "dynamics/amplitude": 1.0,
    "dynamics/correlation": 1.0,
}  # fmt: skip


def ensemble_spread(run: Run, rows: pd.DataFrame, metric: str) -> pd.Series:
    """Return scene -> root mean square error against the reference over the members of its ensemble.

    Of members that converged; scenes with fewer than LEAST_MEMBERS of these are left out.
    """
    kept = rows[(rows["metric"] == metric) & rows["usable"] & (rows["status"] == "ok")]
    members = kept[kept["method"].isin(run.reference_ensemble)]
    squares = (members["value"] - AT_REFERENCE.get(metric, 0.0)) ** 2
    of_scene = squares.groupby(members["scene"], observed=True)
    return of_scene.mean()[of_scene.size() >= LEAST_MEMBERS] ** 0.5


def in_spreads(run: Run, rows: pd.DataFrame, method: str, metric: str) -> float | None:
    """Return how many spreads of the reference's ensemble a method is away from the reference.

    In each scene the spread is `ensemble_spread`, and the method's error the root mean square over its seeds.
    The result is the mean error of the scenes over their mean spread; None where no scene has a spread.
    """
    kept = rows[(rows["metric"] == metric) & rows["usable"] & (rows["method"] == method)]
    squares = (kept["value"] - AT_REFERENCE[metric]) ** 2
    spread = ensemble_spread(run, rows, metric)
    error = squares.groupby(kept["scene"], observed=True).mean() ** 0.5
    both = spread.index.intersection(error.index)
    total = float(spread[both].sum())
    return float(error[both].sum()) / total if total > 0.0 else None
