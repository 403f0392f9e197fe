"""The paper's claims get verdicts from Holm-corrected tests; ties and inconclusive results are reported."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from benchmarks.methods.catalogue.all_methods import METHODS
from reports.document.layout import lay_out_table
from reports.statistics.frame_shares import share_of_frames, with_shares
from reports.statistics.paper_claims import BEFORE, CLAIMS, counts, in_words, judged, with_before
from reports.tables import make_tables
from reports.tables.findings import findings
from reports.tables.paper_values import PRINTED
from tests.reports.report_folder import SCENES, row, run_of


def told(rows):
    """(metric, lower, higher) -> the judged claim."""
    found = judged(run_of(rows))
    return {(line.claim.metric, line.claim.lower, line.claim.higher): line for line in found}


STRAIN = ("energy/strain", "snug", "pbns")


def seeds(method, values, metric="energy/strain", scene="tshirt/kick", **more):
    return [row(scene, method, metric, value, seed=k, **more) for k, value in enumerate(values)]


def test_every_method_of_a_claim_is_one_that_can_be_run():
    known = {entry.name for entry in METHODS}
    assert {name for claim in CLAIMS for name in (claim.lower, claim.higher)} <= known
    assert len({(claim.metric, claim.lower, claim.higher) for claim in CLAIMS}) == len(CLAIMS)


@pytest.mark.parametrize(
    ("snug", "pbns", "verdict"),
    [
        ((0.5,), (1.0,), "cannot be told"),  # one seed of each
        ((0.97,), (1.0,), "cannot be told"),
        ((0.5, 0.51, 0.52), (1.0, 1.01, 1.0), "holds"),
        ((1.0, 1.01, 1.0), (0.5, 0.51, 0.52), "does not hold"),
        ((0.7, 0.8, 0.9), (1.0, 1.0, 1.0), "cannot be told"),  # 0.2 apart, 0.25 of scatter
        ((0.6, 0.7, 0.8), (1.0,), "cannot be told"),  # 0.3 apart, 0.50: it has seeds of its own
        ((1.0, 1.001, 1.002), (1.001, 1.002, 1.001), "tie"),  # and known to be one
    ],
)
def test_a_claim_holds_beyond_a_tie_and_beyond_motions_and_seeds(snug, pbns, verdict):
    found = told(seeds("snug", snug) + seeds("pbns", pbns))
    line = found[STRAIN]
    assert line.one.value == pytest.approx(sum(snug) / len(snug)) and line.verdict == verdict
    assert (line.one.spread is None) == (len(snug) == 1) and (line.other.spread is None) == (len(pbns) == 1)
    assert list(found) == [STRAIN]  # what was not run is not judged
    assert (line.remark == ": one seed") == (len(snug) == len(pbns) == 1)


@pytest.mark.parametrize(("springs", "verdict"), [(0.5, "holds"), (0.97, "tie"), (2.0, "does not hold")])
def test_where_nothing_is_repeated_and_no_seed_matters_5_percent_decide(springs, verdict):
    metric = {"metric": "curvature/mean", "unit": "1/m"}
    rows = [
        row(method="simulation", **metric),
        row(method="simulation-springs", value=springs, seeded=False, **metric),
    ]
    assert told(rows)["curvature/mean", "simulation-springs", "simulation"].verdict == verdict


def test_no_verdict_hangs_on_where_gravity_is_zero():
    asked = "energy/gravity", "snug", "pbns"

    def verdicts(zero: float, own: float):
        scatter = (-0.001, 0.0, 0.001)
        rows = seeds("snug", [zero + own + x for x in scatter], asked[0])
        rows += seeds("pbns", [zero + 1.0 + x for x in scatter[::-1]], asked[0])
        rows += [
            row("tshirt/kick", "simulation", asked[0], zero + 0.9),
            row("tshirt/kick", "skinning", asked[0], zero + 1.9),
        ]
        return told(rows)[asked]

    for own, verdict in ((0.8, "holds"), (1.2, "does not hold"), (1.0002, "tie")):
        near, far = verdicts(0.0, own), verdicts(100.0, own)
        assert near.verdict == far.verdict == verdict and not near.effect.ratio
        assert near.effect.value == pytest.approx(far.effect.value)


def test_the_lines_of_the_table_are_one_family():
    """A claim that is significant alone is inconclusive once corrected for three others that are not."""
    snug, pbns = np.array((0.80, 0.82, 0.84)), np.array((0.93, 0.95, 1.02))
    alone = told(seeds("snug", snug) + seeds("pbns", pbns))[STRAIN]
    assert 0.05 / 4 < alone.p < 0.05 and alone.verdict == "holds"
    rows = seeds("snug", snug) + seeds("pbns", pbns)
    for term in ("bending", "gravity", "inertia"):
        rows += seeds("snug", (1.0, 2.0, 3.0), f"energy/{term}") + seeds(
            "pbns", (1.1, 2.0, 2.9), f"energy/{term}"
        )
    line = told(rows)[STRAIN]
    assert line.p == pytest.approx(4 * alone.p) and line.verdict == "cannot be told"
    assert line.effect == alone.effect
    assert (
        counts(run_of(rows)) == {"cannot be told": 4} and in_words(counts(run_of(rows))) == "cannot be told 4"
    )


def costs(method, train, data=0.0, setup=1.0):
    """Three seeds that scatter by 1 %."""
    rows = []
    for name, value in (("data", data), ("setup", setup), ("train", train)):
        factors = (0.99, 1.0, 1.01) if value else (1.0, 1.0, 1.0)
        rows += seeds(method, [value * f for f in factors], f"cost/{name}", unit="s")
    return rows


@pytest.mark.parametrize(
    ("supervised", "verdict"),
    [(30_000.0, "holds"), (300.0, "does not hold"), (10_100.0, "tie"), (50.0, "does not hold")],
)
def test_two_orders_of_magnitude_are_judged_with_their_factor(supervised, verdict):
    """SNUG: 101 s with its setup; the other: `supervised` of training and data, and a second of setup."""
    rows = costs("snug", 100.0) + costs("supervised", 0.3 * supervised, data=0.7 * supervised)
    line = told(rows)[BEFORE.name, "snug", "supervised"]
    assert line.claim.factor == 100.0 and line.verdict == verdict
    assert line.one.value == pytest.approx(101.0) and line.other.value == pytest.approx(supervised + 1.0)
    assert line.effect.shown == pytest.approx(101.0 / (supervised + 1.0), rel=1e-3)
    # What its simulations took is not known any more: there is no sum.
    unknown = [r for r in rows if (r.method, r.metric) != ("supervised", "cost/data")]
    assert (BEFORE.name, "snug", "supervised") not in told(unknown)
    frame = run_of(unknown).frame
    assert set(with_before(frame)[len(frame) :]["method"]) == {"snug"}


@pytest.mark.parametrize(
    ("rival", "verdict"), [((0.7, 0.71, 0.72), "does not hold"), ((0.1, 0.1001, 0.1002), "holds")]
)
def test_a_tie_upholds_what_is_claimed_to_be_on_par(rival, verdict):
    own = (0.1, 0.1002, 0.1001)
    rows = [
        r for m, v in (("snug", own), ("santesteban2019", rival)) for r in seeds(m, v, "dynamics/amplitude")
    ]
    assert told(rows)["dynamics/amplitude", "santesteban2019", "snug"].verdict == verdict


def test_within_the_uncertainty_of_the_reference_is_a_tie():
    run = run_of(seeds("snug", (0.5, 0.51, 0.52)) + seeds("pbns", (1.0, 1.01, 1.0)))
    assert judged(run)[0].verdict == "holds"
    run.frame["uncertainty"] = 0.3
    assert judged(run)[0].verdict == "tie"


def test_means_are_compared_over_the_scenes_that_both_have():
    rows = [row(scene, "snug", value=value, seeded=False) for scene, value in zip(SCENES, (1.0, 9.0))]
    rows.append(row(SCENES[0], "pbns", value=2.0, seeded=False))
    line = told(rows)[STRAIN]
    assert (line.one.value, line.other.value) == (1.0, 2.0) and not line.one.complete
    assert (
        line.effect.shown == pytest.approx(0.5) and line.verdict + line.remark == "holds (1 of 2 roll-outs)"
    )
    rows[-1] = row("tshirt/other", "pbns", value=2.0)
    assert findings(run_of(rows)) == []


def test_a_lost_seed_is_said_and_the_others_are_compared():
    rows = seeds("snug", (0.5, 0.51)) + seeds("pbns", (1.0, 1.01, 1.0))
    rows.append(row("tshirt/kick", value=None, seed=2, status="diverged", reason="no end"))
    assert (told(rows)[STRAIN].verdict, told(rows)[STRAIN].remark) == ("holds", " (2 of 3 roll-outs)")
    rows = seeds("snug", (0.5, 0.51, 0.5)) + seeds("pbns", (1.0, 1.01))
    rows.append(row("tshirt/kick", "pbns", value=None, seed=2, status="diverged", reason="no end"))
    assert told(rows)[STRAIN].remark == " (2 of 3 roll-outs)"  # of the second, too


def test_without_a_network_there_is_no_table():
    assert findings(run_of([row(method="simulation")])) == []
    assert counts(run_of([row(method="simulation")])).total() == 0


def test_what_diverged_is_the_worse_one_and_not_a_dash():
    full = [row(metric="curvature/error", unit="1/m")]
    asked = ("curvature/error", "snug", "snug-no-strain")
    assert findings(run_of(full)) == []
    gone = {"metric": "cost/frame", "value": None, "status": "diverged", "reason": "nan"}
    line = told([*full, row(method="snug-no-strain", **gone)])[asked]
    assert (line.other, line.effect, line.p) == (None, None, None)
    assert (line.verdict, line.remark) == ("holds", ": the second diverged")
    broken = [row(method="pbns"), row(method="snug", **gone)]
    line = told(broken)[STRAIN]
    assert (line.verdict, line.remark) == ("does not hold", ": the first diverged")
    assert counts(run_of(broken)) == {"does not hold": 1}
    # What a network cost that diverged, nobody knows: it did not cost more for that.
    cost = {"metric": "cost/train", "unit": "s"}
    assert told([row(**cost), row(method="tailornet", **gone)]) == {}
    # Mean curvature is no error: having none is no verdict.
    smooth = [row(method="supervised", metric="curvature/mean", unit="1/m"), row(method="snug", **gone)]
    assert findings(run_of(smooth)) == []


def test_noise_is_judged_beside_zeros_and_not_as_an_ablation():
    found = {(claim.lower, claim.higher) for claim in CLAIMS if "noise" in claim.lower + claim.higher}
    assert found == {("snug-noise-alone", "snug-no-noise")}


def test_the_table_says_effect_and_interval_and_what_the_interval_leaves_out(tmp_path):
    rows = seeds("snug", (0.5, 0.51, 0.52)) + seeds("pbns", (1.0, 1.01, 1.0))
    run = run_of([*rows, *seeds("snug", (0.0,), "energy/bending"), *seeds("pbns", (1.0,), "energy/bending")])
    (made,) = findings(run)
    (block,) = lay_out_table(run, made)
    (group,) = block["groups"]
    assert group["title"] == "Table 1: lower energies than PBNS"
    strain, bending = (
        {c["title"]: cell for c, cell in zip(block["columns"], line)} for line in group["rows"]
    )
    assert [strain[name]["text"] for name in ("Measure", "First", "Claim", "Second")] == [
        "Strain [J]", "SNUG", "<", "PBNS",
    ]  # fmt: skip
    low, high = made.rows[0][8].interval
    assert strain["Effect"] == {"text": "×0.508", "spread": f"{low:.3f} to {high:.3f}", "mark": "‡"}
    assert bending["Effect"] == {"text": "−1.00", "spread": "", "mark": ""} and bending["p"]["text"] == "–"
    assert "‡ The interval is over seeds alone" in block["note"] and "Holm" in block["note"]
    lines = made.write_csv(tmp_path).read_text().splitlines()
    assert lines[0].endswith("effect,effect_kind,effect_low,effect_high,effect_covers,p,verdict")
    assert ",ratio,0.4" in lines[1] and ",seeds," in lines[1] and ",difference,-,-,-,-," in lines[2]


def test_the_papers_numbers_stand_below_its_own_columns():
    made = make_tables(run_of([row(), row(metric="curvature/error", unit="1/m")]))
    assert dict(made["energies"].references) == PRINTED["energies"]
    assert made["energies"].references[1][1]["energy/strain"] == "0.064"
    assert dict(made["curvature"].references) == PRINTED["curvature"]


def frame_table(**methods):
    """Lines of frame_energies.csv: method -> strain of the frames of seeds 0 and 1 of one scene."""
    lines = [
        ("tshirt/kick", method, seed, 0.1 * frame, strain)
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
    own = made[made["metric"] == share_of_frames("strain").name]
    found = {(line.method, line.seed): line.value for line in own.itertuples()}
    assert found == {("snug", 0): 25.0, ("snug", 1): 0.0, ("pbns", 0): 50.0, ("pbns", 1): 100.0}
    assert set(own["unit"]) == {"%"} and own["usable"].all() and len(made) == len(run.frame) + 4
    assert len(with_shares(run.frame, frames, "inertia", "snug", "pbns")) == len(run.frame)


@pytest.mark.parametrize(("snug", "verdict"), [(1.0, "holds"), (3.0, "does not hold")])
def test_a_claim_of_frames_is_judged_by_the_share_of_them(snug, verdict):
    rows = seeds("snug", (1.0, 1.1)) + seeds("pbns", (1.2, 1.15))
    run = run_of(rows)
    claim = share_of_frames("strain").name, "snug", "pbns"
    assert claim not in {(f.claim.metric, f.claim.lower, f.claim.higher) for f in judged(run)}
    ten = [snug] * 9 + [2.5]  # the second's share is what is left: one sample, not two
    frames = frame_table(snug=[ten, ten[::-1]], pbns=[[2.0] * 10] * 2)
    (line,) = (f for f in judged(replace(run, frame_energies=frames)) if f.claim.metric == claim[0])
    assert (line.claim.lower, line.claim.higher, line.verdict) == (*claim[1:], verdict)
    assert line.one.value == pytest.approx(10.0 if verdict == "holds" else 100.0)
    assert line.claim.relation == "< in most frames" and "%" in line.metric.heading
