"""Outcomes of a run: checks with a known answer, stress tests, how cells ended."""

from __future__ import annotations

import math
from collections import Counter
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from benchmarks.results.run_folder import RunFolder
from reports.finished_run import Run, read_run
from reports.statistics.paper_claims import phrase
from reports.statistics.pareto import NETWORK

BAD = ("failed", "diverged", "timeout", "out-of-memory", "stalled")  # statuses, the worst first


def checks(run: Run) -> pd.DataFrame:
    """Return the known answers, and rows of cells that have a tolerance."""
    is_case, rows = run.frame["case"] != "", run.frame
    checked = np.where(is_case, rows["suite"] != "extremes", rows["tolerance"].notna())
    return rows[checked & (rows["status"] != "skipped")]


def tolerances_away(row: Any) -> float | None:
    """Return |measured - expected| / tolerance; of a number that must be exact 0 or infinite."""
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


def tally(run: Run) -> dict[str, Counter[str]]:
    """Count by status how the cells, checks and stress tests of the run ended."""
    cells = run.frame[(run.frame["case"] == "") & (run.frame["method"] != "")]
    # What has any usable number has run, whatever became of the others.
    best_first = {"stalled": 0, "ok": 1}
    cells = cells.sort_values("status", key=lambda s: s.map(best_first).fillna(2), kind="stable")
    rows = checks(run)
    groups = {
        "cells": cells.drop_duplicates(["suite", "scene", "method", "seed"]),
        "checks": rows[rows["tolerance"].notna() | (rows["status"] != "ok")],
        "stress tests": stress_tests(run),
    }
    return {kind: Counter(rows["status"]) for kind, rows in groups.items() if len(rows)}


LEARNED = ("network", "ablation")
RIVAL = "pbns"  # the network that the paper compares SNUG with
EXTERNAL = "external"  # role of roll-outs from files and programs
MOST_EXTERNAL = 3  # of these that page one shows


def leads(run: Run, rows: pd.DataFrame) -> list[str]:
    """Choose the methods of page one that these rows have.

    They are the reference, SNUG (else SNUG by another recipe, else another network), roll-outs of the
    user, the paper's rival or another network, and a baseline. Without networks, ablations count as such.
    """
    have = set(rows[rows["usable"]]["method"])
    learned = [name for name in run.with_role(*LEARNED) if name in have]
    networks = [name for name in learned if not run.methods[name].base] or learned
    first = min(networks, key=lambda name: (name != NETWORK, not name.startswith(NETWORK)), default="")
    external = [name for name in run.with_role(EXTERNAL) if name in have][:MOST_EXTERNAL]
    other = min((name for name in networks if name != first), key=lambda name: name != RIVAL, default="")
    baseline = next((name for name in run.with_role("baseline") if name in have), "")
    return [name for name in (run.reference, first, *external, other, baseline) if name in have]


PUBLISHED = Path(__file__).resolve().parents[1] / "published"
DEFAULT = "quick"  # the preset that is published, and the folder of its run


@cache
def read_published(folder: Path) -> Run:
    """Return a published run, read once. Raises ResultsError for a run of an earlier version."""
    return read_run(RunFolder(folder))


def published_verdicts() -> str:
    """Return how the published run decides the primary claims; empty where it is not installed."""
    path = PUBLISHED / DEFAULT / "tables" / "findings.csv"
    if not path.is_file():
        return ""
    table = pd.read_csv(path)
    return phrase(Counter(table[table["family"] == "primary"]["verdict"].str.partition(":")[0]))
