"""Outcomes of a run: checks with a known answer, stress tests, how cells ended, overstretched roll-outs."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Collection, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy import stats

from benchmarks.results.protocol import LEVEL, OWN
from benchmarks.results.row import ResultsError
from benchmarks.results.run_folder import RunFolder
from reports.finished_run import Run, read_run
from reports.statistics.effects import EXCESS, off_scale, on_scale, recording_of
from reports.statistics.pareto import NETWORK
from reports.statistics.relative_excess import RELATIVE_EXCESS, with_relative_excess

BAD = ("failed", "diverged", "timeout", "out-of-memory", "stalled")  # statuses, the worst first
STRAINS = ("motion/strain", "energy/strain")  # of the worst frame, and the mean


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


def overstretched(run: Run) -> list[tuple[str, str, float, float]]:
    """List trained networks with more strain than the reference, the worst first.

    Each with method, scene, strain [J] of its worst frame, else the mean, and the ratio to the reference's.
    """
    networks = [name for name in run.with_role("network") if not run.methods[name].base]
    strains: dict[tuple[str, str], tuple[float, float]] = {}
    for metric in STRAINS:
        rows = run.frame[(run.frame["metric"] == metric) & run.frame["usable"] & (run.frame["garment"] != "")]
        values = rows.groupby(["scene", "method"])["value"].mean()
        for (scene, method), value in values.items():
            base = values.get((scene, run.reference))
            if method in networks and base and (method, scene) not in strains:
                strains[method, scene] = float(value), float(value / base)
    worst = [(*key, *line) for key, line in strains.items() if line[-1] > 1.0]
    return sorted(worst, key=lambda line: -line[-1])


LEARNED = ("network", "ablation")
RIVAL = "pbns"  # the network that the paper compares SNUG with
EXTERNAL = "external"  # role of roll-outs from files and programs
MOST_EXTERNAL = 3  # of these that page one shows


def leads(run: Run, rows: pd.DataFrame) -> list[str]:
    """Choose the methods of page one that these rows have: reference, subjects, another network, a baseline.

    The other network is the paper's rival of SNUG, or the first where that did not run. Ablations count as
    networks where a run has no others.
    """
    have = set(rows[rows["usable"]]["method"])
    first = subjects(run, have)
    others = [name for name in _networks(run, have) if name not in first]
    other = RIVAL if RIVAL in others else next(iter(others), "")
    baseline = next((name for name in run.with_role("baseline") if name in have), "")
    return [name for name in (run.reference, *first, other, baseline) if name in have]


def subjects(run: Run, have: Collection[str]) -> list[str]:
    """Return the methods, of those in `have`, that page one is about: SNUG, and roll-outs of the user.

    Where there is none, SNUG by another recipe takes its place, or another network.
    """
    networks = _networks(run, have)
    recipes = [name for name in networks if name.startswith(NETWORK)]
    first = NETWORK if NETWORK in networks else next(iter(recipes or networks), "")
    external = [name for name in run.with_role(EXTERNAL) if name in have]
    return [name for name in (first, *external[:MOST_EXTERNAL]) if name]


def _networks(run: Run, have: Collection[str]) -> list[str]:
    learned = [name for name in run.with_role(*LEARNED) if name in have]
    return [name for name in learned if not run.methods[name].base] or learned


PUBLISHED = Path(__file__).resolve().parents[1] / "published"
DEFAULT = "quick"  # the preset that is published, and the folder of its run


def published_beside(run: Run, method: str) -> str:
    """Return "published 6.8 % on these motions: reproduced", empty for a run that has nothing beside it.

    It has where its preset is the default, its motions have the published frames (`--frames` cuts them), and
    the checkout has the published run. Segments of a recording count as one motion, as in the typical
    relative excess. A method is reproduced where the mean of its m seeds, on the scale of relative excess,
    lies within the interval in which that of m more seeds is expected: the mean of the n published ones, plus
    or minus Student's t times their standard deviation times sqrt(1/m + 1/n).
    """
    if run.config.get("preset") != DEFAULT or not (PUBLISHED / DEFAULT).is_dir():
        return ""
    try:
        published = read_published(PUBLISHED / DEFAULT)
    except ResultsError:
        return ""  # of an earlier version
    if published.config.get("started") == run.config.get("started"):
        return ""  # the published run itself, or another that is made to be published
    if published.protocol != run.protocol:
        return ""
    ours, theirs = _by_seed(run, method), _by_seed(published, method)
    scenes = sorted(set(ours.index) & set(theirs.index))
    if _frames(run, scenes) != _frames(published, scenes):
        return ""
    if not scenes or set(ours.index) - set(scenes):
        return ""
    before, now = (
        values.loc[scenes].groupby(recording_of).mean().mean().to_numpy() for values in (theirs, ours)
    )
    text = f"published {float(off_scale(before.mean(), EXCESS)):.2g} % on these motions"
    if len(before) < 2:
        return text
    reach = stats.t.ppf(1.0 - LEVEL / 2.0, len(before) - 1) * before.std(ddof=1)
    reach *= math.sqrt(1.0 / len(now) + 1.0 / len(before))
    return f"{text}: {'reproduced' if abs(now.mean() - before.mean()) <= reach else 'not reproduced'}"


@cache
def read_published(folder: Path) -> Run:
    """Return a published run, read once. Raises ResultsError for a run of an earlier version."""
    return read_run(RunFolder(folder))


def _frames(run: Run, scenes: Sequence[str]) -> list[int | None]:
    """Return the number of frames of each scene's motion, None where the run does not say."""
    frames, declared = run.config.get("motions", {}).get("frames", {}), run.config.get("scenes", {})
    return [frames.get(declared.get(scene, {}).get("motion")) for scene in scenes]


def _by_seed(run: Run, method: str) -> pd.DataFrame:
    """Return scene x seed -> relative excess of a method of the first garment, on its scale.

    Rows of a user's own scenes or settings, as of self-contact, are left out.
    """
    rows = run.garment_rows
    rows = with_relative_excess(run, rows[rows["garment"] == run.first_garment])
    rows = rows[rows["usable"] & (rows["protocol"] != OWN)]
    kept = rows[(rows["metric"] == RELATIVE_EXCESS.name) & (rows["method"] == method)]
    shares = kept.pivot_table(index="scene", columns="seed", values="value")
    return shares.apply(lambda column: np.asarray(on_scale(column.to_numpy(), EXCESS))).dropna()
