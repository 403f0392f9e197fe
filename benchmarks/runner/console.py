"""The summary printed at the end of a run: results in one screen, and remarks on them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from benchmarks.results.row import DECLARED, Row
from benchmarks.runner.rows import MOST_NAMED, SPREAD, first_of

ABLATIONS = "--methods 'simulation,skinning,snug,snug-no-*'"


def summary(rows: Sequence[Row], stages: Iterable[dict[str, Any]], answer: str = "") -> str:
    """Return the answer, the text of page one if there is one, and one line of counts and times."""
    last = []
    for suite in dict.fromkeys(row.suite for row in rows):
        statuses = Counter(row.status for row in rows if row.suite == suite)
        last.append(f"{suite}: " + ", ".join(f"{count} {status}" for status, count in statuses.items()))
    times: Counter[str] = Counter()
    for stage in stages:
        times[stage["name"]] += stage["seconds"]
    longest = ", ".join(f"{name} {seconds:.0f} s" for name, seconds in times.most_common(MOST_NAMED))
    last += [f"time: {times.total():.0f} s ({longest})"] if times else []
    return "\n".join(filter(None, [answer, "; ".join(last)]))


def remarks(rows: Iterable[Row], reused: int, outdated: Mapping[str, str]) -> list[str]:
    """Return remarks for whoever reads the numbers, a line each. outdated: task -> what has changed since."""
    rows, lines = list(rows), []
    if reused:
        lines.append(f"{reused} results taken from earlier runs in this folder")
    lines += named([f"{label}: {remark}" for label, remark in outdated.items()], "outdated in run.json")
    spreads = {f"{row.scene} x {row.method}": row.value or 0.0 for row in rows if row.metric == "cost/spread"}
    wide = {cell: percent for cell, percent in spreads.items() if percent > 100.0 * SPREAD}
    if wide:
        cells = [f"{cell} ({wide[cell]:.0f} %)" for cell in sorted(wide, key=lambda cell: -wide[cell])]
        lines.append(f"repeats more than {100.0 * SPREAD:.0f} % apart: {first_of(cells)}")
    declared = dict.fromkeys(row.method for row in rows if row.declared)
    if declared:
        lines.append(f"run time {DECLARED}: {', '.join(declared)}")
    pretrained = {row.method: row.pretrained for row in rows if row.pretrained}
    if pretrained:
        differences = {remark.partition("; ")[2] for remark in pretrained.values()}
        same = differences.pop() if len(differences) == 1 else "the reasons of their rows say what differs"
        lines.append(f"pretrained, not trained here: {', '.join(pretrained)}; {same}")
    methods = {row.method for row in rows}
    if {"snug", "untrained"} <= methods and not any(name.startswith("snug-no-") for name in methods):
        lines.append(f"not run here, SNUG with one energy of its loss left out: {ABLATIONS}")
    return lines


def named(lines: Sequence[str], where: str, most: int = MOST_NAMED) -> list[str]:
    """Return the first lines, and one that says how many more there are.

    >>> named(["a", "b", "c", "d", "e"], "in results.csv")
    ['a', 'b', 'c', 'and 2 more in results.csv']
    """
    more = len(lines) - most
    return [*lines[:most], *([f"and {more} more {where}"] if more > 0 else [])]
