"""Means, tables, numbers and the page of the report: as the rows say, dashes where there are none."""

from __future__ import annotations

import dataclasses
import json
import re
from pathlib import Path

import numpy as np
import pytest

from benchmarks.runner.run_json import described
from benchmarks.validation.registry import CASES
from reports.blocks import BLOCKS
from reports.blocks.block import FigureBlock, Report
from reports.blocks.page_one_sentences import headline
from reports.blocks.printed_tables import shortened
from reports.blocks.what_went_wrong import endings, failures
from reports.document.content import content
from reports.document.layout import lay_out, lay_out_table
from reports.figures import FIGURES
from reports.figures.figure import Picture
from reports.pictures import PICTURES
from reports.run.finished_run import make_run
from reports.statistics import paper_claims
from reports.statistics.effects import RATIO
from reports.statistics.means_and_spreads import Mean, mean_of, pair
from reports.statistics.outcomes import map_points
from reports.statistics.page_one_methods import leads
from reports.tables import make_tables, number_texts
from reports.tables.ablations import ablation_effects, ablations
from reports.tables.outcomes import merged
from reports.tables.page_one_table import ROWS
from reports.tables.table import Column, Table
from tests.benchmarks.tasks.test_cell_tasks import plan_of
from tests.reports.report_folder import SCENES, all_rows, report_of, row, run_of, skipped


def seeds_of(method, metric, values, **more):
    return [row(method=method, metric=metric, value=value, seed=k, **more) for k, value in enumerate(values)]


def column(table, name):
    return [column.name for column in table.columns].index(name)


def test_every_declared_case_has_its_place_in_the_tables(tmp_path):
    rows = [case.row(1.0, "ok") for case in CASES]
    run = make_run(described(plan_of(tmp_path, cases=CASES), rows), rows)
    tables = make_tables(run)
    maps = {case.name for case in CASES if case.map_point}
    tested = {case.name for case in CASES if case.suite == "extremes"} - maps
    assert {line[0] for line in tables["extremes"].rows} == tested and set(map_points(run)) == maps
    checked = [case for case in CASES if case.suite in ("validation", "fabric")]
    assert len(tables["validation"].rows) == len(checked)


def test_mean_and_spread_over_seeds():
    rows = [row(scene, seed=s, value=v) for scene in SCENES for s, v in ((0, 1.0), (1, 3.0), (2, 8.0))]
    mean = mean_of(run_of(rows).frame, "snug", "energy/strain")
    assert mean == Mean(4.0, pytest.approx(np.std([1, 3, 8], ddof=1)), scenes=2, seeds=3, asked=6)
    assert dict(mean.cells) == {(scene, s): v for scene in SCENES for s, v in enumerate((1.0, 3.0, 8.0))}
    assert mean_of(run_of(rows[:1]).frame, "snug", "energy/strain", SCENES[:1]).spread is None
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
    found = [(line[0], line[2].value) for line in make_tables(run)["energies"].rows]
    assert found == [("tshirt", 2.0), ("tunic", 9.0)]


def test_a_cell_of_two_suites_counts_once_in_its_own_table():
    rows = [row(value=v, metric="cost/frame", suite=s) for v, s in ((1.0, "garments"), (2.0, "speed"))]
    rows += [row(value=v, suite=s) for v, s in ((1.0, "garments"), (2.0, "speed"))]
    rows += [row(metric="gap/relative", suite="speed")]
    made = make_tables(run_of(rows))
    by_scene, speed = made["energies_by_scene"], made["speed"]
    assert [line[3].value for line in by_scene.rows] == [1.0]
    assert [line[column(speed, "cost/frame")].value for line in speed.rows] == [2.0]


def test_lines_that_differ_in_their_scene_alone_become_one():
    table = make_tables(run_of([skipped(scene="a"), skipped(scene="b"), skipped(scene="c", reason="other")]))
    assert [line[1] for line in merged(table["unfinished"], ("scene",)).rows] == ["a, b", "c"]


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
    assert full[-2] == Mean(pytest.approx(1.1), pytest.approx(0.1), scenes=1, seeds=3, asked=3)
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
    own, other = pair(run_of(rows).frame, "snug", "pbns", "energy/total")
    assert (own.value, other.value, own.complete) == (9.0, 4.0, False)
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
    assert number_texts.number(value) == text


def test_other_texts():
    assert (
        number_texts.number(0.2835, 7, trim=True) == "0.2835"
        and number_texts.number(6.0, 7, trim=True) == "6"
    )
    assert (
        number_texts.with_spread(0.5, 0.012) == "0.500 ± 0.012"
        and number_texts.with_spread(0.5, None) == "0.500"
    )
    assert [number_texts.duration(s) for s in (0.0, 61.0, 402.0, 104400.0, None)] == [
        "0 s", "61.0 s", "6.70 min", "29.0 h", "–",
    ]  # fmt: skip
    assert number_texts.csv_number(None) == "-" and number_texts.csv_number(0.0) == "0"


def test_decimal_points_stand_in_a_column():
    padded = number_texts.aligned(["0.123", "18.2", "400", "–"])
    assert len({len(text) - text.index(".") for text in padded[:2]}) == 1
    assert len(padded[2]) - 3 == len(padded[0]) - 1 and padded[3] == "–"


# --- the page -----------------------------------------------------------------------------------------------


def near(rows) -> str:
    return dict(headline(run_of(rows)))["How near"].replace("\u00a0", " ")


# Skinning has 10 J more than the simulation in either scene.
BESIDE = [*on_two_scenes("simulation", 0.5, 7.0), *on_two_scenes("skinning", 10.5, 17.0)]


def test_the_headline_is_the_share_of_skinnings_excess_over_the_scenes_that_a_network_has():
    rows = on_two_scenes("snug", 1.0, 9.0) + BESIDE  # 5 and 20 %
    typical = np.sinh(np.arcsinh([5.0, 20.0]).mean())
    said = near(rows)
    assert said.startswith(
        f"On 2 unseen motions SNUG has a relative excess of {number_texts.number(typical, 2)} % ("
    )
    assert (
        "where the energy of the reference simulation is 0 % and that of skinning alone 100 %. Whether"
        in said
    )
    assert said.endswith("the arithmetic mean of SNUG is 12 %, and its worst motion, jump, has 20 %.")
    rows.append(row(SCENES[0], "pbns", "energy/total", 2.0))
    assert "PBNS has 15 %. Which of SNUG and PBNS has less is inconclusive. These" in near(rows)
    # A member of the reference's ensemble is no rival, however near it is.
    assert near(rows + on_two_scenes("simulation-perturbed-1e-4", 0.5, 7.0)) == near(rows)


def test_a_primary_claim_that_does_not_hold_is_named(monkeypatch):
    rows = on_two_scenes("snug", 1.0, 9.0) + BESIDE
    assert "What does not hold" not in dict(headline(run_of(rows))).get("How certain", "")
    monkeypatch.setattr(paper_claims, "verdict", lambda claim, far, p: paper_claims.FAILS)
    said = dict(headline(run_of(rows)))["How certain"].replace("\u00a0", " ")
    assert "Of the paper's 1 primary claim 1 does not hold. What does not hold: Figure 7: close to" in said
    assert said.endswith("(relative excess: SNUG ≤ Simulation).")


def test_the_headline_is_of_the_first_garment_and_of_unseen_motions():
    rows = on_two_scenes("snug", 1.0, 9.0) + BESIDE
    more = [row("skirt/walk", name, "energy/total", 3.0) for name in ("snug", "simulation")]
    assert near(rows + more) == near(rows)

    def said(*trained):
        scenes = {name: {"role": "training" if name in trained else "test"} for name in SCENES}
        return dict(headline(run_of(rows, scenes=scenes)))["How near"].replace("\u00a0", " ")

    assert said(SCENES[1]).startswith("On 1 unseen motion SNUG has a relative excess of 5.0 %,")
    assert said(*SCENES).startswith("On 2 motions SNUG has")
    checked = dict(headline(run_of(rows, split="validation")))["How near"].replace("\u00a0", " ")
    assert checked.startswith("On 2 validation motions SNUG has")


def test_run_times_are_of_the_scenes_that_both_have():
    times = [(SCENES[0], "snug", 9.0), (SCENES[1], "snug", 0.25), (SCENES[1], "simulation", 100.0)]
    run = run_of([row(s, m, "cost/frame", t, unit="ms") for s, m, t in times])
    assert (
        dict(headline(run))["At what cost"]
        .replace("\u00a0", " ")
        .startswith("SNUG takes 0.250 ms a frame on one core, the simulation 400 times as long")
    )


def test_page_one_counts_every_kind_of_ending():
    rows = [*all_rows(), row("tshirt/walk", "pbns", "energy/bending", status="stalled", reason="a frame")]
    rows.append(
        row("tshirt/jump", "pbns", "energy/strain", None, status="timeout", reason="over 600 s", seed=1)
    )
    said = endings(run_of(rows))
    assert (
        "cells 2 failed, 1 timeout, 1 stalled, 1 skipped; of 3 checks 1 failed; of 2 stress tests 1 timeout"
        in said
    )
    assert endings(run_of(rows[:3])) == "Of 1 cells all ended well."
    table = make_tables(run_of(rows))["endings"]
    lines = {line[0]: dict(zip([c.name for c in table.columns], line)) for line in table.rows}
    assert lines["checks"]["failed"] == 1 and lines["checks"]["all"] == 3 and lines["cells"]["timeout"] == 1
    # A metric that is not finite, or off its tolerance, fails no cell that has others.
    rows[:3] = [
        *rows[:3],
        row("tshirt/walk", "pbns", "gap/energy", None, status="failed", reason="no number"),
    ]
    assert "cells 2 failed, 1 timeout, 1 stalled, 1 skipped;" in endings(run_of(rows))


@pytest.mark.parametrize(
    ("workers", "said"),
    [(None, ""), (1, "one after another, "), (4, "up to 4 side by side, ")],
)
def test_times_say_what_ran_beside(workers, said):
    assert content(report_of(all_rows()[-5:], workers=workers))["workers"] == f"{said}one thread each."


def test_sections_exist_only_for_what_ran():
    check = row("falls", "simulation", "check", 0.5, suite="validation", expected=0.0, tolerance=1.0)
    failed = dataclasses.replace(check, scene="sag", status="failed", reason="off")
    report = report_of([check, failed])
    made = content(report)
    endings_title = "How cells, checks and stress tests ended"
    assert [section["title"] for section in made["sections"]] == ["Validation", endings_title]
    (worst,) = made["first"]
    assert made["definitions"] == [] and worst["small"] and worst["pairs"][0][0] == "What went worst"
    assert set(report.tables) == {"validation", "metrics", "endings"}
    (block,) = made["sections"][0]["blocks"]
    assert [line[0]["text"] for line in block["groups"][0]["rows"]] == ["sag"]  # what passes is in the CSV


def test_every_metric_of_a_printed_table_is_defined_as_it_defines_itself():
    definitions = dict(content(report_of(all_rows()))["definitions"])
    assert (
        definitions["Strain [J]"] == "definition of energy/strain" and "Curvature error [1/m]" in definitions
    )


def test_the_report_lists_the_stress_tests_that_did_not_converge_and_the_table_all():
    report = report_of(all_rows())
    assert [line[:3] for line in report.tables["extremes"].rows] == [
        ("stiff", "simulation", "converged"), ("teleport", "simulation", "timeout"),
    ]  # fmt: skip
    sections = {s["title"]: s["blocks"] for s in content(report)["sections"]}
    (block,) = sections["Stress"]
    assert [[cell["text"] for cell in line[:3]] for line in block["groups"][0]["rows"]] == [
        ["teleport", "Simulation", "timeout"]
    ]
    assert endings(report.run).endswith("of 2 stress tests 1 timeout.")


def test_page_one_names_the_worst_of_each_kind():
    stretched = [row("tshirt/kick", m, "energy/strain", v) for m, v in (("simulation", 0.1), ("snug", 0.9))]
    found = failures(run_of([*all_rows(), *stretched]))
    assert ("Supervised, tshirt/walk", "failed: diverged at step 7") in found
    assert any(name == "Simulation, teleport" for name, _ in found)
    assert ("SNUG, tshirt/kick", "mean strain 0.900 J, 9.00 times the simulation's") in found
    assert not any("Skinning" in name for name, _ in found)  # no network: nobody expects better of it
    assert failures(run_of([row(method="simulation"), row()])) == []  # as much strain is no failure


def test_page_one_shows_the_network_the_best_of_others_and_a_baseline():
    run = run_of(all_rows())
    assert leads(run, run.garment_rows) == ["simulation", "snug", "pbns", "skinning"]
    better = run_of(
        [*all_rows(), *(row(s, "supervised", "curvature/error", 0.1, unit="1/m") for s in SCENES)]
    )
    assert leads(better, better.garment_rows)[2] == "supervised"
    assert leads(run, run.garment_rows, ["pbns", "simulation"]) == ["simulation", "pbns"]


def test_roll_outs_of_the_user_are_on_page_one_beside_snug_or_alone():
    def mine(inside: float = 2.5):
        rows = on_two_scenes("mine", 3.0, 9.0) + [
            row(s, "mine", m, v, unit=u)
            for s in SCENES
            for m, v, u in (("penetration/surface", inside, "%"), ("dynamics/amplitude", 0.5, "1"))
        ]
        return [dataclasses.replace(r, role="external", seeded=False, pairing_group="") for r in rows]

    reference = on_two_scenes("simulation", 0.5, 7.0) + on_two_scenes("skinning", 10.5, 17.0)
    alone, beside = run_of([*reference, *mine()]), run_of([*all_rows(), *mine()])
    assert leads(alone, alone.garment_rows) == ["simulation", "mine", "skinning"]
    assert leads(beside, beside.garment_rows)[:3] == ["simulation", "snug", "mine"]
    said = {topic: text.replace("\u00a0", " ") for topic, text in headline(alone)}
    assert "mine has a relative excess of" in said["How near"]
    assert said["How it moves"].startswith(
        "Mine has less secondary motion: its hem amplitude is 50 % of the simulation's. 2.5 % "
    )
    assert "mine" in {line[0] for line in make_tables(alone)["overview"].rows}


def test_a_roll_out_in_scenes_without_skinning_has_its_distance_on_page_one():
    numbers = (("distance/rms", 12.0, "mm"), ("gap/energy", 0.25, "J"))
    mine = [
        dataclasses.replace(row(s, "mine", m, v, unit=u), role="external", seeded=False, pairing_group="")
        for s in ("free_fall", "flag")
        for m, v, u in numbers
    ]
    run = run_of([*(row(s, "simulation", "energy/total", 0.5) for s in ("free_fall", "flag")), *mine])
    said = dict(headline(run))["How near"].replace("\u00a0", " ")
    assert said == "mine lies 12.0 mm from the reference, with an energy gap of 0.250 J."


def test_changed_networks_are_networks_where_a_run_has_no_others():
    rows = on_two_scenes("snug-springs", 1.0, 9.0) + on_two_scenes("simulation", 0.5, 7.0)
    changed = [dataclasses.replace(r, role="ablation", base="snug") for r in rows[:2]] + rows[2:]
    run = run_of(changed)
    assert leads(run, run.garment_rows) == ["simulation", "snug-springs"]
    assert "SNUG, springs has" in near(changed + on_two_scenes("skinning", 10.5, 17.0))
    both = run_of(changed + on_two_scenes("snug", 1.0, 9.0))
    assert leads(both, both.garment_rows) == ["simulation", "snug"]


def test_the_table_of_page_one_stays_short():
    many = [row(scene, f"mine-{k}", "energy/total", 1.0 + k) for k in range(20) for scene in SCENES]
    made = make_tables(run_of([*all_rows(), *many]))
    methods = [line[0] for line in made["overview"].rows]
    assert len(methods) <= ROWS and {"simulation", "snug", "skinning"} < set(methods)
    short = shortened(made["energies"], 12)
    assert len(short.rows) == 12 and short.note.startswith("12 more rows are in tables/energies.csv")


def test_a_shortened_table_has_rows_of_each_garment():
    columns = (Column("garment", "Garment", text=True), Column("method", "Method", text=True))
    lines = tuple((garment, f"{garment}-{k}") for garment in ("shirt", "tunic") for k in range(8))
    short = shortened(Table("energies", columns, lines, grouped_by=("garment",)), 12)
    assert short.rows == (*lines[:6], *lines[8:14])


def test_a_figure_alone_in_its_row_keeps_its_width():
    run, picture = run_of(all_rows()), Picture(Path("half.svg"), "said", 0.5)
    block = FigureBlock("break_even", "against_vertices")
    assert lay_out(Report(run, {}, {"break_even": [picture]}), block) == [
        {"kind": "figure", "path": "figures/half.svg", "caption": "said", "width": 0.5}
    ]
    both = {"break_even": [picture], "against_vertices": [picture]}
    assert [values["kind"] for values in lay_out(Report(run, {}, both), block)] == ["row"]


def test_every_block_names_a_figure_or_table_that_is_declared():
    figures = {figure.name for figure in (*FIGURES, *PICTURES)}
    named = {
        name for block in BLOCKS if isinstance(block, FigureBlock) for name in (block.name, block.beside)
    }
    assert named - {""} == figures


def test_no_number_of_the_report_is_infinite_or_nan():
    made = json.dumps(content(report_of(all_rows())), allow_nan=False)
    assert not re.search(r"\b(nan|inf|NaN|None)\b", made)


def test_the_page_says_how_many_seeds_there_were():
    rows = seeds_of("snug", "energy/strain", (1.0, 1.1, 1.2)) + seeds_of("pbns", "energy/strain", (2.0, 2.1))
    sections = content(report_of(rows + seeds_of("simulation", "energy/strain", (1.0,))))["sections"]
    block = sections[0]["blocks"][0]
    assert "±: standard deviation over 2 or 3 seeds. Without it: one seed" in block["note"]


def test_methods_that_share_a_number_only_with_other_rows_are_their_own_family():
    rows = [dataclasses.replace(row(), family="")]
    assert run_of(rows).methods["snug"].family == "snug"
