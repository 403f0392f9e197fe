"""The claims of the paper as rows of a document, with the run that judges each."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

from reports.run.finished_run import Run
from reports.statistics.effects import RATIO
from reports.statistics.paper_claims import BEFORE, EXPLORATORY, PRIMARY, Claim, Judged, in_words, judged
from reports.statistics.verdicts import measure_of
from reports.tables.number_texts import DASH, number

HEAD = ["Claim", "Tested", "Effect", "Interval", "p", "Verdict", "Run"]
NOT_MEASURED = "not measured"
TIMES = ("s", "ms")  # units


@dataclass(frozen=True)
class JudgedClaims:
    """Claims as several runs judge them.

    Attributes:
        verdicts: claim -> name of the first run that has both of its methods, and the claim as it came out.
        labels: method -> its name for people.
        metrics: metric -> its title, with its unit.
    """

    verdicts: Mapping[Claim, tuple[str, Judged]]
    labels: Mapping[str, str]
    metrics: Mapping[str, str]


def judge_in_first(runs: Sequence[tuple[str, Run]], timed: Collection[str]) -> JudgedClaims:
    """Judge each claim by the first of these (name, run) that has both of its methods.

    timed: names of the runs that judge claims on times. A run that shared its machine with other work judges
        none: its methods may have had different shares of the processors.
    """
    verdicts: dict[Claim, tuple[str, Judged]] = {}
    labels: dict[str, str] = {}
    metrics = {BEFORE.name: BEFORE.heading}
    for name, run in runs:
        for line in judged(run):
            if name in timed or line.compared.metric.unit not in TIMES:
                verdicts.setdefault(line.claim, (name, line))
        labels = {method: run.label(method) for method in run.methods} | labels
        metrics |= {metric.name: metric.heading for metric in run.metrics.values()}
    return JudgedClaims(verdicts, labels, metrics)


def claim_rows(claims: JudgedClaims, *, primary: bool) -> list[list[str]]:
    """Return a heading and a row of each claim, judged or not: of the primary family, or exploratory."""
    return [HEAD, *(_row(claim, claims) for claim in (PRIMARY if primary else EXPLORATORY))]


def claim_counts(claims: JudgedClaims) -> str:
    """Return how many tests of claims came out how, those of the primary ones first."""
    lines = []
    for name, family in (("primary", PRIMARY), ("exploratory", EXPLORATORY)):
        counts = Counter(claims.verdicts[claim][1].verdict for claim in family if claim in claims.verdicts)
        absent = len(family) - counts.total()
        texts = [
            in_words(counts),
            f"{absent} {'is' if absent == 1 else 'are'} {NOT_MEASURED}" if absent else "",
        ]
        lines.append(f"Tests of {name} claims: {', '.join(filter(None, texts))}.")
    return "\n".join(lines)


def _row(claim: Claim, claims: JudgedClaims) -> list[str]:
    lower, higher = (claims.labels.get(method, method) for method in (claim.lower, claim.higher))
    relation = f"{lower} {claim.relation} {higher}"
    if claim not in claims.verdicts:
        heading = claims.metrics.get(claim.metric, claim.metric)
        return [claim.says, f"{heading}: {relation}", DASH, DASH, DASH, NOT_MEASURED, DASH]
    name, line = claims.verdicts[claim]
    far = line.compared.effect
    effect, interval = DASH, DASH
    if far is not None:
        effect = ("×" if far.scale == RATIO else "") + number(far.shown)
        interval = " to ".join(number(end) for end in far.interval or ()) or DASH
    p = DASH if line.p is None else number(line.p, 2)
    tested = f"{measure_of(line.compared).heading}: {relation}"
    return [claim.says, tested, effect, interval, p, line.verdict + line.remark, name]
