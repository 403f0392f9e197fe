"""The summary printed at the end of a run: results in one screen, and remarks on them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from benchmarks.results.row import DECLARED, USABLE, Row
from benchmarks.runner.rows import NOT_FALLING, SPREAD

COLUMNS = (
    ("energy/total", "total J"),
    ("energy/strain", "strain J"),
    ("energy/bending", "bend J"),
    ("energy/inertia", "inertia J"),
    ("gap/energy", "gap J"),
    ("curvature/error", "dH 1/m"),
    ("distance/rms", "rms mm"),
    ("penetration/surface", "inside %"),
    ("cost/frame", "ms/frame"),
    ("cost/train", "train s"),
)
DASH = "-"
FEWER = "*"
MEANS = ("garments", "speed")  # suites of which the methods' means are shown; of others, counts of endings
MOST_NAMED = 3  # cells, tasks or stages that a line names


def summary(rows: Sequence[Row], stages: Iterable[dict[str, Any]], answer: str = "") -> str:
    """Return means over scenes and seeds of each suite and method, and one line of counts and times.

    answer: text of page one, which stands in place of the means where there is one.
    """
    parts = [answer] if answer else []
    for suite in () if answer else MEANS:
        of_suite = [row for row in rows if row.suite == suite]
        for title, kept in _groups(suite, of_suite):
            parts.append(_table(title, kept))
    last = []
    for suite in dict.fromkeys(row.suite for row in rows if row.suite not in MEANS):
        statuses = Counter(row.status for row in rows if row.suite == suite)
        last.append(f"{suite}: " + ", ".join(f"{count} {status}" for status, count in statuses.items()))
    times: Counter[str] = Counter()
    for stage in stages:
        times[stage["name"]] += stage["seconds"]
    longest = ", ".join(f"{name} {seconds:.0f} s" for name, seconds in times.most_common(MOST_NAMED))
    last += [f"time: {times.total():.0f} s ({longest})"] if times else []
    return "\n".join(filter(None, ["\n\n".join(parts), "; ".join(last)]))


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
        lines.append(f"repeats more than {100.0 * SPREAD:.0f} % apart: {_first_of(cells)}")
    declared = dict.fromkeys(row.method for row in rows if row.declared)
    if declared:
        lines.append(f"run time {DECLARED}: {', '.join(declared)}")
    pretrained = {row.method: row.pretrained for row in rows if row.pretrained}
    if pretrained:
        differences = {remark.partition("; ")[2] for remark in pretrained.values()}
        same = differences.pop() if len(differences) == 1 else "the reasons of their rows say what differs"
        lines.append(f"pretrained, not trained here: {', '.join(pretrained)}; {same}")
    rising = [f"{row.scene} x {row.method}" for row in rows if row.reason.startswith(NOT_FALLING)]
    if rising:
        named_cells = _first_of(list(dict.fromkeys(rising)))
        lines.append(f"more iterations or a smaller tolerance, and a larger gap: {named_cells}")
    return lines


def named(lines: Sequence[str], where: str, most: int = MOST_NAMED) -> list[str]:
    """Return the first lines, and one that says how many more there are.

    >>> named(["a", "b", "c", "d", "e"], "in results.csv")
    ['a', 'b', 'c', 'and 2 more in results.csv']
    """
    more = len(lines) - most
    return [*lines[:most], *([f"and {more} more {where}"] if more > 0 else [])]


def _first_of(names: Sequence[str]) -> str:
    more = len(names) - MOST_NAMED
    return ", ".join(names[:MOST_NAMED]) + (f" and {more} more" if more > 0 else "")


def _groups(suite: str, rows: list[Row]) -> list[tuple[str, list[Row]]]:
    """Return titled groups of rows: scenes of one garment together, scenes of speed each by itself."""
    groups: dict[str, list[Row]] = {}
    for row in rows:
        groups.setdefault(row.garment if suite == "garments" else row.scene, []).append(row)
    if suite != "garments":
        return [(f"speed, {scene}", members) for scene, members in groups.items()]
    titled = []
    for garment, members in groups.items():
        # Not those of long roll-outs and trainings, whose numbers have other names.
        count = len({row.scene for row in members if row.metric == "energy/total"}) or 1
        of = f", {garment}" if len(groups) > 1 else ""
        titled.append((f"garments{of}, mean of {count} scene{'s' * (count > 1)}", members))
    return titled


def _table(title: str, rows: list[Row]) -> str:
    methods = list(dict.fromkeys(row.method for row in rows))
    values: dict[tuple[str, str], list[float]] = {}
    scenes: dict[str, set[str]] = {}
    for row in rows:
        if row.value is not None and row.status in USABLE:
            values.setdefault((row.method, row.metric), []).append(row.value)
            scenes.setdefault(row.metric, set()).add(row.scene)
    seeds = {method: len({row.seed for row in rows if row.method == method}) for method in methods}

    def shown(method: str, metric: str) -> str:
        known = values.get((method, metric))
        if not known:
            return DASH
        return f"{sum(known) / len(known):.4g}" + FEWER * (len(known) < seeds[method] * len(scenes[metric]))

    columns = [(metric, head) for metric, head in COLUMNS if any((m, metric) in values for m in methods)]
    lines = [[title, *(head for _, head in columns), "status"]]
    for method in methods:
        numbers = [shown(method, metric) for metric, _ in columns]
        statuses = dict.fromkeys(row.status for row in rows if row.method == method)
        lines.append([method, *numbers, ", ".join(statuses)])
    widths = [max(len(line[k]) for line in lines) for k in range(len(lines[0]))]
    text = "\n".join(
        "  ".join(cell.ljust(w) if k in (0, len(widths) - 1) else cell.rjust(w)
                  for k, (cell, w) in enumerate(zip(line, widths))).rstrip()
        for line in lines
    )  # fmt: skip
    partly = any(cell.endswith(FEWER) for line in lines for cell in line)
    return text + f"\n{FEWER} over fewer scenes or seeds than its neighbours" * partly
