"""Outcomes of a run: checks with a known answer, stress tests, how cells ended, overstretched roll-outs."""

from __future__ import annotations

import math
from collections import Counter
from typing import Any

import numpy as np
import pandas as pd

from reports.run.finished_run import Run

BAD = ("failed", "diverged", "timeout", "out-of-memory", "stalled")  # statuses, the worst first
STRAIN = {"motion/strain": "strain of its worst frame", "energy/strain": "mean strain"}


def checks(run: Run) -> pd.DataFrame:
    """Return the known answers, and rows of cells that have a tolerance."""
    is_case, rows = run.frame["case"] != "", run.frame
    asked = np.where(is_case, rows["suite"] != "extremes", rows["tolerance"].notna())
    return rows[asked & (rows["status"] != "skipped")]


def check_name(run: Run, row: Any) -> str:
    """Return the name of a check: its case, or the scene and the metric that is judged there."""
    return row.case or f"{row.scene}: {run.metrics[row.metric].title}"


def tolerances_away(row: Any) -> float | None:
    """Return |measured - expected| / tolerance; a number that must be exact is 0 or infinitely many away."""
    distance = abs(row.value - row.expected)
    if pd.isna(distance) or pd.isna(row.tolerance):
        return None
    if row.tolerance:
        return distance / row.tolerance
    return math.inf if distance else 0.0


def stress_tests(run: Run) -> pd.DataFrame:
    """Return the rows of the cases of suite extremes."""
    rows = run.suite("extremes")
    return rows[(rows["case"] != "") & (rows["status"] != "skipped")]


def counted(run: Run) -> dict[str, Counter[str]]:
    """Count by status how the cells, checks and stress tests of the run ended."""
    cells = run.frame[(run.frame["case"] == "") & (run.frame["method"] != "")]
    best_first = {"stalled": 0, "ok": 1}  # what has any usable number has run, whatever became of the others
    cells = cells.sort_values("status", key=lambda s: s.map(best_first).fillna(2), kind="stable")
    judged = checks(run)
    groups = {
        "cells": cells.drop_duplicates(["suite", "scene", "method", "seed"]),
        "checks": judged[judged["tolerance"].notna() | (judged["status"] != "ok")],
        "stress tests": stress_tests(run),
    }
    return {kind: Counter(rows["status"]) for kind, rows in groups.items() if len(rows)}


def overstretched(run: Run) -> list[tuple[str, str, str, float, float]]:
    """List trained networks with more strain than the reference, the worst first.

    Each with method, scene, one of STRAIN, its value [J] and its ratio to the reference's.
    """
    networks = [name for name in run.with_role("network") if not run.methods[name].base]
    strains: dict[tuple[str, str], tuple[str, float, float]] = {}
    for metric in STRAIN:
        rows = run.frame[(run.frame["metric"] == metric) & run.frame["usable"] & (run.frame["garment"] != "")]
        values = rows.groupby(["scene", "method"])["value"].mean()
        for scene, method in values.index:
            base = values.get((scene, run.reference))
            if method in networks and base and (method, scene) not in strains:
                strains[method, scene] = (
                    metric,
                    float(values[scene, method]),
                    float(values[scene, method] / base),
                )
    worst = [(*key, *line) for key, line in strains.items() if line[-1] > 1.0]
    return sorted(worst, key=lambda line: -line[-1])
