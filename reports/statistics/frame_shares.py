"""Shares of frames in which one method has more energy than another, as rows beside the others."""

from __future__ import annotations

from dataclasses import replace

import pandas as pd

from benchmarks.metric import Metric
from reports.statistics.means_and_spreads import Mean

HALF = 50.0  # [%]
FRAME = ["scene", "seed", "seconds"]


def share_of_frames(term: str) -> Metric:
    """Declare the metric of the rows that `with_shares` adds."""
    title = f"Frames with more {term}"
    return Metric(name=f"frames/{term}", unit="%", title=title, definition="", lower_is_better=True)


def half_of(mean: Mean) -> Mean:
    """Return the mean that a share of frames is compared with: half of the frames of each roll-out."""
    return replace(mean, value=HALF, cells=dict.fromkeys(mean.cells, HALF), seeded=False)


def with_shares(rows: pd.DataFrame, frames: pd.DataFrame, term: str, one: str, other: str) -> pd.DataFrame:
    """Return the rows and, for either method, the share of frames in which it has more energy [%].

    Args:
        rows: of the run.
        frames: energies of evaluated frames, as Run.frame_energies.
        term: of the energy, as "strain".
        one: a method.
        other: a second method; they are compared in each scene and seed that both have.
    """
    if frames.empty or term not in frames:
        return rows
    first, second = (frames[frames["method"] == name].dropna(subset=term) for name in (one, other))
    both = first.merge(second, on=FRAME, suffixes=("", "_other"))
    above = {one: both[term] > both[f"{term}_other"], other: both[term] < both[f"{term}_other"]}
    parts = [rows]
    for method, more in above.items():
        shares = (100.0 * more).groupby([both["scene"], both["seed"]]).mean().rename("share").reset_index()
        known = rows[(rows["method"] == method) & (rows["metric"] == f"energy/{term}") & rows["usable"]]
        shared = known.merge(shares, on=["scene", "seed"])
        metric = share_of_frames(term)
        shared = shared.assign(
            metric=metric.name, unit=metric.unit, value=shared["share"], uncertainty=float("nan"),
            moved=[()] * len(shared),
        )  # fmt: skip
        parts.append(shared[rows.columns])
    return pd.concat(parts, ignore_index=True)
