"""Claims of the paper about its method, as data, and whether each claim holds in a run.

Santesteban, Otaduy, Casas: SNUG, CVPR 2022. Claims marked primary are one family, the same in every run:
their p-values are corrected by Holm for all of it. Those of exploratory claims are not corrected.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, replace

import pandas as pd

from benchmarks.metric import Metric
from benchmarks.results.protocol import LEAST_MOTIONS
from benchmarks.results.row import BEFORE_FRAMES
from reports.finished_run import Run
from reports.statistics.effects import DIFFERENCE, RATIO, Effect, effect
from reports.statistics.means_and_spreads import add_shares, pair, recording_of, share_of_frames
from reports.statistics.verdicts import (
    LESS,
    MORE,
    OPEN,
    TIED,
    Comparison,
    compare_methods,
    decide,
    explain,
    explain_untested,
    holm,
)

HALF = 50.0  # [%]
HOLDS, FAILS = "holds", "does not hold"  # or TIED, or OPEN
# The sum of BEFORE_FRAMES.
BEFORE = Metric(
    name="cost/before", unit="s", title="Data, setup and training", definition="their sum",
    lower_is_better=True, of="machine",
)  # fmt: skip


@dataclass(frozen=True)
class Claim:
    """A claim that `lower` has less of the metric than `higher`: below 1/factor of it, or `on_par` no more.

    Attributes:
        says: where in the paper, and what.
        metric: what is compared.
        lower: method that has less.
        higher: method that has more.
        factor: below 1/factor of it.
        on_par: the claim holds in a tie too.
        of_frames: the energy that is compared in each frame; the metric is then made of that.
        primary: whether it is of the family whose p-values are corrected.
    """

    says: str
    metric: str
    lower: str
    higher: str
    factor: float = 1.0
    on_par: bool = False
    of_frames: str = ""
    primary: bool = False

    @property
    def relation(self) -> str:
        """Sign between the two methods in the table of findings."""
        if self.on_par:
            return "≤"
        if self.of_frames:
            return "< in most frames"
        return "<" if self.factor == 1.0 else f"< 1/{self.factor:g} of"

    @property
    def tested(self) -> bool:
        """Whether a p-value judges it; costs have a range instead."""
        return not self.metric.startswith("cost/")


ENERGIES = "Table 1: lower energies than PBNS"
TEXT_ENERGIES = "Table 1, PBNS trained by SNUG's recipe too: lower energies than PBNS"
FRAMES = "Figure 4: consistently lower energies than PBNS; tested: in more frames than not"
SAME = "Section 4.3: wrinkles of PBNS with its own material stay the same while the pose changes"
TERMS = "Table 2: each term of the loss brings the curvature nearer to the simulation's"
REALISM = "Section 4.3: all terms contribute to the realism; tested by distance from the simulation"
COLLISION = "Section 3.4: the collision term is crucial; tested by the area inside the body"
COSTS = "Table 3: smaller, faster and sooner trained than supervised methods"
SPEED_UP = (
    "Abstract: training two orders of magnitude faster than supervised methods, their data included"
)
SIMULATOR = "Section 4.3: the simulation is several orders of magnitude slower; at least two"
POST_PROCESSED = f"{SIMULATOR}; with collision post-processing, as the authors' network is released"
SMOOTH = "Figure 5: vertex-wise supervision smooths wrinkles"
ENERGY_LOSS = "; here with strain and collision in its loss"
WRINKLES = "Abstract: fine wrinkles; tested: no less curved than the simulation"
UNSEEN = "Section 1: generalises better than supervision to unseen motion"
DETAIL = f"Figure 5: SNUG learns more realistic detail than vertex-wise supervision{ENERGY_LOSS}"
UNSEEN_DISTANCE = f"{UNSEEN}; tested by distance from the simulation"
STRICTER = "; tested more strictly: "  # before a condition that the paper's words do not ask for
CLOSE = (
    f"Figure 7: close to offline simulation on unseen motion{STRICTER}no more energy than simulated cloth"
)
OTHERS = (
    "Figure 7: at least on par with other data-driven methods; here with more steps, and on augmented "
    "motions"
)
SPRINGS = "Figure 3: springs deform less expressively than StVK; here, networks trained on either"
MATERIAL = "Figure 3, with all of PBNS's material, springs and unscaled hinges"
SIMULATED = {
    "springs": f"{SPRINGS.partition(';')[0]}; here, simulated",
    "pbns-springs-at-rest": f"{MATERIAL}; simulated",
}
LONGER = "Section 3.5: longer windows in training also minimise the inertia"
DYNAMICS = (
    "Sections 3.3, 3.5: without the inertia term, or with longer windows, there is less true dynamics; "
    "tested by the hem's motion, how alike it is to the simulation's and how large"
)
PAR = "Section 5: dynamics on par with other data-driven methods"
STATES = "Section 3.5: first states of noise, not of zeros, let long sequences go well"
INSIDE = "Section 5: noticeable collisions in test motions"
SOLVED = "Section 5: post-processing solves collisions; tested: no more area inside than the simulation's"
TABLE_1 = ("strain", "bending", "gravity", "inertia")
HEM = ("correlation", "amplitude")  # the latter never alone: an untrained network has as much
SUPERVISED = ("santesteban2019", "tailornet")
PRIMARY = (
    *(Claim(ENERGIES, f"energy/{term}", "snug", "pbns", primary=True) for term in TABLE_1),
    Claim(UNSEEN, "energy/total", "snug", "supervised", primary=True),
    Claim(CLOSE, "energy/total", "snug", "simulation", on_par=True, primary=True),
    Claim(SMOOTH + ENERGY_LOSS, "curvature/mean", "supervised", "simulation", primary=True),
    Claim(DETAIL, "curvature/histogram", "snug", "supervised", primary=True),
    Claim(SIMULATOR, "cost/frame", "snug", "simulation", factor=100.0, primary=True),
)
EXPLORATORY = (
    *(Claim(TEXT_ENERGIES, f"energy/{term}", "snug-paper", "pbns-paper") for term in TABLE_1),
    *(
        Claim(FRAMES, share_of_frames(t).name, "snug", "pbns", of_frames=t)
        for t in ("strain", "bending", "inertia")
    ),
    *(Claim(TERMS, "curvature/histogram", "snug", f"snug-no-{term}") for term in TABLE_1),
    *(Claim(REALISM, "distance/rms", "snug", f"snug-no-{term}") for term in (*TABLE_1, "collision")),
    Claim(COLLISION, "penetration/surface", "snug", "snug-no-collision"),
    *(
        Claim(COSTS, f"cost/{cost}", "snug", method)
        for cost in ("train", "frame", "memory")
        for method in SUPERVISED
    ),
    *(Claim(SPEED_UP, BEFORE.name, "snug", method, factor=100.0) for method in SUPERVISED),
    Claim(UNSEEN_DISTANCE, "distance/rms", "snug", "supervised"),
    Claim(SMOOTH + ENERGY_LOSS, "curvature/mean", "supervised", "snug"),
    Claim(SMOOTH, "curvature/mean", "supervised-vertices", "simulation"),
    Claim(WRINKLES, "curvature/mean", "simulation", "snug", on_par=True),
    *(
        Claim(OTHERS, metric, "snug", method, on_par=True)
        for metric in ("energy/total", "curvature/histogram")
        for method in SUPERVISED
    ),
    Claim(SPRINGS, "curvature/mean", "snug-springs", "snug"),
    Claim(f"{MATERIAL}, its loss weights and contact", "curvature/mean", "pbns-springs", "pbns"),
    *(
        Claim(says, "curvature/mean", f"simulation-{material}", "simulation")
        for material, says in SIMULATED.items()
    ),
    *(Claim(SAME, "curvature/change", "pbns-springs", method) for method in ("snug", "simulation")),
    *(Claim(LONGER, "energy/inertia", f"snug-window{length}", "snug", on_par=True) for length in (6, 12)),
    *(
        Claim(DYNAMICS, f"dynamics/{trait}", f"snug-{name}", "snug")
        for name in ("no-inertia", "window6", "window12")
        for trait in HEM
    ),
    *(Claim(PAR, f"dynamics/{trait}", "santesteban2019", "snug", on_par=True) for trait in HEM),
    *(
        Claim(STATES, metric, "snug-noise-alone", "snug-no-noise")
        for metric in ("energy/total", "roll_out/drift", "roll_out/last")
    ),
    Claim(INSIDE, "penetration/surface", "simulation", "snug"),
    Claim(SOLVED, "penetration/surface", "snug+cleanup", "simulation", on_par=True),
    Claim(POST_PROCESSED, "cost/frame", "snug+cleanup", "simulation", factor=100.0),
)
CLAIMS = (*PRIMARY, *EXPLORATORY)


@dataclass(frozen=True)
class Judged:
    """A claim as it came out.

    Attributes:
        claim: the claim.
        compared: the two means (None where no roll-out of one finished) and their effect.
        p: corrected for the primary family, as it is of an exploratory claim; None for costs.
        verdict: HOLDS, FAILS, TIED or OPEN.
        remark: on what is missing.
    """

    claim: Claim
    compared: Comparison
    p: float | None
    verdict: str
    remark: str = ""


def count(lines: Iterable[Judged]) -> Counter[str]:
    """Count the claims of the primary family, of these, by verdict."""
    return Counter(line.verdict for line in lines if line.claim.primary)


def phrase(verdicts: Counter[str]) -> str:
    """Return the counts as "3 hold, 1 is a tie"."""
    forms = {
        HOLDS: (HOLDS, "hold"), FAILS: (FAILS, "do not hold"),
        TIED: ("is a tie", "are ties"), OPEN: (f"is {OPEN}", f"are {OPEN}"),
    }  # fmt: skip
    return ", ".join(f"{n} {forms[word][n != 1]}" for word in forms if (n := verdicts[word]))


def judge_claims(run: Run) -> list[Judged]:
    """Judge all claims whose two methods ran, primary ones first."""
    frame = add_cost(run.select_garment(run.first_garment))
    methods = set(frame["method"])
    claims = [claim for claim in CLAIMS if {claim.lower, claim.higher} <= methods]
    compared = [_compare(run, frame, claim) for claim in claims]
    p_values = [line.effect.p_value() if line.effect else None for line in compared]
    tested = [claim for claim in PRIMARY if claim.tested]
    tests = {k: p for k, p in enumerate(p_values) if claims[k] in tested and p is not None}
    for k, corrected in zip(tests, holm([*tests.values()], family=len(tested))):
        p_values[k] = corrected
    lines = []
    for claim, comparison, p in zip(claims, compared, p_values):
        one, other, size = comparison.one, comparison.other, comparison.effect
        if one and other and size:
            outcome = decide_claim(claim, size, p)
            remark = explain(size) if outcome == OPEN else ""
            remark += one.fewer or other.fewer
        else:
            outcome, remark = verdict_of_failed(claim, comparison, frame)
        if outcome:
            lines.append(Judged(claim, comparison, p, outcome, remark))
    return lines


def _compare(run: Run, frame: pd.DataFrame, claim: Claim) -> Comparison:
    """Compare the two methods of a claim in its metric."""
    if claim.of_frames:  # the other's share is what is left, and no second sample
        metric = share_of_frames(claim.of_frames)
        rows = add_shares(frame, run.frame_energies, claim.of_frames, claim.lower, claim.higher)
        one, other = pair(rows, claim.lower, claim.higher, metric.name)
        if one is None or other is None:
            return Comparison(metric, one, other, None)
        cells = dict.fromkeys(one.cells, HALF)
        half = replace(one, value=HALF, cells=cells, seeded=False)
        surplus = effect(one, half, DIFFERENCE)
        # Shares lie between 0 and 100 %: of motions that agree Student's t makes more than the sign test
        # can.
        surplus = replace(surplus, possible=(-HALF, HALF), least_p=min(1.0, 2.0 * 0.5**surplus.motions))
        if surplus.error is None and surplus.motions > 1:  # all or none of the frames in every motion
            surplus = replace(surplus, error=0.0, covers="motions")
        return Comparison(metric, one, other, surplus)
    unknown = Metric(name=claim.metric, unit="1", title=claim.metric, definition="")
    metric = BEFORE if claim.metric == BEFORE.name else run.metrics.get(claim.metric, unknown)
    return compare_methods(run, frame, metric, claim.lower, claim.higher)


def decide_claim(claim: Claim, effect: Effect, p: float | None) -> str:
    """Return how the claim came out, by the p-value as the claim's family corrects it.

    A claim of parity holds where the upper end of the interval is within the margin of equality, also
    against simulations with smaller time steps.
    """
    if claim.factor != 1.0 and effect.scale != RATIO:
        return OPEN  # no factor between numbers of which some are zero
    if claim.on_par and not explain_untested(effect) and effect.ends is not None:
        worst = effect.ends[1] + max((0.0, *effect.against.values()))
        if worst <= effect.margin:
            return HOLDS
    outcome = decide(effect, p, claim.factor)
    return {LESS: HOLDS, MORE: FAILS}.get(outcome, outcome)


def verdict_of_failed(claim: Claim, compared: Comparison, frame: pd.DataFrame) -> tuple[str, str]:
    """Return verdict and remark where no roll-out of one method finished; both empty elsewhere.

    One whose roll-outs all diverged has more of an answer of which less is better, with as many motions
    and seeds as a test asks for. Its cost has no verdict: no time of it is usable.
    """
    finished, name, side = compared.one, claim.higher, "second"
    if finished is None:
        finished, name, side = compared.other, claim.lower, "first"
    failed = frame[(frame["method"] == name) & (frame["status"] != "skipped")]
    if finished and compared.metric.arbitrary_zero and (failed["metric"] == compared.metric.name).any():
        return OPEN, f": the {side} fell off"
    answer = compared.metric.lower_is_better and compared.metric.of == "answer"
    if not answer or finished is None or failed.empty or failed["usable"].any():
        return "", ""
    motions = {recording_of(scene) for scene, _ in finished.cells}
    motions &= set(map(recording_of, failed["scene"]))
    if set(failed["status"]) != {"diverged"}:
        return OPEN, f": no roll-out of the {side} finished"
    if len(motions) < LEAST_MOTIONS:
        return OPEN, f": the {side} diverged in fewer than {LEAST_MOTIONS} motions"
    if failed["seeded"].any() and failed["seed"].nunique() == 1:
        return OPEN, f": the {side} diverged with one seed"
    return FAILS if side == "first" else HOLDS, f": the {side} diverged"


def add_cost(frame: pd.DataFrame) -> pd.DataFrame:
    """Return the rows and the cost of each trained network before its first frame, where it is known."""
    rows = frame[frame["usable"] & frame["metric"].isin(BEFORE_FRAMES)]
    cell = ["scene", "method", "seed"]
    parts = rows.groupby(cell)["value"]
    sums = rows.assign(value=parts.transform("sum"))[parts.transform("size") == len(BEFORE_FRAMES)]
    before = sums.drop_duplicates(cell).assign(metric=BEFORE.name, unit=BEFORE.unit)
    return pd.concat([frame, before], ignore_index=True)
