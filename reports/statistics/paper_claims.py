"""Claims of the paper about its method, as data, and whether each claim holds in a run.

Santesteban, Otaduy, Casas: SNUG, CVPR 2022. Nothing else in a report is judged.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import pandas as pd

from benchmarks.results.row import BEFORE_FRAMES
from reports.run.finished_run import Metric, Run
from reports.statistics.frame_shares import half_of, share_of_frames, with_shares
from reports.statistics.means_and_spreads import Mean, pair
from reports.statistics.significance import LESS, MORE, OPEN, TIED, Effect, effect, effect_on, holm, standing

HOLDS, FAILS = "holds", "does not hold"  # or TIED, or OPEN
# The sum of BEFORE_FRAMES.
BEFORE = Metric("cost/before", "s", "Data, setup and training", lower_is_better=True, of="machine")


@dataclass(frozen=True)
class Claim:
    """A claim that `lower` has less of the metric than `higher`: below 1/factor of it, or `on_par` no more.

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
        """Sign between the two methods in the table of findings."""
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


@dataclass(frozen=True)
class Judged:
    """A claim as it came out: two means (None where all of one diverged), effect, verdict and a remark."""

    claim: Claim
    metric: Metric
    one: Mean | None
    other: Mean | None
    effect: Effect | None
    p: float | None
    verdict: str
    remark: str = ""


def counts(run: Run) -> Counter[str]:
    """Count the claims by verdict."""
    return Counter(line.verdict for line in judged(run))


def in_words(verdicts: Counter[str]) -> str:
    """Return the counts as "holds 3, tie 1"."""
    return ", ".join(f"{word} {verdicts[word]}" for word in (HOLDS, FAILS, TIED, OPEN) if verdicts[word])


def judged(run: Run) -> list[Judged]:
    """Judge all claims whose two methods ran, as one family of tests."""
    rows = run.garment_rows
    frame = with_before(rows[rows["garment"] == run.first_garment])
    ran = set(frame["method"])
    declared = [BEFORE, *(share_of_frames(claim.of_frames) for claim in CLAIMS if claim.of_frames)]
    metrics = {**run.metrics, **{metric.name: metric for metric in declared}}
    asked = []
    for claim in CLAIMS:
        if {claim.lower, claim.higher} <= ran:
            rows = frame
            if claim.of_frames:
                rows = with_shares(frame, run.frame_energies, claim.of_frames, claim.lower, claim.higher)
            rows = rows[(rows["metric"] == claim.metric) | ~rows["usable"]]
            metric = metrics.get(claim.metric, Metric(claim.metric))
            asked.append((claim, metric, *pair(rows, claim.lower, claim.higher, claim.metric)))
    effects = [_effect(run, frame, *line) for line in asked]
    p_values = [far.p_value(line[0].factor) if far else None for line, far in zip(asked, effects)]
    corrected = iter(holm([p for p in p_values if p is not None]))
    diverged = set(frame[frame["status"] == "diverged"]["method"])
    lines = []
    for (claim, metric, one, other), far, alone in zip(asked, effects, p_values):
        p = None if alone is None else next(corrected)
        if far is not None and one is not None and other is not None:
            outcome = verdict(claim, one, other, far, p)
            remark = ": one seed" if outcome == OPEN and far.one_seed else ""
            remark += one.fewer or other.fewer
        else:
            outcome, remark = verdict_of_diverged(claim, metric, one, other, diverged)
        if outcome:
            lines.append(Judged(claim, metric, one, other, far, p, outcome, remark))
    return lines


def _effect(
    run: Run, rows: pd.DataFrame, claim: Claim, metric: Metric, one: Mean | None, other: Mean | None
) -> Effect | None:
    if one is None or other is None:
        return None
    if claim.of_frames:  # the other's share is what is left, and no second sample
        return effect(one, half_of(one), differences=True)
    return effect_on(metric, one, other, run, rows)


def verdict(claim: Claim, one: Mean, other: Mean, far: Effect, p: float | None) -> str:
    """Return how the claim came out, by the p-value after Holm's correction (None: nothing was repeated)."""
    if claim.factor != 1.0 and not far.ratio:
        return OPEN  # no factor between numbers of which some are zero
    stands = standing(one, other, far, p, claim.factor)
    if claim.on_par and not far.one_seed and (stands == TIED or far.equal(claim.factor)):
        return HOLDS
    return {LESS: HOLDS, MORE: FAILS}.get(stands, stands)


def verdict_of_diverged(
    claim: Claim, metric: Metric, one: Mean | None, other: Mean | None, diverged: set[str]
) -> tuple[str, str]:
    """Return verdict and remark where all roll-outs of a method diverged.

    It has more of an answer of which less is better. Its cost stays open: no time of it is usable.
    """
    if metric.lower_is_better and metric.of == "answer":
        if one is not None and claim.higher in diverged:
            return HOLDS, ": the second diverged"
        if other is not None and claim.lower in diverged:
            return FAILS, ": the first diverged"
    return "", ""


def with_before(frame: pd.DataFrame) -> pd.DataFrame:
    """Return the rows and the cost of each trained network before its first frame, where it is known."""
    rows = frame[frame["usable"] & frame["metric"].isin(BEFORE_FRAMES)]
    cell = ["scene", "method", "seed"]
    parts = rows.groupby(cell)["value"]
    whole = rows.assign(value=parts.transform("sum"))[parts.transform("size") == len(BEFORE_FRAMES)]
    before = whole.drop_duplicates(cell).assign(metric=BEFORE.name, unit=BEFORE.unit)
    return pd.concat([frame, before], ignore_index=True)
