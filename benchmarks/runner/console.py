"""The summary printed at the end of a run: results in one screen, and remarks on them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from benchmarks.results.row import USABLE, Row
from benchmarks.runner.rows import DECLARED, NOT_FALLING, SPREAD
from benchmarks.tasks.pretrained_network import PRETRAINED

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


def summary(rows: Sequence[Row], stages: Iterable[dict[str, Any]], answer: str = "") -> str:
    """Return means over scenes and seeds of each suite and method, counts of cases, and stage times.

    answer: text of page one, which stands in place of the means where there is one.
    """
    parts = [answer] if answer else []
    for suite in () if answer else MEANS:
        of_suite = [row for row in rows if row.suite == suite]
        for title, kept in _groups(suite, of_suite):
            parts.append(_table(title, kept))
    for suite in dict.fromkeys(row.suite for row in rows if row.suite not in MEANS):
        kept = [row for row in rows if row.suite == suite]
        if kept:
            counts = {s: sum(row.status == s for row in kept) for s in dict.fromkeys(r.status for r in kept)}
            parts.append(f"{suite}: " + ", ".join(f"{count} {status}" for status, count in counts.items()))
    parts.append("stages: " + "; ".join(f"{stage['name']} {stage['seconds']:.0f} s" for stage in stages))
    return "\n\n".join(parts)


def remarks(rows: Iterable[Row], reused: int, outdated: Mapping[str, str]) -> list[str]:
    """Return remarks for whoever reads the times, a line each. outdated: task -> what has changed since."""
    rows, lines = list(rows), []
    if reused:
        lines.append(f"{reused} results taken from earlier runs in this folder")
    lines += [f"{label}: {remark}" for label, remark in outdated.items()]
    spreads = {f"{row.scene} x {row.method}": row.value or 0.0 for row in rows if row.metric == "cost/spread"}
    wide = [f"{cell} ({percent:.0f} %)" for cell, percent in spreads.items() if percent > 100.0 * SPREAD]
    if wide:
        lines.append(f"repeats more than {100.0 * SPREAD:.0f} % apart: {', '.join(wide)}")
    declared = dict.fromkeys(row.method for row in rows if row.reason == DECLARED)
    if declared:
        lines.append(f"run time {DECLARED}: {', '.join(declared)}")
    pretrained = {row.reason[row.reason.index(PRETRAINED) :] for row in rows if PRETRAINED in row.reason}
    lines += [f"not trained here: {remark}" for remark in sorted(pretrained)]
    rising = [f"{row.scene} x {row.method}" for row in rows if row.reason.startswith(NOT_FALLING)]
    if rising:
        lines.append(f"more iterations or a smaller tolerance, and a larger gap: {', '.join(rising)}")
    return lines


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
