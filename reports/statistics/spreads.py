"""Errors against the reference in multiples of what its ensemble has: 1 is as good as another simulation."""

from __future__ import annotations

import pandas as pd

from benchmarks.results.ensemble import LEAST_MEMBERS
from reports.run.finished_run import Run

# Metric -> its value where a roll-out equals the reference.
AT_REFERENCE = {
    "distance/rms": 0.0, "curvature/error": 0.0, "curvature/histogram": 0.0, "dynamics/amplitude": 1.0,
    "dynamics/correlation": 1.0,
}  # fmt: skip


def in_spreads(run: Run, rows: pd.DataFrame, method: str, metric: str) -> float | None:
    """Return how many spreads of the reference's ensemble a method is away from the reference.

    In each scene the spread is the root mean square over the members of the ensemble, and the method's error
    that over its seeds. The result is the mean error of the scenes over their mean spread; None where fewer
    than LEAST_MEMBERS members converged.
    """
    kept = rows[(rows["metric"] == metric) & rows["usable"]]
    away = kept.assign(square=(kept["value"] - AT_REFERENCE[metric]) ** 2)
    members = away[away["method"].isin(run.reference_ensemble) & (away["status"] == "ok")]
    of_scene = members.groupby("scene")["square"]
    spread = of_scene.mean()[of_scene.size() >= LEAST_MEMBERS] ** 0.5
    error = away[away["method"] == method].groupby("scene")["square"].mean() ** 0.5
    both = spread.index.intersection(error.index)
    total = float(spread[both].sum())
    return float(error[both].sum()) / total if total > 0.0 else None
