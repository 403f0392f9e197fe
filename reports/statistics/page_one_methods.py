"""Methods that page one shows: reference, SNUG, roll-outs of the user, one other network, a baseline."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence

import pandas as pd

from reports.run.finished_run import Run
from reports.statistics.break_even import NETWORK
from reports.statistics.means_and_spreads import mean_of, shared_scenes

LEARNED = ("network", "ablation")
RIVAL = "pbns"  # the network that the paper compares SNUG with
EXTERNAL = "external"  # role of roll-outs from files and programs
MOST_EXTERNAL = 3  # of these that page one shows
BEST_BY = ("step/distance", "gap/energy", "curvature/error", "energy/total")


def leads(
    run: Run, rows: pd.DataFrame, among: Iterable[str] | None = None, by: Sequence[str] = BEST_BY
) -> list[str]:
    """Choose the methods of page one: reference, subjects, another network, the first baseline.

    The other network is the paper's rival of SNUG, or the best one where that did not run.

    Args:
        run: the run.
        rows: of it, in which a method must have a usable number.
        among: methods to choose from; all by default.
        by: metrics; the best network has the lowest of the first that any of them has.

    Ablations count as networks where a run has no others.
    """
    usable = set(rows[rows["usable"]]["method"])
    have = usable if among is None else usable & set(among)
    first = subjects(run, have)
    others = [name for name in _networks(run, have) if name not in first]
    other = RIVAL if RIVAL in others else _best(rows, others, by)
    baseline = next((name for name in run.with_role("baseline") if name in have), "")
    return [name for name in (run.reference, *first, other, baseline) if name in have]


def subjects(run: Run, have: Collection[str]) -> list[str]:
    """Return the methods, of those in `have`, that page one is about: SNUG, and roll-outs of the user.

    Where there is none, SNUG by another recipe takes its place, or another network.
    """
    networks = _networks(run, have)
    recipes = [name for name in networks if name.startswith(NETWORK)]
    first = NETWORK if NETWORK in networks else next(iter(recipes or networks), "")
    external = [name for name in run.with_role(EXTERNAL) if name in have]
    return [name for name in (first, *external[:MOST_EXTERNAL]) if name]


def _networks(run: Run, have: Collection[str]) -> list[str]:
    learned = [name for name in run.with_role(*LEARNED) if name in have]
    return [name for name in learned if not run.methods[name].base] or learned


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
