"""Sentences of page one, each from one template: a run that lacks the numbers of one goes without it."""

from __future__ import annotations

import math
import re
from collections.abc import Collection
from functools import lru_cache

import pandas as pd

from reports.finished_run import Run
from reports.statistics.means_and_spreads import value_of
from reports.statistics.outcomes import BAD, EXTERNAL, LEARNED, leads, published_verdicts, tally
from reports.statistics.paper_claims import count, judge_claims, phrase
from reports.statistics.pareto import run_time, select_timed
from reports.statistics.relative_excess import RELATIVE_EXCESS, add_excess, excess_of
from reports.statistics.verdicts import compare_methods
from reports.tables.table import number

ALIKE = "dynamics/correlation"


def headline(run: Run) -> list[tuple[str, str]]:
    """Return (topic, its sentences) for each topic of page one, the verdict first."""
    texts = {**_write_topics(run), "How it ended": _count_endings(run)}
    return [(topic, bind_units(text)) for topic, text in texts.items() if text]


@lru_cache(maxsize=4)
def _write_topics(run: Run) -> dict[str, str]:
    rows = run.select_garment(run.first_garment)
    rows = add_excess(run, rows)
    return {
        "Verdict": verdict(run, rows),
        FELL: _name_fallen(run, rows),
        TRAINED: _rate_training(run, rows),
        "How certain": _certainty(run),
    }


FELL = "What fell off the body"


def _name_fallen(run: Run, rows: pd.DataFrame) -> str:
    """Name the methods with roll-outs that have less energy than any garment that is worn."""
    rows = rows[rows["metric"] == RELATIVE_EXCESS.name]
    names = [
        f"{run.label(name)} ({len(usable) - usable.sum()} of {len(usable)} roll-outs)"
        for name, usable in rows.groupby("method", observed=True)["usable"]
        if not usable.all()
    ]
    return f"{', '.join(names)}." if names else ""


TRAINED = "How far trained"


def _rate_training(run: Run, rows: pd.DataFrame) -> str:
    """Say how far networks of the run are from the package's, which are fully trained."""
    texts = []
    for name in run.with_role("network"):
        here, full = (excess_of(run, rows, trained) for trained in (name, f"{name}-packaged"))
        if here and full and here.typical != full.typical:
            shares = f"{number(here.typical, 2)} %, fully trained {number(full.typical, 2)} %"
            texts.append(f"{run.label(name)} {shares}")
    return f"Relative excess as trained in this run: {'; '.join(texts)}." if texts else ""


def verdict(run: Run, frame: pd.DataFrame) -> str:
    """State one method's relative excess, speed-up over the reference, and dynamics.

    It is the user's own, or else the first network of page one that these rows have.
    """
    names = [name for name in leads(run, frame) if run.methods[name].role in (*LEARNED, EXTERNAL)]
    excesses = {name: excess for name in names if (excess := excess_of(run, frame, name))}
    if not excesses:
        return ""
    name = min(excesses, key=lambda name: run.methods[name].role != EXTERNAL)
    excess = excesses[name]
    # Those in which skinning has an excess: a network that failed in one has a remark on it.
    scenes = set(frame[(frame["metric"] == RELATIVE_EXCESS.name) & frame["usable"]]["scene"])
    several = run.garment_rows["garment"].nunique() > 1
    motion = "motion" + f" of the {run.first_garment}" * several
    text = (
        f"In {'a typical' if len(scenes) > 1 else 'one'} {_kind(run, scenes)}{motion} {run.label(name)}'s "
        f"excess energy over a converged simulation is {number(excess.typical, 2)} % of skinning's"
    )
    text += f" (geometric mean; ratio of sums {number(excess.pooled, 2)} %)" if len(scenes) > 1 else ""
    if times := _times_faster(run, name):
        text += f", and {run.label(name)} is more than {times} times faster than the simulation"
    if (correlation := value_of(frame, name, ALIKE)) is not None:
        text += f"; the dynamics of its hem {likeness(correlation)} the simulation's"
    return f"{text}{excess.fewer}."


def _times_faster(run: Run, name: str) -> int:
    """Return to one digit how many times as long the reference takes; 0 where that is unknown."""
    timed, _ = select_timed(run, run.garment_rows)
    metric = run.metrics.get(run_time(timed))
    effect = compare_methods(run, timed, metric, run.reference, name).effect if metric else None
    bound = min(effect.interval or (effect.shown,)) if effect else 0.0
    power = 10 ** math.floor(math.log10(bound)) if bound > 1.0 else 1
    return power * math.floor(bound / power)  # one digit: the simulation is timed once


def likeness(correlation: float) -> str:
    """Return in words how dynamics of that correlation follow others."""
    if correlation < 0.3:
        return "hardly follow"
    return "partly follow" if correlation < 0.8 else "follow"


def _kind(run: Run, scenes: Collection[str]) -> str:
    """Return what these scenes' motions are to the networks, before the word "motions"."""
    if set(scenes) <= set(run.with_motion("training")):
        return ""
    return "validation " if set(scenes) <= set(run.with_motion("validation")) else "unseen "


def _certainty(run: Run) -> str:
    """Say which primary claims hold, with one seed also which hold in the published run."""
    verdicts = count(judge_claims(run))
    if not verdicts:
        return ""
    tests = f"{verdicts.total()} test{'' if verdicts.total() == 1 else 's'}"
    published = published_verdicts() if run.frame["seed"].nunique() == 1 else ""
    remark = f" with one seed; in the published run {published}" if published else ""
    return f"Of {tests} of primary claims of the paper {phrase(verdicts)}{remark}."


def _count_endings(run: Run) -> str:
    """Say how many cells, checks and stress tests did not end well, and how; empty where all did."""
    parts = []
    for kind, statuses in tally(run).items():
        if bad := [f"{statuses[name]} {name}" for name in BAD if statuses[name]]:
            parts.append(f"of {sum(statuses.values()):,} {kind} {', '.join(bad)}")
    parts += ["some files could not be read: standard error names them"] if run.problems else []
    text = "; ".join(parts)
    return f"{text[:1].upper()}{text[1:]}." if text else ""


def bind_units(text: str) -> str:
    """Return the text with each number on the line of its unit."""
    return re.sub(r"(?<=\d) (?=(J|ms|mm|1/m|%)\b|%)", "\u00a0", text)
