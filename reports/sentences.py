"""Sentences of page one, each from one template: a run that lacks the numbers of one goes without it."""

from __future__ import annotations

import re
from collections.abc import Collection
from functools import lru_cache

import pandas as pd

from reports.finished_run import Run
from reports.statistics.means_and_spreads import error_of_twin
from reports.statistics.outcomes import BAD, EXTERNAL, LEARNED, counted, leads
from reports.statistics.paper_claims import counts, in_words, judged
from reports.statistics.pareto import indistinct
from reports.statistics.relative_excess import (
    RELATIVE_EXCESS,
    Excess,
    excess_of,
    with_relative_excess,
)
from reports.tables.table import in_scenes, listed, number

CURVATURE, DISTANCE = "curvature/histogram", "distance/rms"


def headline(run: Run) -> list[tuple[str, str]]:
    """Return (topic, its sentences) for each topic of page one that the run can tell, the chief one first."""
    texts = {**_measured(run), "How it ended": endings(run)}
    return [(topic, unbroken(text)) for topic, text in texts.items() if text]


@lru_cache(maxsize=4)
def _measured(run: Run) -> dict[str, str]:
    worn = run.garment_rows[run.garment_rows["garment"] == run.first_garment]
    return {"How near": nearness(run, worn), "How certain": _certainty(run, worn)}


def nearness(run: Run, worn: pd.DataFrame) -> str:
    """Say which relative excess each network of page one has in these rows, and in its worst motion."""
    names = [n for n in leads(run, worn) if run.methods[n].role in (*LEARNED, EXTERNAL)]
    rows = with_relative_excess(run, worn)
    known = {name: excess for name in names if (excess := excess_of(run, rows, name))}
    if not known:
        return ""
    # Those in which skinning has an excess: a network that failed in one has a remark on it.
    scenes = set(rows[(rows["metric"] == RELATIVE_EXCESS.name) & rows["usable"]]["scene"])
    shares = [f"{run.label(name)} {_share(excess)}" for name, excess in known.items()]
    worst = [f"{run.label(name)} {number(of.worst[1], 2)} %{of.fewer}" for name, of in known.items()]
    return (
        f"On {len(scenes)} {_kind(run, scenes)}motion{'' if len(scenes) == 1 else 's'} the relative excess "
        f"is: {listed(shares)}, where the reference has 0 % and skinning alone 100 %. "
        f"These are geometric means over independent sources of motion; "
        f"pooled: ratios of sums over motions. Worst motions: {listed(worst)}."
    )


def _kind(run: Run, scenes: Collection[str]) -> str:
    """Return what these scenes' motions are to the networks, before the word "motions"."""
    if set(scenes) <= set(run.trained_on):
        return ""
    return "validation " if set(scenes) <= set(run.with_motion("validation")) else "unseen "


def _share(excess: Excess) -> str:
    """Return a relative excess as "6.1 % (95 % interval 2.3 to 14; pooled 12 %)", and of which roll-outs."""
    remarks = [f"pooled {number(excess.pooled, 2)} %"]
    if ends := excess.effect.interval:
        remarks.insert(0, f"95 % interval {' to '.join(number(end, 2) for end in ends)}")
    return f"{number(excess.typical, 2)} % ({'; '.join(remarks)}){excess.fewer}"


def _certainty(run: Run, worn: pd.DataFrame) -> str:
    """Say which primary claims hold, and how far equally valid simulations lie from the reference."""
    sentences = []
    if counted_claims := counts(judged(run)):
        tests = f"{counted_claims.total()} test{'' if counted_claims.total() == 1 else 's'}"
        sentences.append(f"Of {tests} of primary claims of the paper {in_words(counted_claims)}.")
    distance, curvature = (indistinct(run, worn, metric) for metric in (DISTANCE, CURVATURE))
    if distance and curvature:
        sentences.append(
            f"The reference from another start lies {number(distance, 2)} mm and, by the distribution of "
            f"curvature, {number(curvature, 2)} 1/m away, "
            f"{in_scenes(set(error_of_twin(worn, DISTANCE).index))}: errors below that show no difference."
        )
    return " ".join(sentences)


def endings(run: Run) -> str:
    """Say how many cells, checks and stress tests ended how, with every kind that is not ok."""
    parts = []
    for kind, statuses in counted(run).items():
        bad = [f"{statuses[name]} {name}" for name in (*BAD, "skipped") if statuses[name]]
        parts.append(
            f"of {sum(statuses.values()):,} {kind} {', '.join(bad) if bad else 'all ended well'}"
        )
    parts += [f"{len(run.problems)} files could not be read"] if run.problems else []
    text = "; ".join(parts)
    return f"{text[:1].upper()}{text[1:]}." if text else ""


def unbroken(text: str) -> str:
    """Return the text with each number on the line of its unit."""
    return re.sub(r"(?<=\d) (?=(J|ms|mm|1/m|%)\b|%)", "\u00a0", text)
