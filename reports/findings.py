"""What the paper found, one line each, with our numbers beside it and whether it came out here.

A line compares one number of two methods, as means over the scenes that both have. It is reproduced when they
differ in the paper's direction by more than their seeds scatter (`reports.scatter`); a smaller difference is
within that scatter, which reproduces nothing. The last line compares a network with itself and has no such
scatter: its energy may rise by `STEADY`. What was not run is a dash.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from benchmarks.results import Row
from reports.ablations import ABLATIONS, LONG, ROLL_OUTS
from reports.numbers import number
from reports.scatter import apart, difference
from reports.summary import Mean, Measurements, dressed_scenes, suite_rows
from reports.table import Cell, Column, Table

CAPTIONS = {
    "findings": "The paper's findings, and whether each came out here. Apart: by how much the first is above "
    "the second (the geometric means of positive numbers), over the scenes that both have; scatter of "
    "seeds: as defined at the end. SNUG and PBNS train on mixed clips too, the supervised network on those "
    "given alone.",
    "recipes": "Each deviation of the default recipe from the paper's text, undone alone and added alone; "
    "means over training motions that were held out. States are remembered on the mean body alone, so with "
    "the paper's shapes that line is less noise alone. The paper's rate drops after ten epochs, which are "
    "more steps where windows overlap or motions are mixed.",
}
RECIPES = "recipes"  # suite of rows that have no scenes of their own
MOST = 3  # deviations that a sentence names
STEADY = 0.05  # share by which the energy may rise over a thousand frames
REPRODUCED, NOT_REPRODUCED, SCATTERED = "reproduced", "not reproduced", "within the scatter of seeds"
SNUG, QUIET, NOISY, SPRINGS = "snug", "snug-no-noise", "snug-noise-alone", "snug-springs"


@dataclass(frozen=True)
class Claim:
    """The first method has less of the metric than the second. better: whether less of it is better, so that
    what diverged has more.
    """

    words: str
    metric: str
    lower: str
    higher: str
    suite: str = "garments"
    better: bool = True


def claims() -> tuple[Claim, ...]:
    """Every finding that is looked at, in the order of the table."""
    found = [
        Claim(f"SNUG is below PBNS in {term}", f"energy/{term}", SNUG, "pbns")
        for term in ("strain", "bending", "gravity", "inertia")
    ]
    for name, words in ABLATIONS.items():
        for metric, what in (("energy/total", "total energy"), ("curvature/error", "curvature error")):
            # StVK's energy is not what springs minimised; noise alone is the paper's choice.
            if name not in (QUIET, NOISY) and (name, metric) != (SPRINGS, "energy/total"):
                found.append(Claim(f"Full SNUG has less {what} than {words}", metric, SNUG, name))
    for name in ("snug-no-inertia", "snug-window6", "snug-window12"):
        words = f"{ABLATIONS[name].capitalize()} the hem answers less to the motion (A)"
        found.append(Claim(words, "dynamics/amplitude", name, SNUG, better=False))
    smooth, noise = "The supervised network is smoother than", "First states of noise, not zeros, give less"
    return (
        *found,
        Claim(f"{smooth} SNUG: mean curvature", "curvature/mean", "supervised", SNUG, better=False),
        Claim(
            f"{smooth} the simulation: mean curvature",
            "curvature/mean",
            "supervised",
            "simulation",
            better=False,
        ),
        Claim("SNUG has less curvature error than supervised", "curvature/error", SNUG, "supervised"),
        Claim(f"{noise} total energy", "energy/total", NOISY, QUIET),
        Claim(f"{noise} curvature error", "curvature/error", NOISY, QUIET),
        Claim(f"{noise} drift in a thousand frames", "roll_out/drift", NOISY, QUIET, ROLL_OUTS),
        Claim(f"{noise} energy at their end", "roll_out/last", NOISY, QUIET, ROLL_OUTS),
    )


def findings(rows: Sequence[Row]) -> Table | None:
    """One line for each claim; None where the run has no SNUG network at all."""
    garments, roll_outs = (Measurements(suite_rows(rows, suite)) for suite in ("garments", ROLL_OUTS))
    measured = {
        "garments": garments.only(dressed_scenes(garments)),
        ROLL_OUTS: roll_outs.only(LONG),
    }
    if SNUG not in measured["garments"].methods:
        return None
    lines = [_line(claim, measured[claim.suite]) for claim in claims()]
    lines.append(_steady(measured[ROLL_OUTS]))
    columns = (
        Column("finding", "Finding"),
        Column("first", "The first"),
        Column("second", "The second"),
        Column("unit", "Unit"),
        Column("apart", "Apart", "%"),
        Column("scatter", "Scatter", "%"),
        Column("status", "Here"),
    )
    return Table("findings", columns, tuple(lines))


def _line(claim: Claim, measured: Measurements) -> tuple[Cell, ...]:
    lower, higher = measured.pair(claim.lower, claim.higher, claim.metric)
    unit = measured.units.get(claim.metric)
    status = verdict(lower, higher)
    if claim.better and lower is not None and higher is None and measured.diverged(claim.higher):
        status = f"{REPRODUCED}: the second diverged"
    if claim.better and lower is None and higher is not None and measured.diverged(claim.lower):
        status = f"{NOT_REPRODUCED}: the first diverged"
    return claim.words, lower, higher, unit, *percents(lower, higher), status


def _steady(measured: Measurements) -> tuple[Cell, ...]:
    first, last = (measured.mean(SNUG, f"roll_out/{end}") for end in ("first", "last"))
    unit = measured.units.get("roll_out/last")
    result = None
    if first is not None and last is not None:
        result = REPRODUCED if last.value <= (1.0 + STEADY) * first.value else NOT_REPRODUCED
    words = f"A thousand frames end at most {100.0 * STEADY:g} % above where they began"
    return words, last, first, unit, percents(last, first)[0], None, result


def percents(lower: Mean | None, higher: Mean | None) -> tuple[float | None, float | None]:
    """Their difference and the scatter of their seeds, in percent of the second."""
    shares = None if lower is None or higher is None else apart(lower, higher)
    return (None, None) if shares is None else (100.0 * shares[0], 100.0 * shares[1])


def verdict(lower: Mean | None, higher: Mean | None) -> str | None:
    """In words, whichever way it comes out; None where one of the two was not run."""
    if lower is None or higher is None:
        return None
    sign = difference(lower, higher)
    if sign == 0:
        return f"{SCATTERED}{lower.fewer}"
    if sign > 0:
        return f"{NOT_REPRODUCED}: the other way round{lower.fewer}"
    return f"{REPRODUCED}{lower.fewer}"


def recipes(rows: Sequence[Row]) -> Table | None:
    """What each deviation from the paper's text does: python -m benchmarks.recipe_effects."""
    measured = Measurements(suite_rows(rows, RECIPES))
    terms = ("total", "strain", "bending", "gravity", "inertia", "collision")
    columns = [(f"energy/{term}", Column(term, term.capitalize(), "J")) for term in terms]
    columns += [
        ("penetration/vertices", Column("below", "In skin", "%")),
        ("train/steps", Column("steps", "Steps")),
        ("cost/train", Column("training", "Training", "s")),
        ("cost/setup", Column("ready", "Ready", "s")),
    ]
    columns = [(metric, column) for metric, column in columns if metric in measured.metrics]
    order = dict.fromkeys(row.method for row in measured.rows)  # default first, as it was run
    # A training is no scene: each mean is over the scenes that can have its metric.
    scenes = {m: [r.scene for r in measured.rows if r.metric == m] for m, _ in columns}
    scenes = {metric: list(dict.fromkeys(found)) for metric, found in scenes.items()}
    lines = [(*_parted(name), *(measured.mean(name, m, scenes[m]) for m, _ in columns)) for name in order]
    if not lines:
        return None
    head = (Column("base", "Recipe"), Column("recipe", "Deviation"))
    return Table("recipes", (*head, *(column for _, column in columns)), tuple(lines))


def _parted(name: str) -> tuple[str, str]:
    """ "default without small output" as what it begins with and what is changed."""
    base, _, change = name.partition(" ")
    return base, change or "as it is"


def recipe_effects(rows: Sequence[Row]) -> str:
    """Which deviations from the paper's text matter most, by the total energy of roll-outs."""
    measured = Measurements(row for row in suite_rows(rows, RECIPES) if row.metric == "energy/total")
    totals = {m: v for m in measured.methods if (v := measured.value(m, "energy/total")) is not None}
    sentences = []
    for base, words, sign in (("default", "most is lost", -1.0), ("paper", "most is gained", 1.0)):
        others = {m: v for m, v in totals.items() if m.startswith(f"{base} ")}
        if base in totals and others:
            order = sorted(others, key=lambda name: sign * others[name])[:MOST]
            listed = ", ".join(f"{_parted(name)[1]} ({number(others[name])} J)" for name in order)
            sentences.append(f"Recipe {base} has {number(totals[base])} J per frame; {words} {listed}.")
    return " ".join(sentences)
