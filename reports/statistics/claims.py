"""What the paper claims of its method, as data, and whether each claim holds in a run.

Santesteban, Otaduy, Casas: SNUG, CVPR 2022. Nothing else in a report is judged.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import pandas as pd

from benchmarks.results.row import BEFORE_FRAMES
from reports.run.rows import Metric, Run
from reports.statistics.by_frame import half_of, share_of_frames, with_shares
from reports.statistics.means import Mean, pair
from reports.statistics.significance import LESS, MORE, OPEN, TIED, Effect, effect, effect_on, holm, standing
from reports.tables.table import Cell, Column, Table, table

HOLDS, FAILS = "holds", "does not hold"  # or TIED, or OPEN
# The sum of BEFORE_FRAMES.
BEFORE = Metric("cost/before", "s", "Data, setup and training", lower_is_better=True, of="machine")


@dataclass(frozen=True)
class Claim:
    """`lower` has less of the metric than `higher`: less than its `factor`-th part, or `on_par` no more.

    of_frames: the energy that is compared in each frame; the metric is then made of that.
    """

    says: str
    metric: str
    lower: str
    higher: str
    factor: float = 1.0
    on_par: bool = False
    of_frames: str = ""

    @property
    def relation(self) -> str:
        if self.on_par:
            return "≤"
        if self.of_frames:
            return "< in most frames"
        return "<" if self.factor == 1.0 else f"< 1/{self.factor:g} of"


ENERGIES = "Table 1: lower energies than PBNS"
FRAMES = "Figure 4: consistently lower energies than PBNS; judged: in more frames than not"
SAME = "Section 4.3: wrinkles of PBNS with its own material stay the same while the pose changes"
TERMS = "Table 2: each term of the loss brings the curvature nearer to the simulation's"
COSTS = "Table 3: smaller, faster and sooner trained than supervised methods"
SPEED_UP = "Abstract: training two orders of magnitude faster than supervised methods, their data included"
SIMULATOR = "Section 4.3: the simulation is several orders of magnitude slower; at least two"
SMOOTH = "Figure 5: vertex-wise supervision smooths, SNUG learns more realistic detail"
UNSEEN = "Section 1: generalises better than supervision to unseen motion"
SPRINGS = "Figure 3: springs deform less expressively than StVK; here, networks trained on either"
SIMULATED_SPRINGS = "Figure 3: the same as the paper draws it, simulated with either"
DYNAMICS = "Sections 3.3, 3.5: without the inertia term, or with longer windows, there is less true dynamics"
PAR = "Section 5: dynamics on par with other data-driven methods"
STATES = "Section 3.5: first states of noise, not of zeros, let long sequences go well"
SUPERVISED = ("santesteban2019", "tailornet")
CLAIMS = (
    *(Claim(ENERGIES, f"energy/{t}", "snug", "pbns") for t in ("strain", "bending", "gravity", "inertia")),
    *(
        Claim(FRAMES, share_of_frames(t).name, "snug", "pbns", of_frames=t)
        for t in ("strain", "bending", "inertia")
    ),
    *(
        Claim(TERMS, "curvature/error", "snug", f"snug-no-{term}")
        for term in ("bending", "strain", "gravity", "inertia")
    ),
    *(
        Claim(COSTS, f"cost/{what}", "snug", method)
        for what in ("train", "frame", "memory")
        for method in SUPERVISED
    ),
    *(Claim(SPEED_UP, BEFORE.name, "snug", method, factor=100.0) for method in (*SUPERVISED, "supervised")),
    Claim(SIMULATOR, "cost/frame", "snug", "simulation", factor=100.0),
    Claim(SMOOTH, "curvature/mean", "supervised", "simulation"),
    Claim(SMOOTH, "curvature/mean", "supervised", "snug"),
    Claim(SMOOTH, "curvature/error", "snug", "supervised"),
    Claim(UNSEEN, "energy/total", "snug", "supervised"),
    Claim(SPRINGS, "curvature/mean", "snug-springs", "snug"),
    *(
        Claim(SIMULATED_SPRINGS, "curvature/mean", f"simulation-{material}", "simulation")
        for material in ("springs", "pbns-springs")
    ),
    *(Claim(SAME, "curvature/change", "pbns-springs", method) for method in ("snug", "simulation")),
    *(
        Claim(DYNAMICS, "dynamics/amplitude", f"snug-{name}", "snug")
        for name in ("no-inertia", "window6", "window12")
    ),
    Claim(PAR, "dynamics/amplitude", "santesteban2019", "snug", on_par=True),
    *(
        Claim(STATES, metric, "snug-noise-alone", "snug-no-noise")
        for metric in ("energy/total", "roll_out/drift", "roll_out/last")
    ),
)
NOTE = (
    "Effect: × the first over the second, of geometric means over motions and seeds; the first less the "
    "second where a value is not positive or zero is a choice, as of gravity; of frames, the first's share "
    "less half. Below it the 95 % interval over motions and seeds, of the line by itself. p: corrected by "
    "Holm for all lines; a claim holds, or does not hold, where p is below .05. Tie: p is not, and all of "
    "the interval is within 5 % of equality; or the difference is within the uncertainty of the reference. "
    "Cannot be told: neither, or a network was trained with one seed. Where nothing was repeated, 5 % decide."
)


@dataclass(frozen=True)
class Judged:
    """A claim, the two means, None where all of one diverged, what came out, and a remark on that."""

    claim: Claim
    metric: Metric
    one: Mean | None
    other: Mean | None
    effect: Effect | None
    p: float | None
    verdict: str
    remark: str = ""


def findings(run: Run) -> list[Table]:
    """The claims that this run can judge, over the scenes of the first garment that both methods share."""
    columns = (
        Column("claim", "Claim", text=True),
        Column("metric", "Measure", text=True),
        Column("lower", "First", text=True, method=True),
        Column("claimed", "Claim", text=True),
        Column("higher", "Second", text=True, method=True),
        Column("first", "Of the first", mixed=True),
        Column("second", "Of the second", mixed=True),
        Column("difference", "Difference", mixed=True),
        Column("effect", "Effect", mixed=True),
        Column("p", "p", digits=2, mixed=True),
        Column("verdict", "Here", text=True),
    )
    rows: list[tuple[Cell, ...]] = [
        (
            found.claim.says, found.metric.heading, found.claim.lower, found.claim.relation,
            found.claim.higher, found.one, found.other,
            None if found.one is None or found.other is None else found.one.value - found.other.value,
            found.effect, found.p, found.verdict + found.remark,
        )
        for found in judged(run)
    ]  # fmt: skip
    caption = "Claims of the paper, and whether they hold here."
    return table("findings", columns, rows, caption, grouped_by=("claim",), note=NOTE)


def counts(run: Run) -> Counter[str]:
    """How many claims came out how."""
    return Counter(line.verdict for line in judged(run))


def in_words(found: Counter[str]) -> str:
    """As "holds 3, tie 1"."""
    return ", ".join(f"{word} {found[word]}" for word in (HOLDS, FAILS, TIED, OPEN) if found[word])


def judged(run: Run) -> list[Judged]:
    """Of all claims whose two methods ran, as one family."""
    first = next(iter(run.garments(run.worn)), None)
    frame = with_before(run.worn[run.worn["garment"] == first])
    ran = set(frame["method"])
    made = [BEFORE, *(share_of_frames(claim.of_frames) for claim in CLAIMS if claim.of_frames)]
    metrics = {**run.metrics, **{metric.name: metric for metric in made}}
    asked = []
    for claim in CLAIMS:
        if {claim.lower, claim.higher} <= ran:
            own = frame
            if claim.of_frames:
                own = with_shares(frame, run.frames, claim.of_frames, claim.lower, claim.higher)
            own = own[(own["metric"] == claim.metric) | ~own["usable"]]
            metric = metrics.get(claim.metric, Metric(claim.metric))
            asked.append((claim, metric, *pair(own, claim.lower, claim.higher, claim.metric)))
    effects = [_effect(run, frame, *line) for line in asked]
    p_values = [found.p_value(line[0].factor) if found else None for line, found in zip(asked, effects)]
    corrected = iter(holm([p for p in p_values if p is not None]))
    diverged = set(frame[frame["status"] == "diverged"]["method"])
    lines = []
    for (claim, metric, one, other), found, alone in zip(asked, effects, p_values):
        p = None if alone is None else next(corrected)
        if found is not None and one is not None and other is not None:
            said = verdict(claim, one, other, found, p)
            remark = ": one seed" if said == OPEN and found.one_seed else ""
            remark += one.fewer or other.fewer
        else:
            said, remark = of_diverged(claim, metric, one, other, diverged)
        if said:
            lines.append(Judged(claim, metric, one, other, found, p, said, remark))
    return lines


def _effect(
    run: Run, rows: pd.DataFrame, claim: Claim, metric: Metric, one: Mean | None, other: Mean | None
) -> Effect | None:
    if one is None or other is None:
        return None
    if claim.of_frames:  # the other's share is what is left, and no second sample
        return effect(one, half_of(one), differences=True)
    return effect_on(metric, one, other, run, rows)


def verdict(claim: Claim, one: Mean, other: Mean, found: Effect, p: float | None) -> str:
    """In words, by the p-value after Holm's correction; None where nothing was repeated."""
    if claim.factor != 1.0 and not found.ratio:
        return OPEN  # no factor between numbers of which some are zero
    stands = standing(one, other, found, p, claim.factor)
    if claim.on_par and not found.one_seed and (stands == TIED or found.equal(claim.factor)):
        return HOLDS
    return {LESS: HOLDS, MORE: FAILS}.get(stands, stands)


def of_diverged(
    claim: Claim, metric: Metric, one: Mean | None, other: Mean | None, diverged: set[str]
) -> tuple[str, str]:
    """Verdict and remark: of an answer of which less is better, a method that diverged has more. Of what it
    cost nothing can be said: no time of a network that diverged is usable.
    """
    if metric.lower_is_better and metric.of == "answer":
        if one is not None and claim.higher in diverged:
            return HOLDS, ": the second diverged"
        if other is not None and claim.lower in diverged:
            return FAILS, ": the first diverged"
    return "", ""


def with_before(frame: pd.DataFrame) -> pd.DataFrame:
    """The rows, and what each trained network cost before its first frame, where all parts are known."""
    rows = frame[frame["usable"] & frame["metric"].isin(BEFORE_FRAMES)]
    cell = ["scene", "method", "seed"]
    parts = rows.groupby(cell)["value"]
    whole = rows.assign(value=parts.transform("sum"))[parts.transform("size") == len(BEFORE_FRAMES)]
    before = whole.drop_duplicates(cell).assign(metric=BEFORE.name, unit=BEFORE.unit)
    return pd.concat([frame, before], ignore_index=True)
