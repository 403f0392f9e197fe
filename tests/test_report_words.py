"""Words, numbers and tables of the report: as the rows say, dashes where there are none."""

from __future__ import annotations

import dataclasses
import json
import re

import numpy as np
import pytest
from report_folder import SCENES, all_rows, row, skipped

from benchmarks.results import NOT_FALLING
from reports import numbers, study_tables, tables, words
from reports.document import document, merged
from reports.layout import table_block
from reports.summary import Mean, Measurements


def test_mean_and_spread_over_seeds():
    rows = [row(scene, seed=s, value=v) for scene in SCENES for s, v in ((0, 1.0), (1, 3.0), (2, 8.0))]
    mean = Measurements(rows).mean("snug", "energy/strain", SCENES)
    assert mean == Mean(4.0, pytest.approx(np.std([1, 3, 8], ddof=1)), scenes=2, seeds=3, complete=True)
    assert Measurements(rows[:1]).mean("snug", "energy/strain", SCENES[:1]).spread is None


def test_a_failed_cell_enters_no_mean_and_the_table_says_so():
    rows = [
        row("dressed/walk", value=1.0),
        row("dressed/jump", value=100.0, status="failed", reason="x"),
        row("dressed/walk", "simulation", value=4.0, status="stalled", reason="2 frames"),
        row("dressed/jump", "simulation", value=6.0),
    ]
    table = tables.energies(rows)
    assert table is not None
    lines = {line[1]: line[2] for line in table.rows}
    assert lines["snug"].value == 1.0 and not lines["snug"].complete
    assert lines["simulation"].value == 5.0 and lines["simulation"].complete and lines["simulation"].stalled
    block = table_block(table, "", grouped_by=("garment",))
    assert [line[1]["mark"] for line in block["groups"][0]["rows"]] == ["†", "*"]
    assert "fewer scenes" in block["note"] and "unconverged" in block["note"]


def test_a_cell_of_two_suites_counts_once_in_its_own_table():
    rows = [row(value=v, metric="cost/frame", suite=s) for v, s in ((1.0, "garments"), (2.0, "speed"))]
    rows += [row(value=v, suite=s) for v, s in ((1.0, "garments"), (2.0, "speed"))]
    by_scene, speed = tables.energies_by_scene(rows), tables.speed(rows)
    assert by_scene is not None and speed is not None
    assert [line[2].value for line in by_scene.rows] == [1.0] and speed.rows[0][2].value == 2.0


def test_lines_that_differ_in_their_scene_alone_become_one():
    table = tables.unfinished([skipped(scene="a"), skipped(scene="b"), skipped(scene="c", reason="other")])
    assert table is not None
    assert [line[1] for line in merged(table, "scene").rows] == ["a, b", "c"]


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
    assert numbers.number(value) == text


def test_other_texts():
    assert numbers.number(0.2835, 7, trim=True) == "0.2835" and numbers.number(6.0, 7, trim=True) == "6"
    assert numbers.with_spread(0.5, 0.012) == "0.500 ± 0.012" and numbers.with_spread(0.5, None) == "0.500"
    assert [numbers.duration(s) for s in (0.0, 61.0, 402.0, 104400.0, None)] == [
        "0 s", "61.0 s", "6.70 min", "29.0 h", "–",
    ]  # fmt: skip
    assert numbers.csv_number(None) == "-" and numbers.csv_number(0.0) == "0"


def test_decimal_points_stand_in_a_column():
    padded = numbers.aligned(["0.123", "18.2", "400", "–"])
    assert len({len(text) - text.index(".") for text in padded[:2]}) == 1
    assert len(padded[2]) - 3 == len(padded[0]) - 1 and padded[3] == "–"


def test_the_answer_follows_the_numbers():
    def said(snug: float, pbns: float) -> str:
        values = (("snug", snug), ("pbns", pbns))
        terms = ("strain", "bending", "gravity", "inertia", "total")
        rows = [row(method=m, metric=f"energy/{t}", value=v) for m, v in values for t in terms]
        return " ".join(text for _, text in words.findings(rows))

    assert "per frame, less than PBNS" in said(1.0, 2.5) and "inertia is reproduced." not in said(2.5, 1.0)
    assert "per frame, less than SNUG" in said(2.5, 1.0) and "2.5 times as much" in said(2.5, 1.0)
    assert "SNUG is lower in strain" in said(1.0, 2.5) and "SNUG is higher in strain" in said(2.5, 1.0)
    assert "gravity and inertia, is reproduced." in said(1.0, 1.2)
    assert "equal in strain" in said(1.0, 1.001) and "reproduced in 0 of 4" in said(1.0, 1.001)


def test_a_difference_within_the_spread_of_the_seeds_is_no_difference():
    rows = [row(seed=s, value=v) for s, v in ((0, 0.8), (1, 1.2))]
    rows += [row(method="pbns", seed=s, value=v) for s, v in ((0, 0.9), (1, 1.3))]
    measured = Measurements(rows)
    assert words.against(measured, "pbns").startswith("SNUG is equal in strain")


def test_words_compare_means_over_the_scenes_that_both_have():
    rows = [row(scene, "snug", "energy/total", v) for scene, v in zip(SCENES, (1.0, 9.0))]
    rows.append(row(SCENES[0], "pbns", "energy/total", 2.0))
    measured = Measurements(rows)
    assert words.against(measured, "pbns").startswith("SNUG is lower in total (−50 %) (1 scene only).")
    assert words.lowest_network(measured).startswith("On unseen motions (1 scene only) SNUG has")
    assert "a mean total of 1.00 J per frame, less than PBNS 2.00 J." in words.lowest_network(measured)
    alone = Measurements(rows[:2])
    assert words.lowest_network(alone) == "On unseen motions SNUG has a mean total of 5.00 J per frame."
    rows = [row(s, m, "curvature/error", v) for s, m, v in zip((*SCENES, SCENES[0]), ("snug", "snug", "pbns"),
            (1.0, 9.0, 2.0))]  # fmt: skip
    # The reference's twin and the bound run no garment, however near they are.
    rows += [row(SCENES[0], m, "curvature/error", 1e-8) for m in ("simulation-moved", "free-bound")]
    assert words.curvature(Measurements(rows)) == (
        "Smallest mean-curvature error (1 scene only): SNUG, 1.00 1/m (PBNS 2.00)."
    )


def test_the_smallest_curvature_error_is_the_smallest_of_all_that_ran():
    """Also where there are more methods than a sentence names."""
    others = {f"lbfgs-{n}": 9.0 - n / 10 for n in range(1, 9)}
    errors = {"snug": 4.0, "pbns": 6.0, "tailornet": 3.6, "lbfgs-10": 3.4} | others
    rows = [row(method=m, metric="curvature/error", value=v, unit="1/m") for m, v in errors.items()]
    text = words.curvature(Measurements(rows))
    assert text.startswith("Smallest mean-curvature error: L-BFGS, 10 iterations, 3.40 1/m (TailorNet 3.60,")
    assert text.endswith("SNUG 4.00, PBNS 6.00).") and "8 iterations" not in text


def test_ablations_are_counted_in_what_was_measured():
    rows = [
        row(method=method, metric="energy/total", value=value, seed=seed)
        for method, value in (("snug", 1.0), ("snug-no-bending", 2.0))
        for seed in (0, 1)
    ]
    assert words.left_out(rows) == (
        "T-shirt, of 1 ablations, worse than full SNUG beyond the scatter of seeds: 1 in total energy."
    )


def test_laws_count_no_part_of_a_motion_twice():
    more = {"suite": "validation", "metric": "law/momentum", "unit": "%"}
    scenes = ("dressed/a", "dressed/a@clip", "dressed/b@clip")
    rows = [row(scene, "simulation", value=0.0, **more) for scene in scenes]
    rows += [row(scene, value=value, **more) for scene, value in zip(scenes, (10.0, 70.0, 20.0))]
    rows.append(row("tunic/a", value=99.0, **more))
    assert words.laws(rows).endswith("misses 0 % of the weight in a mean frame, SNUG 15.0 %.")
    rows += [dataclasses.replace(r, metric="law/residual") for r in rows]
    table = study_tables.laws(rows)
    assert table is not None
    assert {line[0]: line[1].value for line in table.rows} == {"simulation": 0.0, "snug": 15.0}


@pytest.mark.parametrize(
    ("workers", "said"),
    [(None, ""), (1, "one after another, "), (4, "up to 4 side by side, ")],
)
def test_times_say_what_ran_beside(workers, said):
    check = row("free_fall", "simulation", "check", 0.0, suite="validation", expected=0.0, tolerance=1.0)
    assert document({"workers": workers}, [check], {}, [], [])["workers"] == f"{said}one thread each."


def test_sections_exist_only_for_what_ran():
    check = row("free_fall", "simulation", "check", 0.0, suite="validation", expected=0.0, tolerance=1.0)
    made_tables = tables.make_tables([check])
    content = document({}, [check], made_tables, [], [])
    assert [section["title"] for section in content["sections"]] == ["Validation: known answers"]
    assert content["definitions"] == [] and content["lead"] is None
    assert set(made_tables) == {"validation", "metrics"}


def test_no_number_of_the_report_is_infinite_or_nan():
    content = document({}, all_rows(), tables.make_tables(all_rows()), [], [])
    assert not re.search(r"\b(nan|inf|NaN|None)\b", json.dumps(content, allow_nan=False))


def test_words_say_where_more_iterations_end_with_a_larger_gap():
    gaps = (
        ("lbfgs-5", 0.2, ""),
        ("lbfgs-10", 0.3, f"{NOT_FALLING}: lbfgs-5 has 0.2"),
    )
    rows = [row("flag", method, "gap/relative", v, suite="speed", reason=why) for method, v, why in gaps]
    found = dict(words.findings(rows))["Where it rises"]
    assert "flag: L-BFGS, 10 iterations (0.300)" in found and "5 iterations" not in found
    assert "Where it rises" not in dict(words.findings(rows[:1]))
