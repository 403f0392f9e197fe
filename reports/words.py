"""The findings of a run in sentences, computed from its numbers and printed as they come out."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

from benchmarks.results import NOT_FALLING, Row
from reports import findings as paper_findings
from reports import palette
from reports.ablations import compared_in, judged_ablations
from reports.answers import answers
from reports.numbers import number, with_spread
from reports.palette import NETWORKS, REFERENCE
from reports.scatter import TIE, difference
from reports.study_tables import law_measurements
from reports.summary import TERMS, Measurements, dressed_scenes, only, suite_rows

PAPER_TERMS = ("strain", "bending", "gravity", "inertia")
_NAMES = {
    "simulation": "the converged simulation",
    "skinning": "skinning alone",
    "untrained": "an untrained network with a random last layer",
    "supervised": "the supervised network",
}


def findings(rows: Sequence[Row]) -> list[tuple[str, str]]:
    """(topic, sentences): energies, SNUG against each rival, curvature, speed, checks, failures."""
    measured = Measurements(suite_rows(rows, "garments"))
    dressed = measured.only(dressed_scenes(measured))
    found = [
        ("Total energy", lowest_network(dressed)),
        ("Against skinning", against(dressed, "skinning")),
        ("Against PBNS", against(dressed, "pbns")),
        ("Against supervised", against(dressed, "supervised")),
        ("Wrinkles", curvature(dressed)),
        ("Ablations", left_out(rows)),
        ("The paper's findings", judged(rows)),
        ("Held-out training motions", paper_findings.recipe_effects(rows)),
        *answers(rows),
        ("Where it rises", rising(rows)),
        ("Validation", checks(rows)),
        ("Laws", laws(rows)),
        ("Extremes", outcomes(rows)),
        ("Not finished", trouble(rows)),
    ]
    # A number keeps its unit on its line.
    return [
        (topic, re.sub(r"(?<=\d) (?=(J|ms|1/m|%)\b|%)", "\u00a0", words)) for topic, words in found if words
    ]


def name(method: str) -> str:
    """A method within a sentence."""
    return _NAMES.get(method, palette.label(method))


def lowest_network(measured: Measurements) -> str:
    """The main networks by total energy, the lowest first, beside simulation, skinning and no training."""
    scenes = _shared(measured, NETWORKS, "energy/total")
    totals = {m: t for m in NETWORKS if (t := measured.mean(m, "energy/total", scenes)) is not None}
    if not totals:
        return ""
    order = sorted(totals, key=lambda method: totals[method].value)
    best = totals[order[0]]
    rest = [f"{name(method)} {number(totals[method].value)} J" for method in order[1:]]
    text = f"On unseen motions{_only(scenes, measured)} {name(order[0])} has a mean total of "
    text += f"{with_spread(best.value, best.spread)} J per frame"
    text += f", less than {_listed(rest)}." if rest else "."
    others = [
        f"{name(method)} {number(total)} J"
        for method in (REFERENCE, "skinning", "untrained")
        if (total := measured.value(method, "energy/total", scenes)) is not None
    ]
    return text + (f" For comparison: {', '.join(others)}." if others else "")


def against(measured: Measurements, rival: str) -> str:
    """SNUG beside another method, term by term, whichever way it comes out."""
    groups: dict[str, list[str]] = {"lower in": [], "higher in": [], "equal in": []}
    below, compared = set[str](), set[str]()
    told, fewer = False, ""
    for term in TERMS:
        own, other = measured.pair("snug", rival, f"energy/{term}")
        if own is None or other is None:
            continue
        compared.add(term)
        told, fewer = told or own.spread is not None or other.spread is not None, own.fewer or fewer
        a, b = own.value, other.value
        sign = difference(own, other)
        if sign == 0:
            groups["equal in"].append(term)
        else:
            groups["lower in" if sign < 0 else "higher in"].append(f"{term} ({change(a, b)})")
            below |= {term} if sign < 0 else set()
    parts = [f"{word} {_listed(terms)}" for word, terms in groups.items() if terms]
    if not parts:
        return ""
    within = " within the scatter of seeds" if told else f" within {100.0 * TIE:g} %, for want of more seeds"
    text = f"SNUG is {'; '.join(parts)}{within if groups['equal in'] else ''}{fewer}."
    if rival == "pbns":
        asked = compared & set(PAPER_TERMS)
        held = len(below & asked)
        verdict = "is reproduced" if held == len(PAPER_TERMS) else f"is reproduced in {held} of {len(asked)}"
        text += f" The paper's finding, SNUG lower in strain, bending, gravity and inertia, {verdict}."
    return text


def _shared(measured: Measurements, methods: Iterable[str], metric: str) -> tuple[str, ...]:
    """The scenes that those of the methods that have the metric at all have in common."""
    return measured.shared([m for m in methods if measured.mean(m, metric) is not None], metric)


def _only(scenes: Sequence[str], measured: Measurements) -> str:
    return "" if len(scenes) == len(measured.scenes) else only(len(scenes))


def change(value: float, other: float) -> str:
    """From other to value: "−23 %", "3.1 times" beyond a factor of two, or joules where a sign differs."""
    if value <= 0.0 or other <= 0.0:
        return f"{'+' if value > other else ''}{number(value - other)} J"
    if value > 2.0 * other:
        return f"{number(value / other, 2)} times as much"
    if other > 2.0 * value:
        return f"{number(other / value, 2)} times less"
    return f"{'+' if value > other else '−'}{abs(value / other - 1.0) * 100.0:.0f} %"


def curvature(measured: Measurements) -> str:
    """Who is closest to the simulation's wrinkles, and how wrinkled each is by itself."""
    others = [method for method in measured.methods if palette.is_contestant(method)]
    scenes = _shared(measured, others, "curvature/error")
    errors = {m: e for m in others if (e := measured.value(m, "curvature/error", scenes)) is not None}
    if not errors:
        return ""
    order = sorted(errors, key=lambda method: errors[method])
    text = f"Smallest mean-curvature error{_only(scenes, measured)}: "
    text += f"{name(order[0])}, {number(errors[order[0]])} 1/m"
    rest = [f"{name(m)} {number(errors[m])}" for m in order[1:] if m in palette.leading(errors)]
    text += f" ({', '.join(rest)})." if rest else "."
    own, snug = measured.pair(REFERENCE, "snug", "curvature/mean")
    if own is None or snug is None:
        return text
    text += f" Mean curvature itself: the simulation {number(own.value)} 1/m, SNUG {number(snug.value)} 1/m"
    return f"{text}{own.fewer}."


def left_out(rows: Sequence[Row]) -> str:
    """How many ablations are worse than the full recipe in each measure, and which in none, by garment."""
    several = len({row.seed for row in rows}) > 1
    beyond = "beyond the scatter of seeds" if several else f"by more than {100.0 * TIE:g} %"
    sentences, measures = [], compared_in(rows)
    for garment, own in judged_ablations(rows).items():
        worse = {method: ways[0] for method, ways in own.items()}
        counts = [f"{sum(what in found for found in worse.values())} in {what}" for what in measures[garment]]
        text = f"{garment}, of {len(worse)} ablations, worse than full SNUG {beyond}: "
        none = [palette.label(method) for method, found in worse.items() if not found]
        sentences.append(f"{text}{_listed(counts)}{f'; in nothing: {_listed(none)}' if none else ''}.")
    return " ".join(sentences)


def judged(rows: Sequence[Row]) -> str:
    """How the findings of the paper that this run can judge came out."""
    table = paper_findings.findings(rows)
    found = [str(line[-1]) for line in table.rows if line[-1] is not None] if table else []
    if not found:
        return ""
    ways = (paper_findings.REPRODUCED, paper_findings.SCATTERED)
    reproduced, scattered = (sum(word.startswith(way) for word in found) for way in ways)
    text = f"Of {len(found)} comparisons that its findings come to here, {reproduced} come out as there"
    text += f", {scattered} lie within the scatter of seeds" if scattered else ""
    other = len(found) - reproduced - scattered
    return text + (f", {other} do not come out." if other else ".")


def checks(rows: Sequence[Row]) -> str:
    """How many validation checks passed, and which did not."""
    found = suite_rows(rows, "validation")
    asked = [row for row in found if row.metric.startswith("check") and row.status != "skipped"]
    ran = [row for row in asked if row.tolerance is not None or row.status != "ok"]
    if not ran:
        return ""
    bad = [row.scene for row in ran if row.status != "ok"]
    text = f"{len(ran) - len(bad)} of {len(ran)} checks against known answers pass"
    text += f"; failed: {_listed(dict.fromkeys(bad))}." if bad else "."
    known = len(asked) - len(ran)
    return text + (f" {known} more numbers are reported without a verdict." if known else "")


def laws(rows: Sequence[Row]) -> str:
    """How far each method's roll-outs are from the laws of a time step, the simulation's first."""
    measured = law_measurements(rows)
    scenes = _shared(measured, measured.methods, "law/momentum")
    missing = {m: v for m in measured.methods if (v := measured.value(m, "law/momentum", scenes)) is not None}
    if REFERENCE not in missing or len(missing) == 1:
        return ""
    own = number(missing.pop(REFERENCE))
    text = f"Of the balance of momentum {name(REFERENCE)} misses {own} % of the weight in a mean frame"
    order = sorted(missing, key=lambda method: missing[method])
    text += f", {_listed(f'{name(m)} {number(missing[m])} %' for m in order)}."
    above = {m: v for m in order if (v := measured.value(m, "law/descent_frames", scenes))}
    words = [f"{name(m)} in {number(v, 2)} %" for m, v in above.items()]
    return text + (f" Frames that end above a guess that costs nothing: {_listed(words)}." if words else "")


def outcomes(rows: Sequence[Row]) -> str:
    """How many extreme cases converged; the rest by status."""
    ran = [r for r in suite_rows(rows, "extremes") if r.metric == "outcome" and r.status != "skipped"]
    if not ran:
        return ""
    counts: dict[str, int] = {}
    for row in ran:
        counts[row.status] = counts.get(row.status, 0) + 1
    text = f"{counts.pop('ok', 0)} of {len(ran)} cases converged"
    rest = [f"{count} {status}" for status, count in counts.items()]
    return text + (f"; {_listed(rest)}." if rest else ".")


def rising(rows: Sequence[Row]) -> str:
    """Where more iterations or a smaller tolerance end with a larger gap: why, see benchmarks.curves."""
    found: dict[str, list[str]] = {}
    for row in rows:
        if row.metric == "gap/relative" and row.reason.startswith(NOT_FALLING):
            found.setdefault(row.scene, []).append(f"{name(row.method)} ({number(row.value)})")
    scenes = "; ".join(f"{scene}: {', '.join(methods)}" for scene, methods in found.items())
    return f"A gap above that of a coarser member of the family: {scenes}." if scenes else ""


def trouble(rows: Sequence[Row]) -> str:
    """How many cells of garments and speed failed or were skipped."""
    parts = []
    kinds = (
        (False, "failed, diverged, stalled or ran out of time or memory"),
        (True, "skipped for a stated reason"),
    )
    for skipped, words in kinds:
        cells = {
            (row.scene, row.method, row.seed)
            for row in rows
            if row.suite in ("garments", "speed")
            and row.status != "ok"
            and (row.status == "skipped") == skipped
        }
        if cells:
            parts.append(f"{len(cells)} {words}")
    return f"{', '.join(parts)}; the table near the end says which cells and why." if parts else ""


def _listed(items: Iterable[str]) -> str:
    """As "a", "a and b" or "a, b and c"."""
    words = list(items)
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"
