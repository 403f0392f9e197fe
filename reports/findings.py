"""What the paper found, one line each, with our numbers beside it and whether it came out here.

A line compares one number of two methods. It is reproduced when they differ in the paper's direction by more
than 5 % and more than either spreads over seeds; a difference below that is a tie, which reproduces nothing.
What was not run is a dash.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from benchmarks.results import Row
from reports.summary import Mean, Measurements, dressed_scenes, suite_rows
from reports.table import Cell, Column, Table
from reports.words import TIE

CAPTIONS = {
    "findings": "The paper's findings, and whether each came out here.",
    "recipes": "Each deviation of the default recipe from the paper's text, undone alone and added alone; "
    "means over training motions that were held out.",
}
ROLL_OUTS, RECIPES = "roll-outs", "recipes"  # suites of rows that have no scenes of their own
BOUND = 0.08  # share above the free lower bound within which SNUG's total is to end
STEADY = 0.05  # share by which the energy may rise over a thousand frames
SNUG, QUIET = "snug", "snug-no-noise"
LEFT_OUT = ("bending", "strain", "gravity", "inertia")
OTHERS = {
    "no-noise": "without noise in the first state",
    "window6": "with windows of 6",
    "window12": "with windows of 12",
    "springs": "with springs instead of StVK",
}


@dataclass(frozen=True)
class Claim:
    """lower has less of the metric than higher; by `allowed`, lower may have up to that share more."""

    words: str
    metric: str
    lower: str
    higher: str
    suite: str = "garments"
    allowed: float | None = None


def claims() -> tuple[Claim, ...]:
    """Every finding that is looked at, in the order of the table."""
    found = [
        Claim(f"SNUG is below PBNS in {term}", f"energy/{term}", "snug", "pbns")
        for term in ("strain", "bending", "gravity", "inertia")
    ]
    worse = {f"no-{term}": f"without {term}" for term in LEFT_OUT} | OTHERS
    for name, words in worse.items():
        for metric, what in (("curvature/error", "curvature error"), ("energy/total", "total energy")):
            found.append(Claim(f"Full SNUG has less {what} than {words}", metric, "snug", f"snug-{name}"))
    return (
        *found,
        Claim("The supervised network is smoother than SNUG", "curvature/mean", "supervised", "snug"),
        Claim("SNUG has less curvature error than supervised", "curvature/error", "snug", "supervised"),
        Claim("Noise in the first state means less drift", "roll_out/drift", SNUG, QUIET, ROLL_OUTS),
        Claim("and less energy at the end", "roll_out/last", SNUG, QUIET, ROLL_OUTS),
        Claim(
            "SNUG ends within 8 % of the free lower bound", "energy/total", "snug", "free-bound",
            allowed=BOUND,
        ),
    )  # fmt: skip


def findings(rows: Sequence[Row]) -> Table | None:
    """One line for each claim; None where the run has no SNUG network at all."""
    measured = {suite: Measurements(suite_rows(rows, suite)) for suite in ("garments", ROLL_OUTS)}
    measured["garments"] = measured["garments"].only(dressed_scenes(measured["garments"]))
    if "snug" not in measured["garments"].methods:
        return None
    lines = [_line(claim, measured[claim.suite]) for claim in claims()]
    lines.append(_steady(measured[ROLL_OUTS]))
    columns = (
        Column("finding", "Finding"),
        Column("first", "The first"),
        Column("second", "The second"),
        Column("unit", "Unit"),
        Column("status", "Here"),
    )
    return Table("findings", columns, tuple(lines))


def _line(claim: Claim, measured: Measurements) -> tuple[Cell, ...]:
    lower, higher = (measured.mean(method, claim.metric) for method in (claim.lower, claim.higher))
    unit = measured.units.get(claim.metric)
    return claim.words, lower, higher, unit, verdict(lower, higher, claim.allowed)


def _steady(measured: Measurements) -> tuple[Cell, ...]:
    first, last = (measured.mean("snug", f"roll_out/{end}") for end in ("first", "last"))
    unit = measured.units.get("roll_out/last")
    return "A thousand frames end where they began", last, first, unit, verdict(last, first, STEADY)


def verdict(lower: Mean | None, higher: Mean | None, allowed: float | None = None) -> str | None:
    """In words, whichever way it comes out; None where one of the two was not run."""
    if lower is None or higher is None:
        return None
    if allowed is not None:
        within = lower.value <= (1.0 + allowed) * higher.value
        return "reproduced" if within else "not reproduced"
    least = max(TIE * max(abs(lower.value), abs(higher.value)), lower.spread or 0.0, higher.spread or 0.0)
    if abs(lower.value - higher.value) <= least:
        return "not reproduced: a tie"
    return "reproduced" if lower.value < higher.value else "not reproduced: the other way round"


def recipes(rows: Sequence[Row]) -> Table | None:
    """What each deviation from the paper's text does: python -m benchmarks.recipe_effects."""
    measured = Measurements(suite_rows(rows, RECIPES))
    terms = ("total", "strain", "bending", "gravity", "inertia", "collision")
    columns = [(f"energy/{term}", Column(term, term.capitalize(), "J")) for term in terms]
    columns += [
        ("penetration/vertices", Column("below", "Below the skin", "%")),
        ("train/loss", Column("loss", "Loss", "J")),
        ("train/steps", Column("steps", "Steps")),
    ]
    order = dict.fromkeys(row.method for row in measured.rows)  # default first, as it was run
    # A training is no scene: each mean is over the scenes that can have its metric.
    scenes = {m: [r.scene for r in measured.rows if r.metric == m] for m, _ in columns}
    scenes = {metric: list(dict.fromkeys(found)) for metric, found in scenes.items()}
    lines = [(name, *(measured.mean(name, m, scenes[m]) for m, _ in columns)) for name in order]
    if not lines:
        return None
    return Table("recipes", (Column("recipe", "Recipe"), *(column for _, column in columns)), tuple(lines))
