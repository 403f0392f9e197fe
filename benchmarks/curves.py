"""Does each solver's error fall along its own curve: more iterations or sweeps, a smaller tolerance?

It need not: a step's gap is judged from the method's own past, and cloth that folds otherwise has other
minima. So a rise is no failure, but whoever reads the curve has to know of it.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping

from .methods import METHODS
from .results import NOT_FALLING, Row

METRIC = "gap/relative"


def _families() -> dict[str, tuple[str, ...]]:
    """Methods that are cut short, "<family>-<number>", from few iterations to many."""
    found: dict[str, list[tuple[int, str]]] = {}
    for entry in METHODS:
        if entry.cut_short:
            family, _, cut = entry.name.rpartition("-")
            found.setdefault(family, []).append((int(cut), entry.name))
    return {family: tuple(name for _, name in sorted(cuts)) for family, cuts in found.items()}


# Each from coarse to fine.
CURVES = _families() | {"simulation": ("simulation-1e-2", "simulation-1e-4", "simulation", "simulation-1e-8")}
ROUND_OFF = 1e-6  # a gap below it counts as none: who is called lower there is chance


def remarked(rows: Iterable[Row]) -> list[Row]:
    """The rows, with a reason at each gap above that of a coarser method of its family."""
    rows = list(rows)
    gaps: dict[tuple[str, int], dict[str, float]] = {}
    for row in rows:
        if row.metric == METRIC and row.value is not None:
            gaps.setdefault((row.scene, row.seed), {})[row.method] = row.value
    remarks = {
        (scene, seed, method): remark
        for (scene, seed), found in gaps.items()
        for method, remark in rises(found).items()
    }
    return [
        dataclasses.replace(row, reason=row.reason or remarks[row.scene, row.seed, row.method])
        if row.metric == METRIC and (row.scene, row.seed, row.method) in remarks
        else row
        for row in rows
    ]


def rises(gaps: Mapping[str, float]) -> dict[str, str]:
    """For each method whose gap is above that of a coarser one of its family: a remark that says so.

    gaps: of the methods of one scene and seed, by name.
    """
    remarks = {}
    for family in CURVES.values():
        lowest = ("", float("inf"))
        for method in family:
            if (gap := gaps.get(method)) is None:
                continue
            if gap > max(lowest[1], ROUND_OFF):
                remarks[method] = f"{NOT_FALLING}: {lowest[0]}, the coarser one, has a gap of {lowest[1]:.2g}"
            if gap < lowest[1]:
                lowest = method, gap
    return remarks
