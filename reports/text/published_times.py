"""Run times as others publish them, beside those of this project's runs, in ms a frame.

reports/published/times has the published ones, of which page, section or file can be named.
"""

from __future__ import annotations

from collections.abc import Sequence

import pandas as pd

from reports.finished_run import Run
from reports.statistics.means_and_spreads import Mean
from reports.statistics.outcomes import PUBLISHED
from reports.tables.table import DASH, Table, number

OURS = ("cost/whole", "cost/frame", "cost/batch")
HEADS = (
    "Method", "Published [ms]", "Device, batch, clock", "Source", "End to end [ms]", "Method alone [ms]",
    "16 at once [ms]",
)  # fmt: skip


def time_rows(costs: Sequence[tuple[Run, Table]], methods: Sequence[str]) -> list[tuple[str, ...]]:
    """Return heads and rows: these methods, then those that are published alone.

    Args:
        costs: runs with their tables of costs; a method is measured in the first that has it.
        methods: names; some have several published times, most none.
    """
    published = pd.read_csv(PUBLISHED / "times" / "published.csv")
    measured: dict[str, tuple[str, ...]] = {}
    for run, table in reversed(costs):
        places = {column.name: k for k, column in enumerate(table.columns)}
        for row in table.rows:
            method, *means = (row[places[name]] for name in ("method", *OURS))
            times = [number(mean.value if isinstance(mean, Mean) else None) for mean in means]
            measured[str(method)] = run.label(str(method)), *times
    sources = {name: rows.to_numpy().tolist() for name, rows in published.groupby("method", sort=False)}
    rows: list[tuple[str, ...]] = [HEADS]
    for name in dict.fromkeys([*methods, *(name for name in sources if name not in measured)]):
        label, *times = measured.get(name, (name, *[DASH] * 3))
        rows += [(label, *cells, *times) for _, *cells in sources.get(name, [[name, *[DASH] * 3]])]
    return rows
