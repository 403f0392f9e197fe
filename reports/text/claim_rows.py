"""The claims of the paper as rows of a document, with the run that judges each."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from reports.run.finished_run import Run
from reports.statistics.effects import RATIO
from reports.statistics.paper_claims import EXPLORATORY, PRIMARY, Claim, Judged, in_words, judged
from reports.tables.number_texts import DASH, number

HEAD = ["Claim", "Measure", "First", "Claimed", "Second", "Effect", "Interval", "p", "Verdict", "Run"]
NOT_MEASURED = "not measured"


def claim_rows(runs: Sequence[tuple[str, Run]], *, primary: bool) -> list[list[str]]:
    """Return a heading and a row of each claim, judged by the first run that has both of its methods.

    Args:
        runs: (name, run), in the order in which they are asked.
        primary: of the primary family, else the exploratory claims.
    """
    found = _judged(runs)
    claims = PRIMARY if primary else EXPLORATORY
    return [HEAD, *(_row(claim, runs, found.get(claim)) for claim in claims)]


def claim_counts(runs: Sequence[tuple[str, Run]]) -> str:
    """Return how many claims came out how, the primary ones first."""
    found = _judged(runs)
    lines = []
    for name, claims in (("Primary", PRIMARY), ("Exploratory", EXPLORATORY)):
        counts = Counter(found[claim][1].verdict for claim in claims if claim in found)
        absent = len(claims) - counts.total()
        words = ", ".join(
            part for part in (in_words(counts), f"not measured {absent}" * bool(absent)) if part
        )
        lines.append(f"{name} claims: {words}.")
    return "\n".join(lines)


def _judged(runs: Sequence[tuple[str, Run]]) -> dict[Claim, tuple[str, Judged]]:
    found: dict[Claim, tuple[str, Judged]] = {}
    for name, run in runs:
        for line in judged(run):
            found.setdefault(line.claim, (name, line))
    return found


def _row(claim: Claim, runs: Sequence[tuple[str, Run]], found: tuple[str, Judged] | None) -> list[str]:
    methods = [_label(runs, claim.lower), claim.relation, _label(runs, claim.higher)]
    if found is None:
        return [claim.says, claim.metric, *methods, DASH, DASH, DASH, NOT_MEASURED, DASH]
    name, line = found
    far = line.compared.effect
    effect, interval = DASH, DASH
    if far is not None:
        sign = "×" if far.scale == RATIO else ""
        effect = sign + number(far.shown)
        interval = " to ".join(number(end) for end in far.interval or ()) or DASH
    p = DASH if line.p is None else number(line.p, 2)
    found_by = [effect, interval, p, line.verdict + line.remark, name]
    return [claim.says, line.compared.metric.heading, *methods, *found_by]


def _label(runs: Sequence[tuple[str, Run]], method: str) -> str:
    return next((run.label(method) for _, run in runs if method in run.methods), method)
