"""The table of the paper's findings: numbers decide, ties and what was not run are said."""

from __future__ import annotations

import pytest

from benchmarks.results import Row
from reports.document import document
from reports.findings import CAPTIONS, claims, findings, recipe_effects, recipes
from reports.tables import make_tables
from snug.recipe import TRAININGS


def row(method, metric, value, *, seed=0, suite="garments", scene="dressed/kick", unit="J"):
    return Row(suite, scene, method, seed, metric, unit, value)


def told(rows):
    return {line[0]: line for line in findings(rows).rows}


def test_every_method_of_a_claim_is_one_that_can_be_run():
    known = {*TRAININGS, "simulation"}
    assert {name for claim in claims() for name in (claim.lower, claim.higher)} <= known


@pytest.mark.parametrize(
    ("snug", "pbns", "verdict"),
    [
        ((0.5,), (1.0,), "reproduced"),
        ((0.97,), (1.0,), "within the scatter of seeds"),
        ((1.0,), (0.5,), "not reproduced: the other way round"),
        ((0.5, 0.6, 0.7), (1.0, 1.0, 1.0), "reproduced"),  # 0.4 apart, 0.25 of scatter
        ((0.7, 0.8, 0.9), (1.0, 1.0, 1.0), "within the scatter of seeds"),  # 0.2 apart, 0.25 of scatter
        ((0.6, 0.7, 0.8), (1.0,), "within the scatter of seeds"),  # 0.3 apart, 0.50: it has seeds of its own
    ],
)
def test_a_term_is_reproduced_beyond_a_tie_and_beyond_the_scatter_of_seeds(snug, pbns, verdict):
    rows = [row("snug", "energy/strain", value, seed=k) for k, value in enumerate(snug)]
    rows += [row("pbns", "energy/strain", value, seed=k) for k, value in enumerate(pbns)]
    line = told(rows)["SNUG is below PBNS in strain"]
    assert line[1].value == pytest.approx(sum(snug) / len(snug)) and (line[3], line[-1]) == ("J", verdict)
    assert (line[1].spread is None) == (len(snug) == 1)
    assert told(rows)["SNUG is below PBNS in gravity"][1:] == (None,) * 6


def test_a_steady_roll_out_is_allowed_a_share():
    rows = [row("snug", "energy/total", 1.0)]
    ends = {"roll_out/first": 1.0, "roll_out/last": 1.06}
    rows += [row("snug", k, v, suite="roll-outs", scene="there_and_back") for k, v in ends.items()]
    rows.append(row("snug", "train/window", 1.0, suite="roll-outs", scene="training"))
    lines = told(rows)
    steady = lines["A thousand frames end at most 5 % above where they began"]
    assert steady[2].value == 1.0 and steady[2].complete
    assert steady[4:] == (pytest.approx(6.0), None, "not reproduced")


def test_means_are_compared_over_the_scenes_that_both_have():
    rows = [row("snug", "energy/strain", value, scene=f"dressed/{k}") for k, value in enumerate((1.0, 9.0))]
    rows.append(row("pbns", "energy/strain", 2.0, scene="dressed/0"))
    line = told(rows)["SNUG is below PBNS in strain"]
    assert (line[1].value, line[2].value) == (1.0, 2.0) and not line[1].complete
    assert line[4] == pytest.approx(-50.0) and line[-1] == "reproduced (1 scene only)"
    rows[-1] = row("pbns", "energy/strain", 2.0, scene="dressed/2")
    assert told(rows)["SNUG is below PBNS in strain"][1:3] == (None, None)


def test_without_a_network_there_is_no_table():
    assert findings([row("simulation", "energy/strain", 1.0)]) is None and recipes([]) is None


def test_recipes_keep_their_order_and_their_dashes():
    rows = [
        row(name, "energy/total", value, suite="recipes", scene="lunge", seed=seed)
        for name, value in (("default", 1.0), ("default without zero start", 2.0), ("paper", 9.0))
        for seed in (0, 1)
    ]
    rows.append(row("paper", "train/steps", 7.0, suite="recipes", scene="training", unit="1"))
    table = recipes(rows)
    named = [("default", "as it is"), ("default", "without zero start"), ("paper", "as it is")]
    assert [line[:2] for line in table.rows] == named
    assert [column.name for column in table.columns] == ["base", "recipe", "total", "steps"]  # what there is
    assert table.rows[2][2].value == 9.0 and table.rows[2][2].seeds == 2 and table.rows[0][3] is None
    assert table.rows[2][3].value == 7.0 and table.rows[2][2].complete


def test_what_matters_most_in_a_recipe_is_named_first():
    values = {"default": 1.0, "default without a": 1.5, "default without b": 3.0, "default without c": 0.9}
    values |= {"default without d": 2.0, "paper": 9.0, "paper with a": 12.0, "paper with b": 4.0}
    rows = [
        row(name, "energy/total", value, suite="recipes", scene="lunge") for name, value in values.items()
    ]
    assert recipe_effects(rows) == (
        "Recipe default has 1.00 J per frame; most is lost without b (3.00 J), without d (2.00 J), without a "
        "(1.50 J). Recipe paper has 9.00 J per frame; most is gained with b (4.00 J), with a (12.0 J)."
    )
    assert recipe_effects(rows[:1]) == recipe_effects([]) == ""


def test_what_diverged_is_the_worse_one_and_not_a_dash():
    rows = [row("snug", "energy/total", 1.0)]
    words = "Full SNUG has less total energy than without strain"
    assert told(rows)[words][-1] is None
    diverged = Row(
        "garments", "dressed/kick", "snug-no-strain", 0, "cost/frame", "ms", None, "diverged", "nan"
    )
    assert told([*rows, diverged])[words][2:] == (None, "J", None, None, "reproduced: the second diverged")
    pbns = [row("pbns", "energy/strain", 1.0)]
    broken = Row("garments", "dressed/kick", "snug", 0, "cost/frame", "ms", None, "diverged", "nan")
    assert told([*pbns, broken])["SNUG is below PBNS in strain"][-1] == "not reproduced: the first diverged"
    smooth = [row("supervised", "curvature/mean", 1.0), broken]
    line = "The supervised network is smoother than SNUG: mean curvature"
    assert told(smooth)[line][-1] is None
    lost = Row("garments", "dressed/kick", "supervised", 0, "cost/frame", "ms", None, "diverged", "nan")
    assert told([row("snug", "curvature/mean", 1.0), lost])[line][-1] is None


def test_noise_is_judged_beside_zeros_and_not_as_an_ablation():
    names = {
        (claim.lower, claim.higher) for claim in claims() if "snug-noise-alone" in (claim.lower, claim.higher)
    }
    assert names == {("snug-noise-alone", "snug-no-noise")}


def test_the_page_shows_what_was_judged_and_counts_the_rest():
    rows = [row(method, "energy/strain", value) for method, value in (("snug", 1.0), ("pbns", 2.0))]
    sections = document({}, rows, make_tables(rows), [], [])["sections"]
    block = next(b for s in sections for b in s["blocks"] if b["caption"] == CAPTIONS["findings"])
    assert len(block["groups"][0]["rows"]) == 1
    assert f"{len(claims())} more need methods" in block["note"]
