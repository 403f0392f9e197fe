"""Means, tables, numbers and the page of the report: as the rows say, dashes where there are none."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest

from benchmarks.runner.run_json import described
from benchmarks.validation.registry import CASES
from reports.finished_run import make_run
from reports.pdf import lay_out_table
from reports.sentences import endings
from reports.statistics.effects import RATIO
from reports.statistics.means_and_spreads import Mean, mean_of, pair
from reports.tables import make_tables, table
from reports.tables.pivots import ablation_effects, ablations
from tests.benchmarks.runner.test_cell_tasks import plan_of
from tests.reports.report_folder import SCENES, all_rows, row, run_of


def seeds_of(method, metric, values, **more):
    return [row(method=method, metric=metric, value=value, seed=k, **more) for k, value in enumerate(values)]


def column(table, name):
    return [column.name for column in table.columns].index(name)


def test_every_declared_case_has_its_place_in_the_tables(tmp_path):
    rows = [case.row(1.0, "ok") for case in CASES]
    run = make_run(described(plan_of(tmp_path, cases=CASES), rows), rows)
    tables = make_tables(run)
    tested = {case.name for case in CASES if case.suite == "extremes"}
    assert {line[0] for line in tables["extremes"].rows} == tested
    checked = [case for case in CASES if case.suite != "extremes"]
    assert len(tables["validation"].rows) == len(checked)


def test_mean_and_spread_over_seeds():
    rows = [row(scene, seed=s, value=v) for scene in SCENES for s, v in ((0, 1.0), (1, 3.0), (2, 8.0))]
    mean = mean_of(run_of(rows).frame, "snug", "energy/strain")
    assert mean == Mean(4.0, pytest.approx(np.std([1, 3, 8], ddof=1)), seeds=3, asked=6)
    assert dict(mean.cells) == {(scene, s): v for scene in SCENES for s, v in enumerate((1.0, 3.0, 8.0))}
    assert mean_of(run_of(rows[:1]).frame, "snug", "energy/strain", SCENES[:1]).spread is None
    equal = [row(seed=seed, value=2.679144) for seed in range(3)]  # whose mean is another number
    assert mean_of(run_of(equal).frame, "snug", "energy/strain", SCENES[:1]).spread == 0.0
    assert mean_of(run_of(rows).frame, "snug", "energy/bending") is None


def test_the_mean_is_over_scenes_first():
    """One seed has one scene of two: it weighs as much as the other."""
    rows = [row(SCENES[0], value=1.0), row(SCENES[1], value=3.0), row(SCENES[0], value=8.0, seed=1)]
    mean = mean_of(run_of(rows).frame, "snug", "energy/strain")
    assert mean.value == 5.0 and not mean.complete and mean.fewer == " (3 of 4 roll-outs)"


def test_a_failed_cell_enters_no_mean_and_the_table_says_so():
    rows = [
        row("tshirt/walk", value=1.0),
        row("tshirt/jump", value=100.0, status="failed", reason="x"),
        row("tshirt/walk", "simulation", value=4.0, status="stalled", reason="2 frames"),
        row("tshirt/jump", "simulation", value=6.0),
    ]
    run = run_of(rows)
    table = make_tables(run)["energies"]
    lines = {line[1]: line[2] for line in table.rows}
    assert lines["snug"].value == 1.0 and not lines["snug"].complete
    assert lines["simulation"].value == 5.0 and lines["simulation"].complete and lines["simulation"].stalled
    (block,) = lay_out_table(run, table)
    assert [line[1]["mark"] for line in block["groups"][0]["rows"]] == ["†", "*"]
    assert "fewer scenes" in block["note"] and "unconverged" in block["note"]


def test_a_seed_that_is_lost_is_said_wherever_the_mean_of_the_others_stands():
    rows = seeds_of("snug", "energy/total", (1.0, 1.1)) + seeds_of("pbns", "energy/total", (2.0, 2.1, 2.2))
    gone = row(metric="cost/frame", value=None, seed=2, status="diverged", reason="no end")
    rows += [gone, row("tunic/stop", metric="cost/frame", value=None, seed=3, status="failed", reason="gone")]
    (mean,) = (
        line[2] for line in make_tables(run_of(rows))["energies"].rows if line[:2] == ("tshirt", "snug")
    )
    assert (mean.missing, mean.complete, mean.fewer) == (1, False, " (2 of 3 roll-outs)")
    assert mean_of(run_of(rows).garment_rows, "snug", "energy/total", ["tshirt/walk"]) == mean


def test_garments_have_their_own_means_and_stand_as_they_are_declared():
    rows = [row("tunic/stop", value=9.0), row("tshirt/walk", value=1.0), row("tshirt/kick", value=3.0)]
    run = run_of(rows)
    assert run.garments(run.garment_rows) == {
        "tshirt": ["tshirt/walk", "tshirt/kick"],
        "tunic": ["tunic/stop"],
    }
    assert list(run.garments(run.garment_rows[run.garment_rows["garment"] == "tunic"])) == ["tunic"]
    means = [(line[0], line[2].value) for line in make_tables(run)["energies"].rows]
    assert means == [("tshirt", 2.0), ("tunic", 9.0)]


def test_a_cell_of_two_suites_counts_once_in_its_own_table():
    """Where nothing is worn, a table is scene by scene."""
    rows = [
        row("flag", metric="gap/energy", value=v, suite=s) for v, s in ((1.0, "garments"), (2.0, "speed"))
    ]
    table = make_tables(run_of(rows))["speed_by_scene"]
    assert [(*line[:3], line[3].value) for line in table.rows] == [("garments", "flag", "snug", 1.0)]


def test_what_is_judged_outside_of_the_checks_stands_with_them():
    more = {"unit": "weights", "method": "simulation", "tolerance": 2e-6, "expected": 0.0}
    rows = [row(metric="conservation/momentum_worst", value=1e-9, **more), *all_rows()]
    table = make_tables(run_of(rows))["validation"]
    assert [line[0] for line in table.rows] == [
        "tshirt/walk: Momentum_worst", "falls_freely", "zero_modes", "sag",
    ]  # fmt: skip
    assert [line[-1] for line in table.rows] == ["pass", "pass", "pass", "failed"]
    assert "of 4 checks 1 failed" in endings(run_of(rows))


def test_a_check_that_must_be_exact_is_no_tolerances_away_or_infinitely_many():
    numbers_of = {"suite": "validation", "method": "simulation", "metric": "check", "expected": 6.0}
    rows = [
        row("exact", value=6.0, tolerance=0.0, **numbers_of),
        row("near", value=6.5, tolerance=2.0, **numbers_of),
    ]
    rows += [row("off", value=7.0, tolerance=0.0, **numbers_of), row("told", value=7.0, **numbers_of)]
    table = make_tables(run_of(rows))["validation"]
    assert [line[column(table, "away")] for line in table.rows] == [0.0, 0.25, float("inf"), None]
    (block,) = lay_out_table(run_of(rows), table)
    assert block["groups"][0]["rows"][2][column(table, "away")]["text"] == "∞"


def test_a_wide_table_goes_on_below_with_its_heads():
    rows = [row(metric=f"energy/{k}", value=float(k)) for k in range(13)]
    run = run_of(rows)
    blocks = list(lay_out_table(run, make_tables(run)["energies"]))
    heads = [[column["title"] for column in block["columns"]] for block in blocks]
    assert [len(head) for head in heads] == [8, 7] and {head[0] for head in heads} == {"Method"}
    assert blocks[1]["caption"].endswith("(continued)")


# --- ablations ----------------------------------------------------------------------------------------------


def test_a_duration_has_its_own_unit_and_none_over_its_column():
    run = run_of([row("tshirt/walk", "snug", "cost/train", 160.0, unit="s")])
    (block,) = lay_out_table(run, make_tables(run)["cost"])
    assert [column["unit"] for column in block["columns"]][1:] == [""]
    assert [cell["text"] for cell in block["groups"][0]["rows"][0]][1:] == ["2.67 min"]


def test_ablations_leave_the_other_tables_and_stand_below_the_full_recipe():
    rows = seeds_of("snug-no-noise", "curvature/error", (2.0, 2.2, 2.4))
    rows += seeds_of("snug-window6", "curvature/error", (1.0, 1.2, 1.4))
    rows += seeds_of("snug", "curvature/error", (1.0, 1.1, 1.2))
    long = {"scene": "tshirt/there_and_back", "unit": "mm"}
    rows += seeds_of("snug", "roll_out/drift", (1.0, 1.1, 1.2), **long)
    rows += seeds_of("snug-no-noise", "roll_out/drift", (0.1,), **long)
    made = make_tables(run_of(rows))
    assert [line[1] for line in made["curvature"].rows] == ["snug"]
    assert [line[1] for line in made["ablations"].rows] == ["snug", "snug-no-noise", "snug-window6"]
    captions = made["ablations"].caption + made["ablation_effects"].caption
    assert "recipe" not in captions and "ingredient" not in captions  # a variant may have more of it
    full = made["ablations"].rows[0]
    assert full[-2] == Mean(pytest.approx(1.1), pytest.approx(0.1), seeds=3, asked=3)
    lines = {line[1]: line[2:] for line in made["ablation_effects"].rows}
    assert list(lines) == ["snug-no-noise", "snug-window6"]
    error, drift = lines["snug-no-noise"]
    assert error.shown == pytest.approx((2.0 * 2.2 * 2.4 / (1.0 * 1.1 * 1.2)) ** (1 / 3))
    assert error.interval[0] > 1.0 > drift.interval[1] and error.covers == "seeds"
    assert lines["snug-window6"][1] is None
    # They are described: no word says which of them is better.
    (block,) = lay_out_table(run_of(rows), made["ablation_effects"])
    assert not re.search("better|worse|significant", json.dumps(block))


def test_without_the_full_recipe_ablations_stand_in_the_other_tables():
    cost = {"unit": "ms", "method": "snug-springs"}
    rows = [row(method="snug-springs", metric="energy/total"), row(metric="cost/frame", **cost)]
    full = [row(metric=r.metric) for r in rows]
    assert [line[1] for line in make_tables(run_of(rows))["energies"].rows] == ["snug-springs"]
    assert [line[1] for line in make_tables(run_of([*rows, *full]))["energies"].rows] == ["snug"]
    assert ablations(run_of(rows)) == ablation_effects(run_of(rows)) == ablations(run_of(full)) == []


def on_two_scenes(method, *values, metric="energy/total"):
    return [row(scene, method, metric, value) for scene, value in zip(SCENES, values)]


def test_ablations_are_compared_over_the_scenes_that_both_have():
    rows = on_two_scenes("snug", 1.0, 9.0, metric="curvature/error")
    run = run_of(rows + on_two_scenes("snug-no-noise", 2.0, metric="curvature/error"))
    (line,) = ablation_effects(run)[0].rows
    assert line[2].shown == pytest.approx(2.0) and line[2].scale == RATIO and not line[2].complete
    assert [line[2].value for line in ablations(run)[0].rows] == [5.0, 2.0]


def test_pairs_share_their_scenes_or_have_their_own():
    rows = [*on_two_scenes("snug", 1.0, 9.0), row(SCENES[1], "pbns", "energy/total", 4.0)]
    mean, other = pair(run_of(rows).frame, "snug", "pbns", "energy/total")
    assert (mean.value, other.value, mean.complete) == (9.0, 4.0, False)
    apart = [row(SCENES[0], metric="energy/total"), row(SCENES[1], "pbns", "energy/total")]
    assert pair(run_of(apart).frame, "snug", "pbns", "energy/total") == (None, None)
    assert pair(run_of(rows[:2]).frame, "snug", "pbns", "energy/total")[0].value == 5.0


# --- numbers ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.064349, "0.0643"),
        (12.34, "12.3"),
        (1734.0, "1,734"),
        (-0.5, "−0.500"),
        (0.0, "0"),
        (9.996, "10.0"),
        (2.5e-7, "2.50×10⁻⁷"),
        (3.2e9, "3.20×10⁹"),
        (None, "–"),
        (float("nan"), "–"),
        (float("inf"), "–"),
    ],
)
def test_numbers_as_text(value, text):
    assert table.number(value) == text


def test_other_texts():
    assert table.number(0.2835, 7, trim=True) == "0.2835" and table.number(6.0, 7, trim=True) == "6"
    assert table.with_spread(0.5, 0.012) == "0.500 ± 0.012" and table.with_spread(0.5, None) == "0.500"
    assert [table.duration(s) for s in (0.0, 61.0, 402.0, 104400.0, None)] == [
        "0 s", "61.0 s", "6.70 min", "29.0 h", "–",
    ]  # fmt: skip
    assert table.csv_number(None) == "-" and table.csv_number(0.0) == "0"


def test_decimal_points_stand_in_a_column():
    padded = table.aligned(["0.123", "18.2", "400", "–"])
    assert len({len(text) - text.index(".") for text in padded[:2]}) == 1
    assert len(padded[2]) - 3 == len(padded[0]) - 1 and padded[3] == "–"
