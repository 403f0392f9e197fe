"""The paper's claims get verdicts from Holm-corrected tests; ties and inconclusive results are reported."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from benchmarks.methods import METHODS
from benchmarks.metrics import list_metrics
from reports.statistics.effects import EXCESS
from reports.statistics.means_and_spreads import AT_REFERENCE, add_shares, share_of_frames
from reports.statistics.paper_claims import BEFORE, CLAIMS, PRIMARY, add_cost, count, judge_claims, phrase
from reports.tables.page_one import ANSWERS
from tests.reports.report_folder import row, run_of

STRAIN = ("energy/strain", "snug", "pbns")
AMPLITUDE = ("dynamics/amplitude", "santesteban2019", "snug")  # a claim of parity: a tie is enough
COST = (BEFORE.name, "snug", "tailornet")
MOTIONS = tuple(f"tshirt/{name}" for name in ("kick", "walk", "jump", "bow"))  # the least that are judged


def told(rows, **more):
    """(metric, lower, higher) -> the judged claim."""
    lines = judge_claims(replace(run_of(rows), **more))
    return {(line.claim.metric, line.claim.lower, line.claim.higher): line for line in lines}


def seeds(method, values, metric="energy/strain", motions=MOTIONS, **more):
    """A row of each motion with each seed; the value is the seed's, whatever the motion."""
    return [
        row(scene, method, metric, value, seed=seed, **more)
        for scene in motions
        for seed, value in enumerate(values)
    ]


def test_every_method_of_a_claim_is_one_that_can_be_run():
    names = {entry.name for entry in METHODS}
    assert {name for claim in CLAIMS for name in (claim.lower, claim.higher)} <= names
    assert len({(claim.metric, claim.lower, claim.higher) for claim in CLAIMS}) == len(CLAIMS)


def test_the_amplitude_of_a_hem_stands_behind_its_correlation_and_never_alone():
    metrics = ["dynamics/correlation", "dynamics/amplitude"]
    claims = [claim for claim in CLAIMS if claim.metric in metrics]
    assert [claim.metric for claim in claims] == metrics * (len(claims) // 2)
    assert [c.lower + c.higher for c in claims[::2]] == [c.lower + c.higher for c in claims[1::2]]
    for names in (list_metrics(), AT_REFERENCE, ANSWERS):
        assert [name for name in names if name in metrics] == metrics


EVEN = (0.1, 0.1002, 0.1001)


@pytest.mark.parametrize(
    ("claim", "lower", "higher", "verdict"),
    [
        (STRAIN, (0.5,), (1.0,), "inconclusive"),  # one seed of each
        (STRAIN, (0.5, 0.51, 0.52), (1.0, 1.01, 1.0), "holds"),
        (STRAIN, (1.0, 1.01, 1.0), (0.5, 0.51, 0.52), "does not hold"),
        (STRAIN, (0.7, 0.8, 0.9), (1.0, 1.0, 1.0), "inconclusive"),  # 0.2 apart, 0.25 of scatter
        (STRAIN, (0.6, 0.7, 0.8), (1.0,), "inconclusive"),  # 0.3 apart, 0.50: it has seeds of its own
        (STRAIN, (1.0, 1.001, 1.002), (1.001, 1.002, 1.001), "tie"),  # and known to be one
        (AMPLITUDE, (0.7, 0.71, 0.72), EVEN, "does not hold"),
        (AMPLITUDE, (0.1, 0.1001, 0.1002), EVEN, "holds"),
        (AMPLITUDE, (0.097, 0.09, 0.094), EVEN, "holds"),  # 0.85 to 1.03: no more than 5 % above
        (AMPLITUDE, (0.12, 0.08, 0.1), EVEN, "inconclusive"),
    ],
)
def test_a_claim_holds_beyond_a_tie_and_beyond_motions_and_seeds(claim, lower, higher, verdict):
    metric, one, other = claim
    lines = told(seeds(one, lower, metric) + seeds(other, higher, metric))
    assert list(lines) == [claim]  # what was not run is not judged
    assert lines[claim].verdict == verdict
    assert (lines[claim].remark == ": one seed") == (len(lower) == len(higher) == 1)


def test_no_verdict_hangs_on_where_gravity_is_zero():
    asked = "energy/gravity", "snug", "pbns"

    def verdicts(zero: float, energy: float):
        scatter = (-0.001, 0.0, 0.001)
        rows = seeds("snug", [zero + energy + x for x in scatter], asked[0])
        rows += seeds("pbns", [zero + 1.0 + x for x in scatter[::-1]], asked[0])
        for metric in (asked[0], "energy/total"):
            rows += seeds("simulation", (zero + 0.9,), metric) + seeds("skinning", (zero + 1.9,), metric)
        return told(rows)[asked]

    for energy, verdict in ((0.8, "holds"), (1.2, "does not hold"), (1.0002, "tie")):
        near, far = verdicts(0.0, energy), verdicts(100.0, energy)
        assert near.verdict == far.verdict == verdict and near.compared.effect.scale == EXCESS
        assert near.compared.effect.value == pytest.approx(far.compared.effect.value)
    fallen = verdicts(0.0, -2.0)
    assert (fallen.verdict, fallen.remark) == ("inconclusive", ": the first fell off")


def test_the_primary_family_is_the_same_whatever_a_run_has_and_others_are_not_corrected():
    """Each primary test is corrected for all of them, those that the run cannot make too."""
    tested = [claim for claim in PRIMARY if claim.tested]
    assert len(tested) == 8 and not any(claim.metric.startswith("cost/") for claim in tested)
    rows = seeds("snug", (0.80, 0.82, 0.84)) + seeds("pbns", (0.93, 0.95, 1.02))
    alone = told(rows)[STRAIN]
    bare = alone.compared.effect.p_value()
    assert 0.05 / 8 < bare < 0.05
    assert alone.p == pytest.approx(8 * bare) and alone.verdict == "inconclusive"
    for term in ("bending", "inertia"):
        rows += seeds("snug", (1.0, 2.0, 3.0), f"energy/{term}")
        rows += seeds("pbns", (1.1, 2.0, 2.9), f"energy/{term}")
    lines = told(rows)
    assert lines[STRAIN].p == alone.p and lines[STRAIN].compared.effect == alone.compared.effect
    assert count(lines.values()) == {"inconclusive": 3}
    assert phrase(count(lines.values())) == "3 are inconclusive"
    names = {"snug": "snug-paper", "pbns": "pbns-paper"}
    explored = told([replace(r, method=names[r.method], pairing_group=names[r.method]) for r in rows])
    line = explored["energy/strain", "snug-paper", "pbns-paper"]
    assert not line.claim.primary and line.p == pytest.approx(bare) and line.verdict == "holds"
    assert count(explored.values()) == {}


@pytest.mark.parametrize(
    ("supervised", "verdict"), [(30_000.0, "holds"), (300.0, "does not hold"), (10_100.0, "tie")]
)
def test_two_orders_of_magnitude_are_judged_with_their_factor(supervised, verdict):
    """SNUG: 101 s with its setup; the other: `supervised` of training and data, and a second of setup."""
    costs = {
        "snug": {"data": 0.0, "setup": 1.0, "train": 100.0},
        "tailornet": {"data": 0.7 * supervised, "setup": 1.0, "train": 0.3 * supervised},
    }
    rows = [
        times
        for method, parts in costs.items()
        for part, value in parts.items()
        for times in seeds(method, [0.99 * value, value, 1.01 * value], f"cost/{part}", unit="s")
    ]
    line = told(rows)[COST]
    assert line.claim.factor == 100.0 and line.verdict == verdict
    assert line.compared.effect.shown == pytest.approx(101.0 / (supervised + 1.0), rel=1e-3)
    # What its simulations took is not known any more: there is no sum.
    unknown = [r for r in rows if (r.method, r.metric) != ("tailornet", "cost/data")]
    frame = run_of(unknown).frame
    assert COST not in told(unknown) and set(add_cost(frame)[len(frame) :]["method"]) == {"snug"}


NOTHING = (None, None)  # values of two seeds
# The one row of a network's cell without numbers.
GONE = {"metric": "cost/frame", "status": "diverged", "reason": "nan", "seeded": True}


@pytest.mark.parametrize(
    ("broken", "motions", "ends", "verdict", "remark"),
    [
        ("pbns", 4, ("diverged", "diverged"), "holds", ": the second diverged"),
        ("snug", 4, ("diverged", "diverged"), "does not hold", ": the first diverged"),
        ("pbns", 3, ("diverged", "diverged"), "inconclusive",
         ": the second diverged in fewer than 4 motions"),
        ("pbns", 4, ("diverged",), "inconclusive", ": the second diverged with one seed"),
        ("pbns", 4, ("diverged", "timeout"), "inconclusive", ": no roll-out of the second finished"),
    ],
)  # fmt: skip
def test_what_diverged_with_every_seed_in_enough_motions_is_the_worse_one(
    broken, motions, ends, verdict, remark
):
    failed = seeds(broken, [None] * len(ends), motions=MOTIONS[:motions], **GONE)
    rows = [replace(r, status=ends[r.seed]) for r in failed]
    rows += seeds({"pbns": "snug", "snug": "pbns"}[broken], (1.0, 1.1), motions=MOTIONS[:motions])
    line = told(rows)[STRAIN]
    assert (line.verdict, line.remark) == (verdict, remark)
    assert (line.compared.effect, line.p) == (None, None) and count([line]) == {verdict: 1}
    # A roll-out that came to its end shows that not every one does not.
    assert told([*rows, row(MOTIONS[0], broken, "cost/frame", 1.0)]) == {}


@pytest.mark.parametrize(
    ("finished", "metric", "other"),
    [
        # What a network cost that diverged, nobody knows: it did not cost more for that.
        ("snug", "cost/train", seeds("tailornet", NOTHING, **GONE)),
        # Mean curvature is no error: having none is no verdict.
        ("supervised", "curvature/mean", seeds("snug", NOTHING, **GONE)),
        # One that was left out has not failed.
        ("snug", "energy/strain", seeds("pbns", NOTHING, status="skipped", reason="not asked for")),
    ],
)
def test_without_an_answer_that_could_be_worse_there_is_no_verdict(finished, metric, other):
    assert told([*seeds(finished, (1.0, 1.1), metric), *other]) == {}


def frame_table(motions=MOTIONS, **methods):
    """Lines of frame_energies.csv: method -> strain of the frames of seeds 0 and 1 of each motion."""
    lines = [
        (scene, method, seed, 0.1 * frame, strain)
        for scene in motions
        for method, of_seeds in methods.items()
        for seed, strains in enumerate(of_seeds)
        for frame, strain in enumerate(strains)
    ]
    return pd.DataFrame(lines, columns=["scene", "method", "seed", "seconds", "strain"])


def test_the_share_of_frames_with_more_energy_is_counted_scene_by_scene_and_seed_by_seed():
    rows = seeds("snug", (1.0, 1.0)) + seeds("pbns", (1.0, 1.0)) + seeds("supervised", (1.0, 1.0))
    run = run_of(rows)
    frames = frame_table(
        snug=[[1, 1, 9, 3], [1, 1, 1]], pbns=[[2, 2, 2, 3, 5], [2, 2, np.nan]], other=[[0.0]]
    )
    table = add_shares(run.frame, frames, "strain", "snug", "pbns")
    shares = table[table["metric"] == share_of_frames("strain").name]
    percentages = {(line.method, line.seed): line.value for line in shares.itertuples()}
    assert percentages == {("snug", 0): 25.0, ("snug", 1): 0.0, ("pbns", 0): 50.0, ("pbns", 1): 100.0}
    assert set(shares["unit"]) == {"%"} and shares["usable"].all() and len(shares) == 4 * len(MOTIONS)
    assert len(add_shares(run.frame, frames, "inertia", "snug", "pbns")) == len(run.frame)


@pytest.mark.parametrize(
    ("snug", "count", "verdict"),
    [(1.0, 6, "holds"), (3.0, 6, "does not hold"), (1.0, 4, "inconclusive")],
)  # a sign test of 4 motions: p of 0.125
def test_a_claim_of_frames_is_judged_by_the_share_of_them(snug, count, verdict):
    motions = (*MOTIONS, "tshirt/spin", "tshirt/run")[:count]
    rows = seeds("snug", (1.0, 1.1), motions=motions) + seeds("pbns", (1.2, 1.15), motions=motions)
    claim = (share_of_frames("strain").name, "snug", "pbns")
    assert claim not in told(rows)
    ten = [snug] * 9 + [4.0 - snug]  # the share of PBNS is what is left: one sample, not two
    frames = frame_table(motions, snug=[ten, ten], pbns=[[2.0] * 10] * 2)
    for place, scene in enumerate(motions):  # motions of 10, 9, 8, ... frames
        frames = frames[(frames["scene"] != scene) | (frames["seconds"] > 0.1 * place - 0.05)]
    line = told(rows, frame_energies=frames)[claim]
    share = 100.0 / count * sum(1.0 / (10 - place) for place in range(count))
    assert line.compared.one.value == pytest.approx(share if snug == 1.0 else 100.0 - share)
    assert line.verdict == verdict and line.claim.relation == "< in most frames"
