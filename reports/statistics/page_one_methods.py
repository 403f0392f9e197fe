"""Methods that page one shows: the reference, SNUG, the best other network and a baseline."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import pandas as pd

from reports.run.finished_run import Run
from reports.statistics.break_even import NETWORK
from reports.statistics.means_and_spreads import mean_of, shared_scenes

LEARNED = ("network", "ablation")
BEST_BY = ("step/distance", "gap/energy", "curvature/error", "energy/total")


def leads(
    run: Run, rows: pd.DataFrame, among: Iterable[str] | None = None, by: Sequence[str] = BEST_BY
) -> list[str]:
    """Choose the methods of page one: reference, SNUG, the best other network, the first baseline.

    Args:
        run: the run.
        rows: of it, in which a method must have a usable number.
        among: methods to choose from; all by default.
        by: metrics; the best network has the lowest of the first that any of them has.

    Ablations count as networks where a run has no others.
    """
    usable = set(rows[rows["usable"]]["method"])
    have = usable if among is None else usable & set(among)
    learned = [name for name in run.with_role(*LEARNED) if name in have]
    others = [name for name in learned if not run.methods[name].base] or learned
    first = NETWORK if NETWORK in others else next(iter(others), "")
    best = _best(rows, [name for name in others if name != first], by)
    baseline = next((name for name in run.with_role("baseline") if name in have), "")
    return [name for name in (run.reference, first, best, baseline) if name in have]


def _best(rows: pd.DataFrame, names: Sequence[str], by: Sequence[str]) -> str:
    """Return the best over the scenes shared by the methods that came through most of them."""
    for metric in by:
        all_means = {name: mean for name in names if (mean := mean_of(rows, name, metric)) is not None}
        most = max((len(mean.cells) for mean in all_means.values()), default=0)
        whole = [name for name, mean in all_means.items() if len(mean.cells) == most]
        scenes = shared_scenes(rows, whole, metric)
        means = {name: mean for name in whole if (mean := mean_of(rows, name, metric, scenes)) is not None}
        if means:
            return min(means, key=lambda name: means[name].value)
    return next(iter(names), "")
