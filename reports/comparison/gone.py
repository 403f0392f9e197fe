"""Losses from one run to another: rows that are gone, and cells that ended well in one run alone."""

from __future__ import annotations

import pandas as pd

from reports.comparison.change import BETTER, GONE, WORSE, Change

CELL = ["scene", "method", "seed", "metric"]


def gone(one: pd.DataFrame, other: pd.DataFrame) -> list[Change]:
    """Return a line for each method, and each metric of one, that the later run lacks somewhere.

    Args:
        one: rows of the earlier run, with the columns of CELL and `place`.
        other: rows of the later run.
    """
    keys = [frame.set_index(CELL).index for frame in (one, other)]
    missing = one[~keys[0].isin(keys[1])]
    cells = other.set_index(CELL[:3]).index
    whole = ~missing.set_index(CELL[:3]).index.isin(cells)
    changes = [
        Change(GONE, _list(rows["place"]), str(method), "all metrics", _size(rows))
        for method, rows in missing[whole].groupby("method", sort=False)
    ]
    return changes + [
        Change(GONE, _list(rows["place"]), str(method), str(metric), _size(rows))
        for (method, metric), rows in missing[~whole].groupby(["method", "metric"], sort=False)
    ]


def _list(names: pd.Series) -> str:
    return ", ".join(dict.fromkeys(map(str, names)))


def _size(rows: pd.DataFrame) -> str:
    scenes, seeds = rows["scene"].nunique(), sorted(rows["seed"].unique())
    extent = f"{scenes} scene{'s' * (scenes > 1)}, seed{'s' * (len(seeds) > 1)} {', '.join(map(str, seeds))}"
    return f"not in the later run: {extent}"


def endings(one: pd.DataFrame, other: pd.DataFrame) -> list[Change]:
    """Return cells, checks and stress tests that ended well in one run alone; each cell once."""
    both = one.merge(other, on=CELL, suffixes=("", "_other"))
    # A cell that failed has one row, of a metric that it need not have where it ends well.
    cells = _worst(one).merge(_worst(other), on=CELL[:3], suffixes=("", "_other"))
    rows = pd.concat([both, cells], ignore_index=True)
    good, good_other = rows["status"] == "ok", rows["status_other"] == "ok"
    moved = rows[good != good_other].drop_duplicates([*CELL[:3], "status", "status_other"])
    return [
        Change(
            WORSE if row.status == "ok" else BETTER, row.scene, row.method, row.metric,
            f"{row.status} -> {row.status_other}, seed {row.seed}"
            + (f": {reason}" if (reason := row.reason_other or row.reason) else ""),
        )
        for row in moved.itertuples()
    ]  # fmt: skip


def _worst(frame: pd.DataFrame) -> pd.DataFrame:
    """Return a row of each cell: one that is not ok, where there is one."""
    ordered = frame.iloc[(frame["status"] == "ok").argsort(kind="stable")]
    return ordered.drop_duplicates(CELL[:3])
