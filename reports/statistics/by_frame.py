"""Energies of frames: in how many of them one method has more than another, as rows beside the others."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pandas as pd

from benchmarks.results import frame_energies
from reports.run.rows import Metric
from reports.statistics.means import Mean

HALF = 50.0  # [%]
FRAME = ["scene", "seed", "seconds"]


def read_frames(path: Path) -> pd.DataFrame:
    """The lines of frame_energies.csv, none without the file. Raises ResultsError."""
    if not path.is_file():
        return pd.DataFrame()
    columns, lines = frame_energies.read(path)
    return pd.DataFrame(lines, columns=columns)


def share_of_frames(term: str) -> Metric:
    """What `with_shares` measures."""
    return Metric(f"frames/{term}", "%", f"Frames with more {term}", lower_is_better=True)


def half_of(mean: Mean) -> Mean:
    """What a share of frames is compared with: half of them, in each of its roll-outs."""
    return replace(mean, value=HALF, cells=dict.fromkeys(mean.cells, HALF), seeded=False)


def with_shares(rows: pd.DataFrame, frames: pd.DataFrame, term: str, one: str, other: str) -> pd.DataFrame:
    """The rows, and for either method and each scene and seed that both have the share of judged frames in
    which it has more of the energy than the other [%].
    """
    if frames.empty or term not in frames:
        return rows
    own, others = (frames[frames["method"] == name].dropna(subset=term) for name in (one, other))
    both = own.merge(others, on=FRAME, suffixes=("", "_other"))
    above = {one: both[term] > both[f"{term}_other"], other: both[term] < both[f"{term}_other"]}
    made = [rows]
    for method, more in above.items():
        shares = (100.0 * more).groupby([both["scene"], both["seed"]]).mean().rename("share").reset_index()
        known = rows[(rows["method"] == method) & (rows["metric"] == f"energy/{term}") & rows["usable"]]
        shared = known.merge(shares, on=["scene", "seed"])
        metric = share_of_frames(term)
        shared = shared.assign(
            metric=metric.name, unit=metric.unit, value=shared["share"], uncertainty=float("nan"),
            moved=[()] * len(shared),
        )  # fmt: skip
        made.append(shared[rows.columns])
    return pd.concat(made, ignore_index=True)
