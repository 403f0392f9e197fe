"""The paper's claims get verdicts from Holm-corrected tests; ties and inconclusive results are reported."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from benchmarks.methods import METHODS
from reports.statistics.effects import EXCESS
from reports.statistics.means_and_spreads import share_of_frames, with_shares
from reports.statistics.paper_claims import BEFORE, CLAIMS, PRIMARY, counts, in_words, judged, with_before
from reports.tables.findings import findings
from tests.reports.report_folder import row, run_of


def told(rows):
    """(metric, lower, higher) -> the judged claim."""
    lines = judged(run_of(rows))
    return {(line.claim.metric, line.claim.lower, line.claim.higher): line for line in lines}


STRAIN = ("energy/strain", "snug", "pbns")


MOTIONS = tuple(f"tshirt/{name}" for name in ("kick", "walk", "jump", "bow"))  # the least that are judged


def seeds(method, values, metric="energy/strain", **more):
    """A row of each motion with each seed; the value is the seed's, whatever the motion."""
    return [
        row(scene, method, metric, value, seed=seed, **more)
        for scene in MOTIONS
        for seed, value in enumerate(values)
    ]


def test_every_method_of_a_claim_is_one_that_can_be_run():
    known = {entry.name for entry in METHODS}
    assert {name for claim in CLAIMS for name in (claim.lower, claim.higher)} <= known
    assert len({(claim.metric, claim.lower, claim.higher) for claim in CLAIMS}) == len(CLAIMS)


@pytest.mark.parametrize(
    ("snug", "pbns", "verdict"),
    [
        ((0.5,), (1.0,), "inconclusive"),  # one seed of each
        ((0.5, 0.51, 0.52), (1.0, 1.01, 1.0), "holds"),
        ((1.0, 1.01, 1.0), (0.5, 0.51, 0.52), "does not hold"),
        ((0.7, 0.8, 0.9), (1.0, 1.0, 1.0), "inconclusive"),  # 0.2 apart, 0.25 of scatter
        ((0.6, 0.7, 0.8), (1.0,), "inconclusive"),  # 0.3 apart, 0.50: it has seeds of its own
        ((1.0, 1.001, 1.002), (1.001, 1.002, 1.001), "tie"),  # and known to be one
    ],
)
def test_a_claim_holds_beyond_a_tie_and_beyond_motions_and_seeds(snug, pbns, verdict):
    lines = told(seeds("snug", snug) + seeds("pbns", pbns))
    line = lines[STRAIN]
    one, other = line.compared.one, line.compared.other
    assert one.value == pytest.approx(sum(snug) / len(snug)) and line.verdict == verdict
    assert (one.spread is None) == (len(snug) == 1) and (other.spread is None) == (len(pbns) == 1)
    assert list(lines) == [STRAIN]  # what was not run is not judged
    assert (line.remark == ": one seed") == (len(snug) == len(pbns) == 1)


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


def test_the_primary_family_is_the_same_whatever_a_run_has_and_others_are_not_corrected():
    """Each primary test is corrected for all of them, those that the run cannot make too."""
    snug, pbns = np.array((0.80, 0.82, 0.84)), np.array((0.93, 0.95, 1.02))
    tested = [claim for claim in PRIMARY if claim.tested]
    assert len(tested) == 8 and not any(claim.metric.startswith("cost/") for claim in tested)
    rows = seeds("snug", snug) + seeds("pbns", pbns)
    alone = told(rows)[STRAIN]
    bare = alone.compared.effect.p_value()
    assert 0.05 / 8 < bare < 0.05
    assert alone.p == pytest.approx(8 * bare) and alone.verdict == "inconclusive"
    for term in ("bending", "inertia"):
        rows += seeds("snug", (1.0, 2.0, 3.0), f"energy/{term}")
        rows += seeds("pbns", (1.1, 2.0, 2.9), f"energy/{term}")
    line = told(rows)[STRAIN]
    assert line.p == alone.p and line.compared.effect == alone.compared.effect
    assert counts(judged(run_of(rows))) == {"inconclusive": 3}
    assert in_words(counts(judged(run_of(rows)))) == "3 are inconclusive"
    names = {"snug": "snug-paper", "pbns": "pbns-paper"}
    explored = [replace(r, method=names[r.method], pairing_group=names[r.method]) for r in rows]
    line = told(explored)["energy/strain", "snug-paper", "pbns-paper"]
    assert not line.claim.primary and line.p == pytest.approx(bare) and line.verdict == "holds"
    assert counts(judged(run_of(explored))) == {}


def costs(method, train, data=0.0, setup=1.0):
    """Three seeds that scatter by 1 %."""
    rows = []
    for name, value in (("data", data), ("setup", setup), ("train", train)):
        factors = (0.99, 1.0, 1.01) if value else (1.0, 1.0, 1.0)
        rows += seeds(method, [value * f for f in factors], f"cost/{name}", unit="s")
    return rows


@pytest.mark.parametrize(
    ("supervised", "verdict"),
    [(30_000.0, "holds"), (300.0, "does not hold"), (10_100.0, "tie")],
)
def test_two_orders_of_magnitude_are_judged_with_their_factor(supervised, verdict):
    """SNUG: 101 s with its setup; the other: `supervised` of training and data, and a second of setup."""
    rows = costs("snug", 100.0) + costs("tailornet", 0.3 * supervised, data=0.7 * supervised)
    line = told(rows)[BEFORE.name, "snug", "tailornet"]
    assert line.claim.factor == 100.0 and line.verdict == verdict
    means = line.compared.one.value, line.compared.other.value
    assert means == pytest.approx((101.0, supervised + 1.0))
    assert line.compared.effect.shown == pytest.approx(101.0 / (supervised + 1.0), rel=1e-3)
    # What its simulations took is not known any more: there is no sum.
    unknown = [r for r in rows if (r.method, r.metric) != ("tailornet", "cost/data")]
    assert (BEFORE.name, "snug", "tailornet") not in told(unknown)
    frame = run_of(unknown).frame
    assert set(with_before(frame)[len(frame) :]["method"]) == {"snug"}


@pytest.mark.parametrize(
    ("rival", "verdict"),
    [
        ((0.7, 0.71, 0.72), "does not hold"),
        ((0.1, 0.1001, 0.1002), "holds"),
        ((0.097, 0.09, 0.094), "holds"),  # 0.85 to 1.03: no tie, and no more than 5 % above
        ((0.12, 0.08, 0.1), "inconclusive"),
    ],
)
def test_parity_holds_where_no_more_than_the_margin_is_possible(rival, verdict):
    amplitudes = (0.1, 0.1002, 0.1001)
    given = seeds("snug", amplitudes, "dynamics/amplitude")
    given += seeds("santesteban2019", rival, "dynamics/amplitude")
    assert told(given)["dynamics/amplitude", "santesteban2019", "snug"].verdict == verdict


# The one row of a network's cell without numbers.
GONE = {"metric": "cost/frame", "status": "diverged", "reason": "nan", "seeded": True}
NOTHING = (None, None)  # values of two seeds


def test_what_diverged_is_the_worse_one_and_not_a_dash():
    full = seeds("snug", (1.0, 1.1), "curvature/error", unit="1/m")
    asked = ("curvature/error", "snug", "snug-no-strain")
    assert findings(run_of(full)) == []
    line = told([*full, *seeds("snug-no-strain", NOTHING, **GONE)])[asked]
    assert (line.compared.other, line.compared.effect, line.p) == (None, None, None)
    assert (line.verdict, line.remark) == ("holds", ": the second diverged")
    broken = [*seeds("pbns", (1.0, 1.1)), *seeds("snug", NOTHING, **GONE)]
    line = told(broken)[STRAIN]
    assert (line.verdict, line.remark) == ("does not hold", ": the first diverged")
    assert counts(judged(run_of(broken))) == {"does not hold": 1}
    # What a network cost that diverged, nobody knows: it did not cost more for that.
    cost = seeds("snug", (1.0, 1.1), "cost/train", unit="s")
    assert told([*cost, *seeds("tailornet", NOTHING, **GONE)]) == {}
    # Mean curvature is no error: having none is no verdict.
    smooth = [*seeds("supervised", (1.0, 1.1), "curvature/mean"), *seeds("snug", NOTHING, **GONE)]
    assert findings(run_of(smooth)) == []


@pytest.mark.parametrize(
    ("motions", "of_seeds", "ends", "remark"),
    [
        (3, NOTHING, ("diverged", "diverged"), ": the second diverged in fewer than 4 motions"),
        (4, (None,), ("diverged",), ": the second diverged with one seed"),
        (4, NOTHING, ("diverged", "timeout"), ": no roll-out of the second finished"),
        (4, NOTHING, ("timeout", "timeout"), ": no roll-out of the second finished"),
    ],
)
def test_one_seed_few_motions_or_another_failure_do_not_make_a_method_worse(
    motions, of_seeds, ends, remark
):
    gone = [replace(r, status=ends[r.seed]) for r in seeds("pbns", of_seeds, **GONE)]
    rows = [r for r in [*seeds("snug", (1.0, 1.1)), *gone] if r.scene in MOTIONS[:motions]]
    line = told(rows)[STRAIN]
    assert (line.verdict, line.remark) == ("inconclusive", remark)
    # One that was left out has not failed, and a roll-out that came to its end shows that not every one
    # does.
    skipped = seeds("pbns", NOTHING, status="skipped", reason="not asked for")
    assert told([*seeds("snug", (1.0, 1.1)), *skipped]) == {}
    ended = row(MOTIONS[0], "pbns", "cost/frame", 1.0)
    assert told([*rows, ended]) == {}


def frame_table(**methods):
    """Lines of frame_energies.csv: method -> strain of the frames of seeds 0 and 1 of each motion."""
    lines = [
        (scene, method, seed, 0.1 * frame, strain)
        for scene in MOTIONS
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
    made = with_shares(run.frame, frames, "strain", "snug", "pbns")
    shares = made[made["metric"] == share_of_frames("strain").name]
    percentages = {(line.method, line.seed): line.value for line in shares.itertuples()}
    assert percentages == {("snug", 0): 25.0, ("snug", 1): 0.0, ("pbns", 0): 50.0, ("pbns", 1): 100.0}
    assert set(shares["unit"]) == {"%"} and shares["usable"].all() and len(shares) == 4 * len(MOTIONS)
    assert len(with_shares(run.frame, frames, "inertia", "snug", "pbns")) == len(run.frame)


@pytest.mark.parametrize(
    ("snug", "motions", "verdict"),
    [
        (1.0, 6, "holds"),
        (3.0, 6, "does not hold"),
        (1.0, 4, "inconclusive"),
    ],  # a sign test of 4: p of 0.125
)
def test_a_claim_of_frames_is_judged_by_the_share_of_them(monkeypatch, snug, motions, verdict):
    monkeypatch.setitem(globals(), "MOTIONS", (*MOTIONS, "tshirt/spin", "tshirt/run")[:motions])
    rows = seeds("snug", (1.0, 1.1)) + seeds("pbns", (1.2, 1.15))
    run = run_of(rows)
    claim = share_of_frames("strain").name, "snug", "pbns"
    assert claim not in {(f.claim.metric, f.claim.lower, f.claim.higher) for f in judged(run)}
    ten = [snug] * 9 + [4.0 - snug]  # the share of PBNS is what is left: one sample, not two
    frames = frame_table(snug=[ten, ten], pbns=[[2.0] * 10] * 2)
    for place, scene in enumerate(MOTIONS):  # motions of 10, 9, 8, ... frames
        frames = frames[(frames["scene"] != scene) | (frames["seconds"] > 0.1 * place - 0.05)]
    (line,) = (f for f in judged(replace(run, frame_energies=frames)) if f.claim.metric == claim[0])
    assert (line.claim.lower, line.claim.higher, line.verdict) == (*claim[1:], verdict)
    share = 100.0 / motions * sum(1.0 / (10 - place) for place in range(motions))
    assert line.compared.one.value == pytest.approx(share if snug == 1.0 else 100.0 - share)
    assert line.claim.relation == "< in most frames" and "%" in line.compared.metric.heading
